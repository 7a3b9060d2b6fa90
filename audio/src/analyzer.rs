//! The analyzer: samples in, music features and beat out, 20 frames a second.
//!
//! Frame `k` is at `k / 20` seconds and depends only on samples before that time:
//! no lookahead. Look-back: 200 ms (envelope, MFCC), 1.4 s (chroma), some
//! seconds of running references and of beat memory. The beat's phase is
//! extrapolated to the frame's time over all delays of the analysis, so that
//! phase 0 is where the beat is audible.
//!
//! The result is the same to the bit for all block sizes. Memory is constant as
//! long as frames are taken out; a push allocates only when the queue of frames
//! grows. Samples that are not finite become 0 and are counted.

use std::collections::VecDeque;

use servodance_types::{BeatLock, FRAME_RATE_HZ, MusicFrame, SPECTRAL_DIM};

use crate::beats::{
    BeatCaller, BeatHistory, BeatNetwork, LiveBeat, MetricalReading, NetworkOutput, OnsetTracker,
    StepOnset, TempoRange, Tracker, input, offline_evidence,
};
use crate::features::ANALYSIS_RATE_HZ;
use crate::features::mfcc::{BEAT, SpectralFeatures};
use crate::features::music_detector::MusicDetector;
use crate::features::note_onset::NoteOnsets;
use crate::features::onset_strength::{HOP, LATENCY_S, Onset, OnsetDetector};
use crate::features::resampler::Resampler;
use crate::features::small_beat_network::SmallBeatNetwork;
use crate::features::spectrum::{SlidingWindow, sigmoid};

/// Samples a frame at the analysis rate.
const FRAME_HOP: u64 = 1024;

/// The network's beats of sharp onsets come so much early: the median of 24 songs with drums
/// of `fresh_songs.py`'s `dev/`.
const EARLY_S: f64 = 0.002;

/// Why an analyzer cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AnalyzerError {
    /// The sample rate in hertz is outside the range that is analyzed.
    #[error("the sample rate must be 4000 to 384000 Hz, not {0}")]
    SampleRate(u32),
}

/// Computes [`MusicFrame`]s from a stream of mono samples.
pub struct MusicAnalyzer {
    resampler: Resampler,
    core: AnalysisCore,
    replaced: u64,
}

struct AnalysisCore {
    recent: SlidingWindow,
    received: u64,
    features: SpectralFeatures,
    onsets: OnsetDetector,
    notes: NoteOnsets,
    older: Option<Onset>,
    network: BeatNetwork,
    small: SmallBeatNetwork,
    small_beat: f32,
    output: NetworkOutput,
    onset_tracker: OnsetTracker,
    tracker: Tracker,
    detector: MusicDetector,
    frames: VecDeque<MusicFrame>,
    caller: BeatCaller,
    history: Option<BeatHistory>,
    /// From an audible beat to the step that hears it.
    beat_delay_s: f64,
}

impl MusicAnalyzer {
    /// An analyzer for samples at `sample_rate_hz`. Frame 0, at 0 s, is ready at
    /// once and without content.
    /// Errors: a sample rate outside 4 to 384 kHz.
    pub fn new(sample_rate_hz: u32) -> Result<Self, AnalyzerError> {
        if !(4_000..=384_000).contains(&sample_rate_hz) {
            return Err(AnalyzerError::SampleRate(sample_rate_hz));
        }
        let resampler = Resampler::new(sample_rate_hz, ANALYSIS_RATE_HZ);
        let look_back = SpectralFeatures::LOOK_BACK.max(OnsetDetector::LOOK_BACK);
        let look_back = look_back.max(NoteOnsets::LOOK_BACK);
        let mut core = AnalysisCore {
            recent: SlidingWindow::new(look_back),
            received: 0,
            features: SpectralFeatures::new(ANALYSIS_RATE_HZ),
            onsets: OnsetDetector::new(ANALYSIS_RATE_HZ),
            notes: NoteOnsets::new(ANALYSIS_RATE_HZ),
            older: None,
            network: BeatNetwork::new(),
            small: SmallBeatNetwork::new(),
            small_beat: NetworkOutput::SILENCE.beat,
            output: NetworkOutput::SILENCE,
            onset_tracker: OnsetTracker::new(),
            tracker: Tracker::new(),
            detector: MusicDetector::new(),
            frames: VecDeque::new(),
            caller: BeatCaller::default(),
            history: None,
            beat_delay_s: BeatNetwork::LATE_S - EARLY_S + resampler.delay_s(),
        };
        core.emit();
        Ok(Self { resampler, core, replaced: 0 })
    }

