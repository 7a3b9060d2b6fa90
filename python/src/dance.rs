//! Music in, human motion out.

use crate::{error, unpoisoned};
use numpy::ndarray::Array3;
use numpy::{PyArray3, PyReadonlyArray1};
use pyo3::prelude::*;
use servodance_audio::MusicAnalyzer;
use servodance_model::motion::Pose;
use servodance_model::{Dance, Generator, GeneratorOptions};
use servodance_runtime::offline::generate::poses_of_samples;
use servodance_runtime::pipeline::feature_extractor::FeatureExtractor;
use servodance_runtime::pipeline::model_args::EngineArgs;
use servodance_runtime::session::dance::open_generator;
use servodance_types::JOINT_COUNT;
use std::path::PathBuf;
use std::sync::Mutex;

#[pyfunction]
pub fn styles(model: Option<PathBuf>) -> PyResult<Vec<String>> {
    Ok(open(model)?.styles().to_vec())
}

#[pyfunction]
pub fn generate<'py>(
    py: Python<'py>,
    audio: PyReadonlyArray1<'py, f32>,
    rate_hz: u32,
    style: Option<String>,
    seed: u64,
    lookahead_s: f64,
    model: Option<PathBuf>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let samples = audio.as_slice()?;
    let poses = py.detach(|| {
        let mut dance = start(&open(model)?, style, seed)?;
        poses_of_samples(&mut dance, samples, rate_hz, lookahead_s).map_err(error)
    })?;
    array(py, &poses)
}

/// A dancer that hears music in blocks.
#[pyclass]
pub struct DanceStream {
    // A resampler is not `Sync`, which Python asks for.
    features: Mutex<FeatureExtractor>,
    dance: Dance,
}

#[pymethods]
impl DanceStream {
    #[new]
    fn new(
        py: Python<'_>,
        rate_hz: u32,
        style: Option<String>,
        seed: u64,
        model: Option<PathBuf>,
    ) -> PyResult<Self> {
        let analyzer = MusicAnalyzer::new(rate_hz).map_err(error)?;
        Ok(Self {
            features: FeatureExtractor::new(analyzer, rate_hz, None).map_err(error)?.into(),
            dance: py.detach(|| start(&open(model)?, style, seed))?,
        })
    }

    fn push<'py>(
        &mut self,
        py: Python<'py>,
        audio: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let samples = audio.as_slice()?;
        let Self { features, dance } = self;
        let features = unpoisoned(features)?;
        let poses: PyResult<Vec<Pose>> = py.detach(|| {
            features.push(samples).map_err(error)?;
            let heard = std::iter::from_fn(|| features.pop());
            heard.map(|heard| Ok(dance.step_heard(&heard).map_err(error)?.positions)).collect()
        });
        array(py, &poses?)
    }

    fn set_style(&mut self, style: &str) -> PyResult<()> {
        self.dance.set_style(style).map_err(error)
    }
}

fn open(model: Option<PathBuf>) -> PyResult<Generator> {
    open_generator(model.as_deref(), EngineArgs::default()).map_err(error)
}

fn start(generator: &Generator, style: Option<String>, seed: u64) -> PyResult<Dance> {
    generator.start(GeneratorOptions { seed, style, ..GeneratorOptions::default() }).map_err(error)
}

fn array<'py>(py: Python<'py>, poses: &[Pose]) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let values = poses.iter().flatten().flatten().copied().collect();
    let array = Array3::from_shape_vec((poses.len(), JOINT_COUNT, 3), values).map_err(error)?;
    Ok(PyArray3::from_owned_array(py, array))
}
