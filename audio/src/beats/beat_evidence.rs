//! What was heard in one step, as evidence for the [bar pointer](super::bar_pointer):
//! the network's beat and downbeat, and the onsets.

use std::collections::VecDeque;

use super::network::NetworkOutput;
use crate::features::spectrum::sigmoid;

/// Log-likelihood of a step if it is the beat that opens a bar, and if it is
/// another beat, against a step between beats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct BeatEvidence {
    pub(super) downbeat: f32,
    pub(super) beat: f32,
    /// Probability of a beat by the network alone.
    pub(super) heard: f32,
}

/// The beat that the onsets alone give, at the time that a step tells of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct OnsetBeat {
    /// From its nearest beat, seconds.
    pub(crate) off_s: f32,
    /// How sure it is, 0 to 1.
    pub(crate) confidence: f32,
}

/// Steps by which onsets come before the network's beats.
const EARLY: usize = 3;
/// Share of the beats that open a bar.
const DOWNBEATS: f32 = 0.28;

/// Weight of the network's log-odds of a beat, and the odds that say nothing.
const GAIN: f32 = 0.5;
const NEUTRAL: f32 = -2.5;
/// Added to both probabilities, so that no step is proof.
const DOUBT: f32 = 0.02;
/// Weight of the network's downbeat where it hears a beat.
const DOWNBEAT_GAIN: f32 = 1.0;
/// Weight of the onset strength, and the strength that says nothing.
const ONSET_GAIN: f32 = 0.3;
const NEUTRAL_ONSET: f32 = 0.1;

/// Weight of the onset beat, log-likelihood a beat; its width; the share of its bell that
/// says nothing.
const VOICE: f32 = 2.0;
const VOICE_SIGMA_S: f32 = 0.025;
const VOICE_NEUTRAL: f32 = 0.3;

pub(super) struct Listener {
    onsets: VecDeque<f32>,
}

impl Listener {
    pub(super) fn new() -> Self {
        Self { onsets: VecDeque::from([0.0; EARLY]) }
    }

    /// The evidence of one step: the network's output, the strongest onset in it, and the
    /// beat of the onsets.
    pub(super) fn hear(
        &mut self,
        output: &NetworkOutput,
        onset: f32,
        guess: OnsetBeat,
    ) -> BeatEvidence {
        self.onsets.push_back(onset);
        let onset = self.onsets.pop_front().unwrap_or(0.0);
        let heard = sigmoid(output.beat);
        let odds = (heard + DOUBT) / (1.0 - heard + DOUBT);
        let mut beat = GAIN * (libm::logf(odds) - NEUTRAL);
        beat += ONSET_GAIN * (onset - NEUTRAL_ONSET);
        let off = guess.off_s / VOICE_SIGMA_S;
        beat += VOICE * guess.confidence * (libm::expf(-0.5 * off * off) - VOICE_NEUTRAL);
        let share = (sigmoid(output.downbeat) / heard.max(1e-4)).clamp(0.03, 0.9);
        let weight = DOWNBEAT_GAIN * heard;
        BeatEvidence {
            downbeat: beat + weight * libm::logf(share / DOWNBEATS),
            beat: beat + weight * libm::logf((1.0 - share) / (1.0 - DOWNBEATS)),
            heard,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_speaks_against_a_beat_and_a_heard_downbeat_for_a_bar() {
        let mut listener = Listener::new();
        let nothing =
            listener.hear(&NetworkOutput { beat: -9.0, downbeat: -9.0 }, 0.0, OnsetBeat::default());
        assert!(nothing.beat < 0.0 && nothing.downbeat < 0.0);
        let heard = NetworkOutput { beat: 2.0, downbeat: 1.5 };
        let downbeat = listener.hear(&heard, 0.0, OnsetBeat::default());
        assert!(downbeat.downbeat > downbeat.beat && downbeat.beat > 0.0);
        let heard = NetworkOutput { beat: 2.0, downbeat: -4.0 };
        let other = listener.hear(&heard, 0.0, OnsetBeat::default());
        assert!(other.beat > other.downbeat);
    }
}
