//! The offline beat tracker: for scoring, never for dancing.
//!
//! The same evidence and states as the causal tracker's, but the best path
//! through the whole piece (Viterbi). Memory: 113 bytes a hop.

use super::history::{BeatHistory, BeatTrack};
use super::network::NetworkOutput;
use super::state_space::{BELL, REACH, TEMPI, TempoStates, beat_cost, bell, period, prior, steps};

/// Log-likelihood of a leap to any other tempo at a beat.
const LEAP: f32 = -15.0;

/// Finds the beats of a whole piece in the history that an analyzer kept.
pub fn track_offline(history: &BeatHistory) -> BeatTrack {
    let mut path = ViterbiPath::new();
    for &evidence in &history.evidence {
        path.hop(evidence);
    }
    let times_s = path.beats().into_iter().map(|hop| history.time_s(hop));
    let music = |time_s: &f64| *time_s >= 0.0 && history.music_at(*time_s);
    BeatTrack::new(times_s.filter(music).collect())
}

/// Log-odds of a beat in a hop, by the network.
pub(crate) fn offline_evidence(output: &NetworkOutput) -> f32 {
    (0.25 * (output.beat + 2.5)).clamp(-0.4, 1.2)
}

struct ViterbiPath {
    tempi: Vec<TempoStates>,
    /// Log-probabilities of the steps from each tempo to its neighbours.
    steps: Vec<[f32; 2 * REACH + 1]>,
    /// For each hop and tempo, the tempo before a beat there.
    from: Vec<[u8; TEMPI]>,
    bell: [f32; BELL],
}

impl ViterbiPath {
    fn new() -> Self {
        let states = |i| TempoStates::filled(i, prior(i).ln());
        let steps = steps().into_iter().map(|row| row.map(f32::ln));
        Self {
            tempi: (0..TEMPI).map(states).collect(),
            steps: steps.collect(),
            from: Vec::new(),
            bell: bell(),
        }
    }

    /// Advances one hop with this evidence for a beat, log-odds.
    fn hop(&mut self, evidence: f32) {
        let arrived: [f32; TEMPI] = std::array::from_fn(|i| self.tempi[i].advance());
        let leap = (0..TEMPI).max_by(|&a, &b| arrived[a].total_cmp(&arrived[b])).unwrap_or(0);
        let mut from = [0u8; TEMPI];
        for (to, states) in self.tempi.iter_mut().enumerate() {
            let first = to.saturating_sub(REACH);
            let near = arrived.iter().enumerate().skip(first).take(to + REACH + 1 - first);
            let mut best = (arrived[leap] + LEAP, leap);
            for (tempo, score) in near {
                let score = score + self.steps[tempo][to + REACH - tempo];
                if score > best.0 {
                    best = (score, tempo);
                }
            }
            from[to] = best.1 as u8;
            *states.at_mut(0) = best.0 + beat_cost(to);
            states.near_beat(|state, distance| *state += evidence * self.bell[distance]);
        }
        self.from.push(from);
    }

    fn beats(&self) -> Vec<usize> {
        let ends = self.tempi.iter().enumerate().flat_map(|(tempo, states)| {
            (0..period(tempo)).map(move |since| (states.at(since), tempo, since))
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
        assert_eq!(track_offline(analyzer.history().unwrap()), BeatTrack::default());
        assert_eq!(track_offline(&BeatHistory::default()), BeatTrack::default());
    }
}
