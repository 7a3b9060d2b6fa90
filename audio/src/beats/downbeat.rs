//! The downbeat: which of four beats begins the bar, from the network's downbeats.
//!
//! Each of the four beats collects the network's downbeat probability; the beat
//! with clearly the largest sum is the downbeat. Only 4/4 is modelled: in music
//! in three mostly no downbeat stands out.

/// Beats in a bar.
const BEATS: usize = 4;
/// Share of a beat around it in which downbeats count.
const REACH: f64 = 0.15;
/// Share of the sum that is kept from bar to bar.
const KEEP: f32 = 0.85;
/// Share by which the downbeat must exceed the next best.
const MARGIN: f32 = 0.35;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DownbeatCounter {
    collected: [f32; BEATS],
    peak: f32,
    beat: usize,
    phase: f64,
}

impl DownbeatCounter {
    /// Takes the phase of the output beat and the probability of a downbeat in a hop.
    pub(super) fn push(&mut self, phase: f64, downbeat: f32) {
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
    pub(super) fn beat_in_bar(&self, phase: f64) -> Option<u8> {
        let first = (0..BEATS).max_by(|&a, &b| self.collected[a].total_cmp(&self.collected[b]))?;
        let best = self.collected[first];
        let others = (0..BEATS).filter(|&i| i != first);
        let next = others.fold(0.0f32, |m, i| m.max(self.collected[i]));
        if best <= 0.02 || next > (1.0 - MARGIN) * best {
            return None;
        }
        // In the second half of a beat `beat` is the one that sounds next.
        let last = if phase < 0.5 { self.beat } else { self.beat + BEATS - 1 };
        Some(((last + BEATS - first) % BEATS) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beats_are_counted_from_the_strongest_downbeat() {
        let mut bar = DownbeatCounter::default();
        for hop in 0..1000 {
            let beats = f64::from(hop) / 40.0;
            let phase = beats.fract();
            let now = (beats + 0.5) as usize % 4;
            let strong = !(0.05..=0.95).contains(&phase);
            bar.push(phase, if strong && now == 2 { 0.8 } else { 0.1 });
            if hop > 400 {
                let expected = (beats as usize + 4 - 2) % 4;
                assert_eq!(bar.beat_in_bar(phase), Some(expected as u8), "beat {beats}");
            }
        }
    }

    #[test]
    fn even_beats_have_no_downbeat() {
        let mut bar = DownbeatCounter::default();
        for hop in 0..1000 {
            let phase = (f64::from(hop) / 40.0).fract();
            bar.push(phase, 0.3);
        }
        assert_eq!(bar.beat_in_bar(0.2), None);
    }
}
