//! The music of the last seconds, for what is shown now: motion and music are made ahead.

use super::snapshot::{BANDS, MusicStatus};
use servodance_types::MusicFrame;
use std::collections::VecDeque;

/// Music frames that are kept: a recording is analysed ahead.
const KEPT: usize = 128;

/// Music frames in the order of time. Nothing allocates after it was made.
#[derive(Debug)]
pub struct MusicTrack(VecDeque<(f64, MusicStatus)>);

impl Default for MusicTrack {
    fn default() -> Self {
        Self(VecDeque::with_capacity(KEPT))
    }
}

impl MusicTrack {
    /// Takes in a music frame; its time may be yet to come.
    pub fn push(&mut self, music: &MusicFrame) {
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        let beat = music.beat;
        let now = MusicStatus {
            phase: f64::from(beat.phase),
            tempo_bpm: f64::from(beat.tempo_bpm),
            confidence: f64::from(beat.confidence),
            lock: beat.lock,
            presence: f64::from(music.presence),
            place: beat.beat_in_bar.map(|place| place + 1),
            meter: beat.beats_in_bar,
            bar_confidence: f64::from(beat.bar_confidence),
            bands: servodance_audio::bands::<BANDS>(&music.spectral),
        };
        self.0.push_back((music.time_s, now));
    }

    /// The music at a time: the last frame before it, its beat carried on.
    pub fn at(&mut self, time_s: f64) -> MusicStatus {
        while self.0.get(1).is_some_and(|next| next.0 <= time_s) {
            self.0.pop_front();
        }
        match self.0.front() {
            Some((at_s, music)) if *at_s <= time_s => {
                let beats = (time_s - at_s) * music.tempo_bpm / 60.0;
                let whole = (music.phase + beats).floor() as i64;
                let later = |place: u8, meter: u8| {
                    ((i64::from(place) - 1 + whole).rem_euclid(i64::from(meter)) + 1) as u8
                };
                MusicStatus {
                    phase: (music.phase + beats).rem_euclid(1.0),
                    place: music.place.zip(music.meter).map(|(place, meter)| later(place, meter)),
                    ..*music
                }
            }
            _ => MusicStatus::default(),
        }
    }
}
