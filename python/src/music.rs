//! Beats and music features.

use crate::{error, table, unpoisoned};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use servodance_audio::{MusicAnalyzer, TempoRange};
use servodance_runtime::offline::beats::{BeatTracker, Beats};
use servodance_types::{BeatLock, MUSIC_DIM, MusicFrame};
use std::sync::Mutex;

/// Beat times, then tempo, meter, places, confidences.
type FoundBeats<'py> = (
    Bound<'py, PyArray1<f64>>,
    f64,
    Option<u8>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray1<f32>>,
);

#[pyfunction]
pub fn beats<'py>(
    py: Python<'py>,
    audio: PyReadonlyArray1<'py, f32>,
    rate_hz: u32,
    offline: bool,
    tempo: Option<(f64, f64)>,
) -> PyResult<FoundBeats<'py>> {
    let samples = audio.as_slice()?;
    let tracker = if offline { BeatTracker::Offline } else { BeatTracker::Causal };
    let tempo = tempo.map(|(low, high)| TempoRange::new(low, high)).transpose().map_err(error)?;
    let found = py.detach(|| Beats::of_samples(samples, rate_hz, tracker, tempo)).map_err(error)?;
    Ok((
        PyArray1::from_vec(py, found.times_s),
        found.tempo_bpm,
        found.meter,
        PyArray1::from_vec(py, found.places),
        PyArray1::from_vec(py, found.confidence),
    ))
}

/// Music in blocks, features out, as a live robot hears.
#[pyclass]
pub struct MusicStream {
    // A resampler is not `Sync`, which Python asks for.
    analyzer: Mutex<MusicAnalyzer>,
}

/// Times, feature vectors, and phase, tempo, confidence, presence, lock, place, meter.
type HeardFrames<'py> =
    (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>);

#[pymethods]
impl MusicStream {
    #[new]
    fn new(rate_hz: u32, tempo: Option<(f64, f64)>) -> PyResult<Self> {
        let mut analyzer = MusicAnalyzer::new(rate_hz).map_err(error)?;
        if let Some((low, high)) = tempo {
            analyzer.limit_tempo(TempoRange::new(low, high).map_err(error)?);
        }
        Ok(Self { analyzer: analyzer.into() })
    }

    fn tap(&mut self, time_s: f64) -> PyResult<()> {
        unpoisoned(&mut self.analyzer)?.tap(time_s);
        Ok(())
    }

    fn push<'py>(
        &mut self,
        py: Python<'py>,
        audio: PyReadonlyArray1<'py, f32>,
    ) -> PyResult<HeardFrames<'py>> {
        let samples = audio.as_slice()?;
        let analyzer = unpoisoned(&mut self.analyzer)?;
        let frames: Vec<MusicFrame> = py.detach(|| {
            analyzer.push(samples);
            std::iter::from_fn(|| analyzer.pop()).collect()
        });
        let vectors = frames.iter().flat_map(MusicFrame::vector).collect();
        let states = frames.iter().flat_map(state).collect();
        Ok((
            PyArray1::from_iter(py, frames.iter().map(|frame| frame.time_s)),
            table(py, vectors, MUSIC_DIM)?,
            table(py, states, 7)?,
        ))
    }
}

fn state(frame: &MusicFrame) -> [f32; 7] {
    let beat = frame.beat;
    let lock = match beat.lock {
        BeatLock::Lost => 0.0,
        BeatLock::Holding => 1.0,
        BeatLock::Locked => 2.0,
        BeatLock::Changing => 3.0,
    };
    let place = beat.beat_in_bar.map_or(0, |place| place + 1);
    let (phase, tempo, sure) = (beat.phase, beat.tempo_bpm, beat.confidence);
    let meter = beat.beats_in_bar.unwrap_or(0);
    [phase, tempo, sure, frame.presence, lock, f32::from(place), f32::from(meter)]
}
