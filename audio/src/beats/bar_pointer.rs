//! The bar pointer: where in its bar the music is, how fast it goes, and how many
//! beats its bars have, as one probability over all of it (Whiteley 2006; the
//! efficient state space after Krebs 2015).
//!
//! 160 hops a second, two for each step of the network, so that fast beats are not
//! whole numbers of too few. A state is a tempo (a whole number of hops a beat, 2 %
//! apart), a meter, a beat of its bar and the hops since that beat. States move on by one
//! each hop; at a beat the tempo may change a little, at a bar line the meter.
//! Little by little probability also leaks to every tempo, beat and meter, so that
//! nothing that was believed once, however surely, outlasts the evidence for
//! something else. Sums over all paths, constant memory, the same work every step.
//!
//! The evidence comes from [`beat_evidence`](super::beat_evidence); the
//! [tracker](super::tracker) follows the [`BarEstimate`] smoothly.

use super::beat_evidence::BeatEvidence;
use super::tempo_range::TempoRange;

/// Hops a second, and hops for one step of the network.
const HOP_HZ: f64 = 160.0;
const HOPS: usize = 2;
/// Steps of the network a second.
pub(super) const RATE_HZ: f64 = HOP_HZ / HOPS as f64;
/// Hops of a beat at each tempo: from 218 BPM down to 50.
const TEMPI: usize = 78;
static LENGTHS: [usize; TEMPI] = lengths();
/// Beats in a bar of each meter.
const METERS: [usize; 4] = [2, 3, 4, 5];
const METER_PRIOR: [f32; 4] = [0.14, 0.24, 0.56, 0.06];
/// Beats of all meters together, and the first of each.
const SLOTS: usize = 14;
const FIRST: [usize; 4] = [0, 2, 5, 9];
const THIRD_OF_FOUR: usize = FIRST[2] + 2;
/// What a beat of a bar of two costs: two such bars explain every bar of four, and the
/// longer one is the more usual reading.
const SHORT_BAR: f32 = 0.86;
/// Probability that leaks to every tempo, phase and bar, a second.
const LEAK_PER_S: f32 = 2e-3;
/// Probability that a beat is another one of its bar; that a bar has another meter.
const SLIP: f32 = 0.004;
const REMETER: f32 = 0.01;
/// Middle and width of the bell over tempi, octaves, by which probability leaks.
const PRIOR_BPM: f64 = 110.0;
const PRIOR_OCTAVES: f64 = 0.55;
/// Share of that bell's log-likelihood that a tempo pays a second, so that of two
/// readings that explain the music as well the usual one is believed.
const PRIOR_PER_S: f64 = 1.8;
/// How fast the probability of a change of tempo falls with its relative size.
const STEADINESS: f64 = 110.0;
/// Farthest tempo to which one beat may change.
const REACH: usize = 3;
/// Hops to both sides of a beat in which evidence counts, and its share there.
const BELL: [f32; 5] = [0.5, 0.45, 0.35, 0.2, 0.1];

/// How well people tap: time and relative tempo; how far from a tapped beat the
/// pointer may go, in relative tempo and in beats.
const TAP_SIGMA_S: f64 = 0.03;
const TAP_TEMPO_SIGMA: f64 = 0.04;
const TAPPED_TEMPO: f64 = 0.08;
const TAPPED_PHASE: f64 = 0.15;

const fn lengths() -> [usize; TEMPI] {
    let mut lengths = [0; TEMPI];
    let (mut tempo, mut length) = (0, 44);
    while tempo < TEMPI {
        lengths[tempo] = length;
        let more = (length + 25) / 50;
        length += if more > 1 { more } else { 1 };
        tempo += 1;
    }
    lengths
}

fn bpm(tempo: usize) -> f64 {
    60.0 * HOP_HZ / LENGTHS[tempo] as f64
}

/// Probabilities of the beats of all meters, side by side, for the vector unit; the
/// last lanes stay empty.
type Row = [f32; LANES];
const LANES: usize = 16;
const EMPTY: Row = [0.0; LANES];

/// The states of one tempo: a ring of the hops since the last beat. A hop moves all
/// of them by moving `zero`.
struct TempoStates {
    ring: Vec<Row>,
    zero: usize,
}