    /// An analyzer that also keeps a [`BeatHistory`], which grows with the music.
    /// Errors: a sample rate outside 4 to 384 kHz.
    pub fn keeping_history(sample_rate_hz: u32) -> Result<Self, AnalyzerError> {
        let mut analyzer = Self::new(sample_rate_hz)?;
        let rate_hz = f64::from(ANALYSIS_RATE_HZ) / HOP as f64;
        let first_s = 1.0 / rate_hz - analyzer.core.beat_delay_s;
        analyzer.core.history = Some(BeatHistory { rate_hz, first_s, ..BeatHistory::default() });
        Ok(analyzer)
    }

    /// The history, if the analyzer was made to keep one.
    pub fn history(&self) -> Option<&BeatHistory> {
        self.core.history.as_ref()
    }

    /// Drops the history before `time_s`, so that a live source may run without
    /// end in constant memory.
    pub fn forget_before(&mut self, time_s: f64) {
        if let Some(history) = &mut self.core.history {
            history.forget_before(time_s);
        }
    }

    /// Follows no other tempi from now on.
    pub fn limit_tempo(&mut self, tempo: TempoRange) {
        self.core.tracker.limit_tempo(tempo);
    }

    /// A listener taps the beat at `time_s` of the music. Two taps, one beat apart, put
    /// tempo and phase right; they are kept until the music ends or is lost.
    pub fn tap(&mut self, time_s: f64) {
        let heard_s = self.core.received as f64 / f64::from(ANALYSIS_RATE_HZ);
        self.core.tracker.tap(heard_s - self.core.beat_delay_s - time_s);
    }

    /// Takes mono samples, a block of any length.
    pub fn push(&mut self, samples: &[f32]) {
        for &sample in samples {
            let finite = sample.is_finite();
            self.replaced += u64::from(!finite);
            let core = &mut self.core;
            let sample = if finite { sample } else { 0.0 };
            self.resampler.push(sample, |s| core.push(s));
        }
    }

    /// The next frame, if all its samples are there.
    pub fn pop(&mut self) -> Option<MusicFrame> {
        self.core.frames.pop_front()
    }

    /// The metrical readings of the onsets' beat at the newest sample, for fitting the
    /// weights of the choice; none without a beat.
    pub fn beat_readings(&self) -> Vec<MetricalReading> {
        self.core.onset_tracker.readings(self.resampler.delay_s() + LATENCY_S)
    }

    /// Number of samples that were not finite and became 0.
    pub fn replaced_samples(&self) -> u64 {
        self.replaced
    }
}

impl AnalysisCore {
    fn push(&mut self, sample: f32) {
        self.recent.push(sample);
        self.features.push(sample);
        self.received += 1;
        if self.received.is_multiple_of(HOP as u64) {
            let onset = self.onsets.hop(&self.recent);
            self.hop(onset);
        }
        if self.received.is_multiple_of(FRAME_HOP) {
            self.emit();
        }
    }

    /// Takes one hop of onsets; every second one completes a step.
    fn hop(&mut self, onset: Onset) {
        let older = self.older.take();
        if let Some(older) = &older {
            self.small_beat = self.small.step(older, &onset);
        }
        self.onset_tracker.hop(&onset, sigmoid(self.small_beat));
        let Some(older) = older else {
            self.older = Some(onset);
            return;
        };
        let notes = self.notes.step(&self.recent);
        self.output = self.network.step(&input(&older, &onset, &notes));
        let strongest = StepOnset {
            strength: older.strength.max(onset.strength),
            kick: older.groups[0].max(onset.groups[0]),
        };
        let guess = self.onset_tracker.beat(BeatNetwork::LATE_S - LATENCY_S);
        self.tracker.step(&self.output, strongest, guess, older.audible || onset.audible);
        self.record();
    }

