//! Which beat of the bar it is: a guess from the network's downbeats.
//!
//! Each beat of four collects what the network said when it passed; the one
//! that collected clearly the most is the downbeat. Music in three is not known
//! of: its guesses wander, and mostly there is none.

/// Beats in a bar.
const BEATS: usize = 4;
/// Share of a beat around it in which downbeats count.
const REACH: f64 = 0.15;
/// What is kept from bar to bar.
const KEEP: f32 = 0.85;
/// How much more than the next best the downbeat must have collected.
const MARGIN: f32 = 0.35;

/// Counts beats and what speaks for each of the four.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bar {
    collected: [f32; BEATS],
    peak: f32,
    beat: usize,
    phase: f64,
}

impl Bar {
    /// Takes the danced phase of a hop and how likely a downbeat is in it.
    pub(crate) fn hear(&mut self, phase: f64, downbeat: f32) {
        if (phase - phase.round()).abs() < REACH {
            self.peak = self.peak.max(downbeat);
        }
        // A beat begins half a beat before it sounds, so that an early
        // downbeat counts for it.
        if self.phase < 0.5 && phase >= 0.5 && phase - self.phase < 0.5 {
            let kept = &mut self.collected[self.beat];
            *kept += (1.0 - KEEP) * (self.peak - *kept);
            self.peak = 0.0;
            self.beat = (self.beat + 1) % BEATS;
        }
        self.phase = phase;
    }

    /// The beat of the bar at this phase, if the downbeat stands out.
    pub(crate) fn beat_in_bar(&self, phase: f64) -> Option<u8> {
        let first = (0..BEATS).max_by(|&a, &b| self.collected[a].total_cmp(&self.collected[b]))?;
        let best = self.collected[first];
        let others = self
            .collected
            .iter()
            .enumerate()
            .filter(|(i, _)| *i != first);
        let next = others.fold(0.0f32, |m, (_, &v)| m.max(v));
        if best <= 0.02 || next > (1.0 - MARGIN) * best {
            return None;
        }
        // `beat` is the one that sounds next once half of the last has passed.
        let last = if phase < 0.5 {
            self.beat
        } else {
            self.beat + BEATS - 1
        };
        Some(((last + BEATS - first) % BEATS) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beats_are_counted_from_the_strongest_downbeat() {
        let mut bar = Bar::default();
        for hop in 0..1000 {
            let beats = f64::from(hop) / 40.0;
            let phase = beats.fract();
            let now = (beats + 0.5) as usize % 4;
            let strong = !(0.05..=0.95).contains(&phase);
            bar.hear(phase, if strong && now == 2 { 0.8 } else { 0.1 });
            if hop > 400 {
                let expected = (beats as usize + 4 - 2) % 4;
                assert_eq!(bar.beat_in_bar(phase), Some(expected as u8), "beat {beats}");
            }
        }
    }

    #[test]
    fn even_beats_have_no_downbeat() {
        let mut bar = Bar::default();
        for hop in 0..1000 {
            let phase = (f64::from(hop) / 40.0).fract();
            bar.hear(phase, 0.3);
        }
        assert_eq!(bar.beat_in_bar(0.2), None);
    }
}