impl TempoStates {
    fn at(&self, since: usize) -> &Row {
        let at = self.zero + since;
        &self.ring[if at < self.ring.len() { at } else { at - self.ring.len() }]
    }

    /// Moves on by one hop; what comes to the end of its beat.
    fn advance(&mut self) -> Row {
        self.zero = if self.zero == 0 { self.ring.len() - 1 } else { self.zero - 1 };
        self.ring[self.zero]
    }

    /// Multiplies the states so many hops after a beat; by how much each grew.
    fn weigh(&mut self, since: usize, factors: &Row, gained: &mut Row) {
        let at = self.zero + since;
        let length = self.ring.len();
        let row = &mut self.ring[if at < length { at } else { at - length }];
        for lane in 0..LANES {
            let weighed = row[lane] * factors[lane];
            gained[lane] += weighed - row[lane];
            row[lane] = weighed;
        }
    }

    fn total(&self) -> f32 {
        let mut sum = EMPTY;
        for row in &self.ring {
            add(&mut sum, row, 1.0);
        }
        sum.iter().sum()
    }
}

fn add(sum: &mut Row, row: &Row, share: f32) {
    sum.iter_mut().zip(row).for_each(|(s, r)| *s += share * r);
}

/// By what the evidence of one step multiplies the states near a beat.
struct Factors {
    /// Those whose beat has begun.
    after: Row,
    /// Those whose next beat is about to begin: the evidence is of that one.
    before: Row,
}

impl Factors {
    fn new(evidence: &BeatEvidence, share: f32) -> Self {
        let down = libm::expf(share * evidence.downbeat);
        let mut after = [libm::expf(share * evidence.beat); LANES];
        FIRST.iter().for_each(|&first| after[first] = down);
        after[THIRD_OF_FOUR] = libm::expf(share * evidence.third);
        let mut before = after;
        for (&beats, first) in METERS.iter().zip(FIRST) {
            before[first..first + beats].rotate_left(1);
        }
        Self { after, before }
    }
}

/// What the pointer makes of the music.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BarEstimate {
    pub(super) bpm: f64,
    /// Beats since the last beat, 0 to 1.
    pub(super) phase: f64,
    /// Probability of this tempo and phase and their near neighbours, 0 to 1.
    pub(super) mass: f32,
    /// Beats in a bar, and the place of the last beat in it from 0.
    pub(super) meter: u8,
    pub(super) beat: u8,
    /// Probability of that place in that bar, given tempo and phase, 0 to 1.
    pub(super) bar_mass: f32,
    /// Probability of that meter, given tempo and phase, 0 to 1.
    pub(super) meter_mass: f32,
}

pub(super) struct BarPointer {
    tempi: Vec<TempoStates>,
    /// Chances of the steps from each tempo to its neighbours.
    changes: Vec<[f32; 2 * REACH + 1]>,
    prior: [f32; TEMPI],
    /// What one beat at each tempo is worth by how usual the tempo is.
    worth: [f32; TEMPI],
    /// Of all states; they are brought back to one when it is far from it.
    total: f32,
}

impl BarPointer {
    pub(super) fn new() -> Self {
        let prior = prior();
        let states = |tempo: usize| {
            let length = LENGTHS[tempo];
            let mut row = EMPTY;
            for (meter, &beats) in METERS.iter().enumerate() {
                let value = prior[tempo] * METER_PRIOR[meter] / (beats * length) as f32;
                row[FIRST[meter]..FIRST[meter] + beats].fill(value);
            }
            TempoStates { ring: vec![row; length], zero: 0 }
        };
        Self {
            tempi: (0..TEMPI).map(states).collect(),
            changes: changes(),
            prior,
            worth: worth(),
            total: 1.0,
        }
    }