    fn record(&mut self) {
        let Some(history) = &mut self.history else {
            return;
        };
        // The offline tracker runs at the rate of hops.
        history.evidence.extend([offline_evidence(&self.output); 2]);
        let beat = self.tracker.beat(self.beat_delay_s);
        let now_s = self.received as f64 / f64::from(ANALYSIS_RATE_HZ);
        let called = self.caller.call(now_s, beat.phase, beat.tempo_bpm);
        if let (Some(time_s), true) = (called, self.tracker.state() != BeatLock::Lost) {
            history.beats.push(LiveBeat { time_s, beat });
        }
    }

    fn emit(&mut self) {
        let index = self.received / FRAME_HOP;
        let mut spectral =
            if index == 0 { [0.0; SPECTRAL_DIM] } else { self.features.frame(&self.recent) };
        if index > 0 {
            let network = (!self.tracker.is_silent()).then_some(self.output.music);
            let beats = self.tracker.strength();
            let steady = self.detector.frame(self.features.fine_magnitude(), network, beats);
            self.tracker.hear_tones(steady, MusicDetector::LAG_S - self.beat_delay_s);
            self.tracker.set_presence(self.detector.presence());
            self.onset_tracker.set_presence(self.detector.presence());
            if let Some(history) = &mut self.history {
                history.presence.push(self.detector.presence());
            }
        }
        let beat = self.tracker.beat(self.beat_delay_s);
        // The frame nearest to the beat is marked.
        let half_frame = beat.tempo_bpm / 60.0 / (2.0 * FRAME_RATE_HZ as f32);
        let near = beat.phase < half_frame || beat.phase >= 1.0 - half_frame;
        spectral[BEAT] = f32::from(u8::from(near && beat.confidence >= 0.5));
        self.frames.push_back(MusicFrame {
            time_s: index as f64 / FRAME_RATE_HZ,
            spectral,
            beat,
            presence: self.detector.presence(),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::song::{Mix, Song, SongSpec, Style};

    fn analyze(samples: &[f32], rate_hz: u32, block: usize) -> Vec<MusicFrame> {
        let mut analyzer = MusicAnalyzer::new(rate_hz).unwrap();
        let mut frames = Vec::new();
        for block in samples.chunks(block) {
            analyzer.push(block);
            frames.extend(std::iter::from_fn(|| analyzer.pop()));
        }
        frames
    }

    fn song(style: Style, seconds: f64) -> Song {
        let mut spec = SongSpec::random(seconds, 11).unwrap();
        spec.style = style;
        spec.mix = Mix::clean();
        spec.render().unwrap()
    }

    #[test]
    fn block_size_does_not_change_a_bit() {
        let song = song(Style::Funk, 6.0);
        let whole = analyze(&song.samples, 22_050, usize::MAX);
        assert_eq!(whole.len(), 121);
        for block in [1, 64, 480, 100_000] {
            assert_eq!(analyze(&song.samples, 22_050, block), whole, "{block}");
        }
    }

    #[test]
    fn frames_know_nothing_of_what_comes_after() {
        let song = song(Style::House, 4.0);
        let mut changed = song.samples.clone();
        let cut_s = 2.0;
        changed[(cut_s * 22_050.0) as usize..].fill(0.0);
        let (a, b) = (analyze(&song.samples, 22_050, 1000), analyze(&changed, 22_050, 1000));
        for (a, b) in a.iter().zip(&b).take_while(|(a, _)| a.time_s <= cut_s) {
            assert_eq!(a, b);
        }
        assert_ne!(a.last(), b.last());
    }

    #[test]
    fn gain_of_42_db_changes_nothing_audible() {
        let song = song(Style::House, 8.0);
        // A power of two, so that rounding does not differ.
        let quiet: Vec<f32> = song.samples.iter().map(|s| s / 128.0).collect();
        let loud = analyze(&song.samples, 22_050, 4096);
        let quiet = analyze(&quiet, 22_050, 4096);
        for (a, b) in loud.iter().zip(&quiet).skip(40) {
            for (x, y) in a.spectral[..BEAT].iter().zip(&b.spectral) {
                assert!((x - y).abs() < 0.05, "{} s: {x} and {y}", a.time_s);
            }
            let turn = a.beat.phase - b.beat.phase;
            assert!((turn - turn.round()).abs() < 0.03, "{} s: {turn}", a.time_s);
            assert!((a.beat.confidence - b.beat.confidence).abs() < 0.05);
        }
    }

    #[test]
    fn values_are_finite_and_of_reasonable_size() {
        for style in Style::ALL {
            for frame in analyze(&song(style, 5.0).samples, 22_050, 4096) {
                let ok = frame.vector().iter().all(|v| v.is_finite() && v.abs() < 20.0);
                assert!(ok, "{style:?} at {} s: {:?}", frame.time_s, frame.vector());
            }
        }
    }

    #[test]
    fn silence_has_no_beat() {
        let frames = analyze(&vec![0.0; 48_000 * 4], 48_000, 480);
        assert!(frames.iter().all(|f| f.beat.confidence == 0.0));
        assert!(frames.iter().all(|f| f.spectral[BEAT] == 0.0));
    }

    #[test]
    fn samples_that_are_no_numbers_become_zero() {
        let mut analyzer = MusicAnalyzer::new(16_000).unwrap();
        analyzer.push(&[f32::NAN, f32::INFINITY, 0.5, f32::NEG_INFINITY]);
        analyzer.push(&[0.25; 16_000]);
        assert_eq!(analyzer.replaced_samples(), 3);
        while let Some(frame) = analyzer.pop() {
            assert!(frame.vector().iter().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn impossible_rate_is_refused() {
        let error = MusicAnalyzer::new(10).err().map(|e| e.to_string());
        assert_eq!(error.as_deref(), Some("the sample rate must be 4000 to 384000 Hz, not 10"));
    }

    #[test]
    fn noise_has_no_beat() {
        let mut state = 1u32;
        let mut white = || {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as i32 as f32 / 2_147_483_648.0
        };
        let steady: Vec<f32> = (0..30 * 20_480).map(|_| 0.1 * white()).collect();
        // Knocks at random times, five a second.
        let mut knocks = vec![0.0f32; steady.len()];
        let mut at = 0;
        while at < knocks.len() - 400 {
            for (age, sample) in knocks[at..at + 400].iter_mut().enumerate() {
                *sample += 0.5 * white() * (-(age as f32) / 80.0).exp();
            }
            at += (20_480.0 * (0.05 - 0.15 * white().abs().max(1e-3).ln())) as usize;
        }
        for (name, samples) in [("noise", steady), ("knocks", knocks)] {
            let frames = analyze(&samples, 20_480, 4096);
            let sure = frames.iter().filter(|f| f.beat.confidence >= 0.5).count();
            assert!(sure * 20 < frames.len(), "{name}: sure in {sure} frames");
        }
    }

    #[test]
    fn house_is_locked_within_five_seconds_at_the_right_phase() {
        let song = song(Style::House, 20.0);
        let frames = analyze(&song.samples, 22_050, 480);
        let period = song.beats_s[1] - song.beats_s[0];
        for frame in frames.iter().filter(|f| f.time_s > 5.0) {
            let truth = frame.time_s / period;
            let error = (f64::from(frame.beat.phase) - truth + 0.5).rem_euclid(1.0) - 0.5;
            let error_s = error * period;
            assert!(
                frame.beat.confidence > 0.5 && error_s.abs() < 0.05,
                "{} s: {:?}, phase off by {error_s} s",
                frame.time_s,
                frame.beat
            );
        }
    }
}
