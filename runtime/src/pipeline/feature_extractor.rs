//! Music features and beat from sound, 20 frames a second, and Encodec latents
//! beside them for weights that were trained on those.
//!
//! Causal: frame `k` knows the samples before `k / 20` seconds, its latent too
//! (before the first sample it was silent). Where a recording ends its last
//! frame may be left out, because the latent needs the sound up to its end.

use servodance_audio::{MusicAnalyzer, Resampler, TempoRange};
use servodance_model::conditioning::{ENCODEC_RATE_HZ, Encodec, EncodecStream, HeardFrame, Latent};
use std::collections::VecDeque;

/// Features of one stream of mono samples.
pub struct FeatureExtractor {
    analyzer: MusicAnalyzer,
    encodec: Option<LatentExtractor>,
}

struct LatentExtractor {
    resampler: Resampler,
    stream: EncodecStream,
    block: Vec<f32>,
    ready: VecDeque<Latent>,
}

impl FeatureExtractor {
    /// The rate is that of the analyzer; latents come with an `encodec` only.
    pub fn new(
        analyzer: MusicAnalyzer,
        sample_rate_hz: u32,
        encodec: Option<&Encodec>,
    ) -> anyhow::Result<Self> {
        let latents = encodec.map(|encodec| LatentExtractor::new(encodec, sample_rate_hz));
        Ok(Self { analyzer, encodec: latents.transpose()? })
    }

    /// Takes mono samples, any number of them.
    pub fn push(&mut self, samples: &[f32]) -> anyhow::Result<()> {
        self.analyzer.push(samples);
        match &mut self.encodec {
            Some(latents) => latents.push(samples),
            None => Ok(()),
        }
    }

    /// The next frame, if its time has come.
    pub fn pop(&mut self) -> Option<HeardFrame> {
        let Some(latents) = &mut self.encodec else {
            return self.analyzer.pop().map(HeardFrame::from);
        };
        let latent = *latents.ready.front()?;
        let frame = self.analyzer.pop()?;
        latents.ready.pop_front();
        Some(HeardFrame { frame, latent: Some(latent) })
    }

    /// The analyzer, which keeps the history of features and beats.
    pub fn analyzer(&self) -> &MusicAnalyzer {
        &self.analyzer
    }

    /// See [`MusicAnalyzer::tap`].
    pub fn tap(&mut self, time_s: f64) {
        self.analyzer.tap(time_s);
    }

    /// See [`MusicAnalyzer::limit_tempo`].
    pub fn limit_tempo(&mut self, tempo: TempoRange) {
        self.analyzer.limit_tempo(tempo);
    }

    /// Lets go of the history before a time; see [`MusicAnalyzer::forget_before`].
    pub fn forget_before(&mut self, time_s: f64) {
        self.analyzer.forget_before(time_s);
    }
}

/// The latents of a whole recording, 20 a second from 0 s on, as a stream would
/// give them; after its end it is silent.
pub fn latents(
    encodec: &Encodec,
    samples: &[f32],
    sample_rate_hz: u32,
) -> anyhow::Result<Vec<Latent>> {
    let mut latents = LatentExtractor::new(encodec, sample_rate_hz)?;
    latents.push(samples)?;
    latents.push(&vec![0.0; sample_rate_hz as usize / 10])?;
    Ok(latents.ready.into())
}

impl LatentExtractor {
    fn new(encodec: &Encodec, sample_rate_hz: u32) -> anyhow::Result<Self> {
        let (stream, silence) = encodec.start_in_silence()?;
        Ok(Self {
            resampler: Resampler::new(sample_rate_hz, ENCODEC_RATE_HZ),
            stream,
            block: Vec::new(),
            ready: VecDeque::from([silence]),
        })
    }

    fn push(&mut self, samples: &[f32]) -> anyhow::Result<()> {
        let Self { resampler, block, .. } = self;
        block.clear();
        for &sample in samples {
            let finite = sample.is_finite();
            resampler.push(if finite { sample } else { 0.0 }, |s| block.push(s));
        }
        let ready = &mut self.ready;
        self.stream.push(&self.block, |latent| ready.push_back(*latent))?;
        Ok(())
    }
}
