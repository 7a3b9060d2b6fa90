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
    /// The same if it is the third beat of four, which sounds now like the one, now like
    /// the other.
    pub(super) third: f32,
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
const GAIN: f32 = 0.6;
const NEUTRAL: f32 = -2.5;
/// Added to both probabilities, so that no step is proof.
const DOUBT: f32 = 0.02;
/// Weight of the network's downbeat where it hears a beat.
const DOWNBEAT_GAIN: f32 = 1.0;
/// How often the third beat of four sounds as if it opened a bar.
const THIRD: f32 = 0.5;
/// Weight of the onset strength, and the strength that says nothing.
const ONSET_GAIN: f32 = 0.3;
const NEUTRAL_ONSET: f32 = 0.1;

/// Weight of the onset beat, log-likelihood a beat; its width; the share of its bell that
/// says nothing.
const VOICE: f32 = 3.0;
const VOICE_SIGMA_S: f32 = 0.025;
const VOICE_NEUTRAL: f32 = 0.6;

pub(super) struct Listener {
    onsets: VecDeque<StepOnset>,
    agreement: Agreement,
}

/// The strongest onsets in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct StepOnset {
    /// Of all bands.
    pub(crate) strength: f32,
    /// Below 160 Hz.
    pub(crate) kick: f32,
}

/// How far the network and the kicks have their beats where the onsets alone have theirs: an
/// onset beat that both contradict for some beats is not listened to.
#[derive(Clone, Copy, Debug, Default)]
struct Agreement {
    last_off_s: f32,
    network: Peaks,
    kicks: Peaks,
}

/// The highest values of something near the beats of the onsets, and anywhere between them.
#[derive(Clone, Copy, Debug, Default)]
struct Peaks {
    /// Near this beat, and anywhere.
    now: [f32; 2],
    /// Means of the same over beats.
    mean: [f32; 2],
}

/// What is near a beat of the onsets, seconds.
const NEAR_S: f32 = 0.06;
/// Weight of the newest beat in the means.
const NEWEST: f32 = 0.2;
/// Mean probability by the network from which on it is listened to, and at which it is clear.
const FAINT: f32 = 0.1;
const CLEAR: f32 = 0.35;
/// Mean strength of kicks that are listened to in full.
const KICK: f32 = 0.3;
/// Share of the kicks that are on a beat which is none, and on one which is.
const KICKS_OFF: f32 = 0.35;
const KICKS_ON: f32 = 0.7;

impl Peaks {
    fn take(&mut self, value: f32, is_near: bool) {
        let near = if is_near { value } else { 0.0 };
        self.now = [self.now[0].max(near), self.now[1].max(value)];
    }

    fn end_beat(&mut self) {
        for (mean, peak) in self.mean.iter_mut().zip(std::mem::take(&mut self.now)) {
            *mean += NEWEST * (peak - *mean);
        }
    }

    /// What is near the beats, as a share of what is anywhere.
    fn share(&self) -> f32 {
        self.mean[0] / self.mean[1].max(1e-6)
    }

    /// 0 to 1 between these two means.
    fn clarity(&self, faint: f32, clear: f32) -> f32 {
        ((self.mean[1] - faint) / (clear - faint)).clamp(0.0, 1.0)
    }
}

impl Agreement {
    /// One step; the share of the onset beat's voice that counts.
    fn step(&mut self, heard: f32, kick: f32, off_s: f32) -> f32 {
        // From before one beat to after the next.
        if self.last_off_s - off_s > NEAR_S {
            self.network.end_beat();
            self.kicks.end_beat();
        }
        self.last_off_s = off_s;
        let is_near = off_s.abs() < NEAR_S;
        self.network.take(heard, is_near);
        self.kicks.take(kick, is_near);
        let kicks = (self.kicks.share() - KICKS_OFF) / (KICKS_ON - KICKS_OFF);
        let kicks = self.kicks.clarity(0.0, KICK) * kicks.clamp(0.0, 1.0);
        let contradicted = 1.0 - self.network.share().max(kicks);
        1.0 - self.network.clarity(FAINT, CLEAR) * contradicted
    }
}

impl Listener {
    pub(super) fn new() -> Self {
        Self {
            onsets: VecDeque::from([StepOnset::default(); EARLY]),
            agreement: Agreement::default(),
        }
    }

    /// The evidence of one step: the network's output, the strongest onset in it, and the
    /// beat of the onsets.
    pub(super) fn hear(
        &mut self,
        output: &NetworkOutput,
        onset: StepOnset,
        guess: OnsetBeat,
    ) -> BeatEvidence {
        self.onsets.push_back(onset);
        let onset = self.onsets.pop_front().unwrap_or_default();
        let heard = sigmoid(output.beat);
        let odds = (heard + DOUBT) / (1.0 - heard + DOUBT);
        let mut beat = GAIN * (libm::logf(odds) - NEUTRAL);
        beat += ONSET_GAIN * (onset.strength - NEUTRAL_ONSET);
        let off = guess.off_s / VOICE_SIGMA_S;
        let voice = VOICE * guess.confidence * self.agreement.step(heard, onset.kick, guess.off_s);
        beat += voice * (libm::expf(-0.5 * off * off) - VOICE_NEUTRAL);
        let share = (sigmoid(output.downbeat) / heard.max(1e-4)).clamp(0.03, 0.9);
        let weight = DOWNBEAT_GAIN * heard;
        let as_downbeat = share / DOWNBEATS;
        let as_other = (1.0 - share) / (1.0 - DOWNBEATS);
        let as_third = THIRD * as_downbeat + (1.0 - THIRD) * as_other;
        BeatEvidence {
            downbeat: beat + weight * libm::logf(as_downbeat),
            beat: beat + weight * libm::logf(as_other),
            third: beat + weight * libm::logf(as_third),
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
            listener.hear(&NetworkOutput::SILENCE, StepOnset::default(), OnsetBeat::default());
        assert!(nothing.beat < 0.0 && nothing.downbeat < 0.0);
        let heard = NetworkOutput { beat: 2.0, downbeat: 1.5, music: 5.0 };
        let downbeat = listener.hear(&heard, StepOnset::default(), OnsetBeat::default());
        assert!(downbeat.downbeat > downbeat.beat && downbeat.beat > 0.0);
        let heard = NetworkOutput { beat: 2.0, downbeat: -4.0, music: 5.0 };
        let other = listener.hear(&heard, StepOnset::default(), OnsetBeat::default());
        assert!(other.beat > other.downbeat);
    }
}