    /// Lets nothing but these tempi be believed; the nearest one if none of the
    /// pointer's is among them.
    pub(super) fn limit_tempo(&mut self, range: TempoRange) {
        let (low_bpm, high_bpm) = (range.low_bpm(), range.high_bpm());
        let middle = libm::sqrt(low_bpm * high_bpm);
        let off = |tempo: &usize| libm::fabs(libm::log(bpm(*tempo) / middle));
        let nearest = (0..TEMPI).min_by(|a, b| off(a).total_cmp(&off(b)));
        self.prior = prior();
        for tempo in 0..TEMPI {
            if !(low_bpm..=high_bpm).contains(&bpm(tempo)) && nearest != Some(tempo) {
                self.prior[tempo] = 0.0;
                self.tempi[tempo].ring.fill(EMPTY);
            }
        }
        self.renormalise();
    }

    /// Forgets every state whose last beat was not near `phase` beats ago or whose
    /// tempo is not near `of_bpm`: for a beat that a listener tapped.
    pub(super) fn keep_near(&mut self, phase: f64, of_bpm: f64) {
        for (tempo, states) in self.tempi.iter_mut().enumerate() {
            let near = libm::fabs(libm::log(bpm(tempo) / of_bpm)) < TAPPED_TEMPO;
            let length = states.ring.len();
            for since in 0..length {
                let off = since as f64 / length as f64 - phase;
                if !near || libm::fabs(off - libm::round(off)) > TAPPED_PHASE {
                    let at = (states.zero + since) % length;
                    states.ring[at] = EMPTY;
                }
            }
        }
        self.renormalise();
    }

    /// Believes in a beat `ago_s` before the newest step at a tempo of one beat in
    /// `period_s`, and in nothing else; of the place in the bar nothing is known.
    pub(super) fn anchor(&mut self, ago_s: f64, period_s: f64) {
        for (tempo, states) in self.tempi.iter_mut().enumerate() {
            let length = states.ring.len();
            let off = libm::log(bpm(tempo) * period_s / 60.0) / TAP_TEMPO_SIGMA;
            let of_tempo = libm::exp(-0.5 * off * off) * f64::from(self.prior[tempo] > 0.0);
            for since in 0..length {
                let beats = since as f64 / length as f64 - ago_s * bpm(tempo) / 60.0;
                let off = (beats - libm::round(beats)) * 60.0 / bpm(tempo) / TAP_SIGMA_S;
                let value = (of_tempo * libm::exp(-0.5 * off * off)) as f32;
                let mut row = EMPTY;
                for (meter, (&beats, first)) in METERS.iter().zip(FIRST).enumerate() {
                    row[first..first + beats].fill(value * METER_PRIOR[meter] / beats as f32);
                }
                let at = (states.zero + since) % length;
                states.ring[at] = row;
            }
        }
        self.renormalise();
    }

    /// Moves on by one step of the network and weighs what was heard in it.
    pub(super) fn step(&mut self, evidence: &BeatEvidence) {
        let factors = BELL.map(|share| Factors::new(evidence, share));
        for _ in 0..HOPS {
            let arrived = self.advance();
            self.enter(&arrived);
            self.weigh(&factors);
        }
        if !(1e-12..1e12).contains(&self.total) {
            self.renormalise();
        }
    }

    /// Moves every state; what comes to the end of its beat, at the tempo of the next.
    fn advance(&mut self) -> [Row; TEMPI] {
        let mut arrived = [EMPTY; TEMPI];
        for (tempo, (states, chances)) in self.tempi.iter_mut().zip(&self.changes).enumerate() {
            let row = states.advance();
            for (k, &chance) in chances.iter().enumerate() {
                let to = (tempo + k).wrapping_sub(REACH);
                if to < TEMPI {
                    add(&mut arrived[to], &row, chance);
                }
            }
        }
        arrived
    }

