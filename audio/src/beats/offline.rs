//! Beats with the whole piece known: for scoring, never for dancing.
//!
//! The same evidence and the same model of tempo and phase as the causal
//! tracker's, but the one best path through the whole piece (Viterbi) in place
//! of what is best known at each moment. Memory: 113 bytes a hop.

use super::belief::{self, Ring};
use super::history::History;
use super::tempo::{TEMPI, bpm, period, prior_of};

/// Likelihood of a leap to any other tempo at a beat, logarithmic.
const LEAP: f32 = -15.0;

/// The beats of a piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BeatTrack {
    /// Median tempo, beats a minute; 0 if there are fewer than two beats.
    pub tempo_bpm: f64,
    /// Beat times in seconds, increasing.
    pub times_s: Vec<f64>,
}

impl BeatTrack {
    pub(super) fn new(times_s: Vec<f64>) -> Self {
        Self {
            tempo_bpm: median_tempo_bpm(&times_s),
            times_s,
        }
    }
}

/// Finds the beats of a piece from what was heard. No music, no beats.
pub fn track_offline(history: &History) -> BeatTrack {
    let mut path = Path::new();
    for &evidence in &history.evidence {
        path.hop(evidence);
    }
    let times_s = path.beats().into_iter().map(|hop| history.time_s(hop));
    let music = |time_s: &f64| *time_s >= 0.0 && history.music_at(*time_s);
    BeatTrack::new(times_s.filter(music).collect())
}

/// The best path to every state of tempo and phase.
struct Path {
    rings: Vec<Ring>,
    /// Log chances of the steps from each tempo to its neighbours.
    steps: Vec<[f32; 2 * belief::REACH + 1]>,
    /// For each hop and tempo, the tempo before a beat there.
    from: Vec<[u8; TEMPI]>,
    bell: [f32; belief::BELL],
}

impl Path {
    fn new() -> Self {
        let steps = belief::steps()
            .into_iter()
            .map(|row| row.map(f32::ln))
            .collect();
        Self {
            rings: (0..TEMPI)
                .map(|i| Ring::filled(period(i), prior_of(bpm(i)).ln()))
                .collect(),
            steps,
            from: Vec::new(),
            bell: belief::bell(),
        }
    }

    /// Moves on by one hop with this evidence for a beat, log-odds.
    fn hop(&mut self, evidence: f32) {
        let arrived: [f32; TEMPI] = std::array::from_fn(|i| self.rings[i].advance());
        let leap = (0..TEMPI)
            .max_by(|&a, &b| arrived[a].total_cmp(&arrived[b]))
            .unwrap_or(0);
        let mut from = [0u8; TEMPI];
        for (to, ring) in self.rings.iter_mut().enumerate() {
            let first = to.saturating_sub(belief::REACH);
            let near = arrived
                .iter()
                .enumerate()
                .skip(first)
                .take(to + belief::REACH + 1 - first);
            let mut best = (arrived[leap] + LEAP, leap);
            for (tempo, score) in near {
                let score = score + self.steps[tempo][to + belief::REACH - tempo];
                if score > best.0 {
                    best = (score, tempo);
                }
            }
            from[to] = best.1 as u8;
            *ring.at_mut(0) = best.0 + belief::unusual(to);
            ring.near_beat(|state, distance| *state += evidence * self.bell[distance]);
        }
        self.from.push(from);
    }

    /// Hops of the beats of the best path.
    fn beats(&self) -> Vec<usize> {
        let ends = self.rings.iter().enumerate().flat_map(|(tempo, ring)| {
            (0..period(tempo)).map(move |since| (ring.at(since), tempo, since))
        });
        let best = ends.max_by(|a, b| a.0.total_cmp(&b.0));
        let mut beats = Vec::new();
        let Some((_, mut tempo, since)) = best else {
            return beats;
        };
        let mut at = self.from.len().checked_sub(1 + since);
        while let Some(hop) = at {
            beats.push(hop);
            tempo = usize::from(self.from[hop][tempo]);
            at = hop.checked_sub(period(tempo));
        }
        beats.reverse();
        beats
    }
}

fn median_tempo_bpm(times_s: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).collect();
    intervals.sort_by(f64::total_cmp);
    intervals.get(intervals.len() / 2).map_or(0.0, |s| 60.0 / s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MusicAnalyzer;
    use crate::song::Song;

    #[test]
    fn beats_of_the_demo_are_found_through_its_tempo_change() {
        let song = Song::demo();
        let mut analyzer = MusicAnalyzer::keeping_history(song.sample_rate_hz).unwrap();
        analyzer.push(&song.samples);
        let track = track_offline(analyzer.history().unwrap());
        let near = |beat: &&f64| track.times_s.iter().any(|t| (t - **beat).abs() < 0.05);
        let hit = song.beats_s.iter().filter(near).count();
        assert!(
            hit * 10 >= song.beats_s.len() * 8 && track.times_s.len() <= song.beats_s.len() + 4,
            "{hit} of {} beats hit by {}",
            song.beats_s.len(),
            track.times_s.len()
        );
        assert!((110.0..130.0).contains(&track.tempo_bpm), "{track:?}");
    }

    #[test]
    fn silence_has_no_beats() {
        let mut analyzer = MusicAnalyzer::keeping_history(8000).unwrap();
        analyzer.push(&[0.0; 80_000]);
        assert_eq!(
            track_offline(analyzer.history().unwrap()),
            BeatTrack::default()
        );
        assert_eq!(track_offline(&History::default()), BeatTrack::default());
    }
}