    /// Fills the first states of all beats from those that can precede them.
    fn enter(&mut self, arrived: &[Row; TEMPI]) {
        let tempi = self.tempi.iter_mut().zip(arrived).zip(&self.prior).zip(&self.worth);
        for (((states, row), prior), worth) in tempi {
            let mut row = row.map(|value| value * worth);
            row[FIRST[0]..FIRST[1]].iter_mut().for_each(|value| *value *= SHORT_BAR);
            let leak = LEAK_PER_S / HOP_HZ as f32 * self.total * prior;
            let bars: f32 =
                METERS.iter().zip(FIRST).map(|(beats, first)| row[first + beats - 1]).sum();
            let mut next = EMPTY;
            for (meter, (&beats, first)) in METERS.iter().zip(FIRST).enumerate() {
                let bar = &row[first..first + beats];
                let all: f32 = bar.iter().sum();
                let spread = (SLIP * all + leak * METER_PRIOR[meter]) / beats as f32;
                let own = bar[beats - 1];
                let opening = own + REMETER * (METER_PRIOR[meter] * bars - own);
                next[first] = opening * (1.0 - SLIP) + spread;
                for beat in 1..beats {
                    next[first + beat] = bar[beat - 1] * (1.0 - SLIP) + spread;
                }
            }
            states.ring[states.zero] = if *prior > 0.0 { next } else { EMPTY };
        }
    }

    /// Weighs the states near a beat.
    fn weigh(&mut self, factors: &[Factors; BELL.len()]) {
        let mut gained = EMPTY;
        for states in &mut self.tempi {
            let length = states.ring.len();
            states.weigh(0, &factors[0].after, &mut gained);
            for (distance, factors) in factors.iter().enumerate().skip(1) {
                states.weigh(distance, &factors.after, &mut gained);
                states.weigh(length - distance, &factors.before, &mut gained);
            }
        }
        self.total += gained.iter().sum::<f32>();
    }

    /// Weighs bars alone: tempo and phase stay as likely as they were. `log_odds` that a beat
    /// opened its bar, if it was between `ago_s` and `length_s` more before the newest step.
    pub(super) fn weigh_bars(&mut self, log_odds: f32, ago_s: f64, length_s: f64) {
        let opened = libm::expf(log_odds);
        let hops = |s: f64| libm::round(s * HOP_HZ) as usize;
        for states in &mut self.tempi {
            let length = states.ring.len();
            for ago in hops(ago_s)..hops(ago_s + length_s) {
                let at = (states.zero + ago % length) % length;
                let row = &mut states.ring[at];
                let before: f32 = row.iter().sum();
                for (&beats, first) in METERS.iter().zip(FIRST) {
                    row[first + ago / length % beats] *= opened;
                }
                let scale = before / row.iter().sum::<f32>().max(1e-30);
                row.iter_mut().for_each(|value| *value *= scale);
            }
        }
    }

    fn renormalise(&mut self) {
        let total: f32 = self.tempi.iter().map(TempoStates::total).sum();
        let scale = 1.0 / total.max(1e-30);
        for row in self.tempi.iter_mut().flat_map(|states| &mut states.ring) {
            row.iter_mut().for_each(|v| *v *= scale);
        }
        self.total = 1.0;
    }

    /// Due every few steps: brings the sum back to one, so that rounding does not
    /// add up, and reads the likeliest tempo, phase and bar.
    pub(super) fn estimate(&mut self) -> BarEstimate {
        self.renormalise();
        let totals: [f32; TEMPI] = std::array::from_fn(|i| self.tempi[i].total());
        let around = |tempo: usize| -> f32 {
            totals[tempo.saturating_sub(1)..(tempo + 2).min(TEMPI)].iter().sum()
        };
        let best = (0..TEMPI).max_by(|&a, &b| around(a).total_cmp(&around(b))).unwrap_or(0);
        self.around(best)
    }

    /// The likeliest phase and bar near a tempo.
    fn around(&self, best: usize) -> BarEstimate {
        let phases: Vec<f32> =
            (0..LENGTHS[best]).map(|since| self.tempi[best].at(since).iter().sum()).collect();
        let likeliest = (0..phases.len()).max_by(|&a, &b| phases[a].total_cmp(&phases[b]));
        let phase = likeliest.unwrap_or(0) as f64 / LENGTHS[best] as f64;
        let mut sum = Neighbourhood::default();
        for tempo in best.saturating_sub(REACH)..(best + REACH + 1).min(TEMPI) {
            sum.add(&self.tempi[tempo], bpm(tempo), phase);
        }
        sum.estimate(phase)
    }
}

/// Sums over the states near one tempo and phase.
#[derive(Default)]
struct Neighbourhood {
    mass: f32,
    log_bpm: f64,
    shift: f64,
    slots: [f32; SLOTS],
}

impl Neighbourhood {
    fn add(&mut self, states: &TempoStates, bpm: f64, phase: f64) {
        let steps = states.ring.len() as i64;
        let reach = steps / 8;
        let centre = (phase * steps as f64).round() as i64;
        for offset in -reach..=reach {
            let since = (centre + offset).rem_euclid(steps) as usize;
            // A phase beyond the beat is one of the beat before or after.
            let turn = (centre + offset).div_euclid(steps);
            for (slot, &value) in states.at(since).iter().take(SLOTS).enumerate() {
                self.mass += value;
                self.log_bpm += f64::from(value) * libm::log(bpm);
                self.shift += f64::from(value) * ((centre + offset) as f64 / steps as f64 - phase);
                self.slots[neighbour(slot, -turn)] += value;
            }
        }
    }

    fn estimate(&self, phase: f64) -> BarEstimate {
        let mass = f64::from(self.mass.max(1e-30));
        let whole = phase + self.shift / mass;
        let turn = whole.floor() as i64;
        let of_meter =
            |m: usize| -> f32 { self.slots[FIRST[m]..FIRST[m] + METERS[m]].iter().sum() };
        let meter = (0..METERS.len()).max_by(|&a, &b| of_meter(a).total_cmp(&of_meter(b)));
        let meter = meter.unwrap_or(0);
        let slots = FIRST[meter]..FIRST[meter] + METERS[meter];
        let best = slots.max_by(|&a, &b| self.slots[a].total_cmp(&self.slots[b]));
        let best = best.unwrap_or(FIRST[meter]);
        BarEstimate {
            bpm: libm::exp(self.log_bpm / mass),
            phase: whole - whole.floor(),
            mass: self.mass,
            meter: METERS[meter] as u8,
            beat: (neighbour(best, turn) - FIRST[meter]) as u8,
            bar_mass: self.slots[best] / self.mass.max(1e-30),
            meter_mass: of_meter(meter) / self.mass.max(1e-30),
        }
    }
}

fn meter_of(slot: usize) -> usize {
    FIRST.iter().rposition(|&first| first <= slot).unwrap_or(0)
}

/// The beat of the same bar so many beats later.
fn neighbour(slot: usize, beats: i64) -> usize {
    let meter = meter_of(slot);
    let place = (slot - FIRST[meter]) as i64 + beats;
    FIRST[meter] + place.rem_euclid(METERS[meter] as i64) as usize
}

/// How usual a tempo is: the logarithm of a bell over octaves, 0 at its middle.
fn usual(tempo: usize) -> f64 {
    let octaves = libm::log2(bpm(tempo) / PRIOR_BPM) / PRIOR_OCTAVES;
    -0.5 * octaves * octaves
}

fn worth() -> [f32; TEMPI] {
    let beat_s = |tempo| 60.0 / bpm(tempo);
    std::array::from_fn(|tempo| libm::exp(PRIOR_PER_S * beat_s(tempo) * usual(tempo)) as f32)
}

/// How usual each tempo is; sums to one.
fn prior() -> [f32; TEMPI] {
    let mut prior: [f32; TEMPI] = std::array::from_fn(|tempo| libm::exp(usual(tempo)) as f32);
    let sum: f32 = prior.iter().sum();
    prior.iter_mut().for_each(|p| *p /= sum);
    prior
}

fn changes() -> Vec<[f32; 2 * REACH + 1]> {
    let row = |from: usize| {
        let mut chances: [f32; 2 * REACH + 1] = std::array::from_fn(|k| {
            let change = (k as f64 - REACH as f64).abs() / LENGTHS[from] as f64;
            libm::exp(-STEADINESS * change) as f32
        });
        let sum: f32 = chances.iter().sum();
        chances.iter_mut().for_each(|c| *c /= sum);
        chances
    };
    (0..TEMPI).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bars at `bpm` for `seconds`, a beat more likely on the first of `meter`.
    fn hear(pointer: &mut BarPointer, bpm: f64, meter: usize, from_beat: f64, seconds: f64) {
        for step in 0..(seconds * RATE_HZ) as usize {
            let beats = from_beat + step as f64 / RATE_HZ * bpm / 60.0;
            let off_s = (beats - beats.round()).abs() * 60.0 / bpm;
            let near = off_s < 0.01;
            let first = (beats.round() as usize).is_multiple_of(meter);
            let evidence = match (near, first) {
                (true, true) => BeatEvidence { downbeat: 3.0, beat: 2.0, third: 2.6, heard: 0.8 },
                (true, false) => BeatEvidence { downbeat: 2.0, beat: 2.6, third: 2.3, heard: 0.8 },
                _ => BeatEvidence { downbeat: -0.7, beat: -0.7, third: -0.7, heard: 0.02 },
            };
            pointer.step(&evidence);
        }
    }

    #[test]
    fn tempo_phase_and_meter_are_found() {
        for (bpm, meter) in [(62.0, 4), (97.0, 3), (124.0, 4), (150.0, 5), (171.0, 3), (208.0, 4)] {
            let mut pointer = BarPointer::new();
            hear(&mut pointer, bpm, meter, 0.3, 16.0);
            let estimate = pointer.estimate();
            assert!((estimate.bpm / bpm - 1.0).abs() < 0.02, "{bpm}: {estimate:?}");
            let truth = 0.3 + 16.0 * bpm / 60.0;
            let off = estimate.phase - truth.fract();
            assert!((off - off.round()).abs() < 0.06, "{bpm}: {estimate:?}, {}", truth.fract());
            assert_eq!(usize::from(estimate.meter), meter, "{bpm}: {estimate:?}");
            let place = (f64::from(estimate.beat) + estimate.phase - truth) / meter as f64;
            assert!((place - place.round()).abs() < 0.05, "{bpm}: {estimate:?} at {truth}");
        }
    }

    #[test]
    fn a_phase_held_for_minutes_is_left_within_six_seconds() {
        let mut pointer = BarPointer::new();
        hear(&mut pointer, 120.0, 4, 0.0, 180.0);
        hear(&mut pointer, 120.0, 4, 0.5, 6.0);
        let estimate = pointer.estimate();
        let off = estimate.phase - 0.5;
        assert!((off - off.round()).abs() < 0.06 && estimate.mass > 0.5, "{estimate:?}");
    }

    #[test]
    fn changes_of_harmony_tell_the_bar_and_nothing_else() {
        let mut pointer = BarPointer::new();
        for beat in 0..48 {
            // 120 BPM, every beat like the other.
            hear(&mut pointer, 120.0, 1_000_000, f64::from(beat) + 999.7, 0.5);
            let before = pointer.estimate();
            // Heard 0.35 s after each beat, which was 0.15 s ago: 0.1 s before the next step.
            pointer.weigh_bars(if beat % 4 == 2 { 1.0 } else { -0.3 }, 0.325, 0.05);
            let after = pointer.estimate();
            assert!((before.mass - after.mass).abs() < 1e-3, "{before:?} {after:?}");
            assert!((before.bpm - after.bpm).abs() < 0.1, "{before:?} {after:?}");
        }
        let estimate = pointer.estimate();
        assert_eq!((estimate.meter, estimate.beat), (4, 1), "{estimate:?}");
    }

    #[test]
    fn no_evidence_is_no_knowledge() {
        let mut pointer = BarPointer::new();
        hear(&mut pointer, 120.0, 4, 0.0, 20.0);
        for _ in 0..(60.0 * RATE_HZ) as usize {
            pointer.step(&BeatEvidence::default());
        }
        assert!(pointer.estimate().mass < 0.5);
    }

    #[test]
    fn what_is_heard_before_a_beat_is_evidence_of_that_beat() {
        let heard = BeatEvidence { downbeat: 3.0, ..BeatEvidence::default() };
        let factors = Factors::new(&heard, 1.0);
        for (&beats, first) in METERS.iter().zip(FIRST) {
            for beat in 0..beats {
                let opens = |beat: usize| if beat == 0 { 3f32.exp() } else { 1.0 };
                assert_eq!(factors.after[first + beat], opens(beat), "{beat} of {beats}");
                let next = (beat + 1) % beats;
                assert_eq!(factors.before[first + beat], opens(next), "{beat} of {beats}");
            }
        }
    }
}
