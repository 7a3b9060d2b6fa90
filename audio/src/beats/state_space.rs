//! The states of the beat models: tempi from 59 to 192 BPM, and for each tempo
//! one state for every hop of its period, the hops since the last beat.
//!
//! A bar-pointer model with one-beat bars (Whiteley 2006, efficient state space
//! after Krebs 2015). [`tempo`](super::tempo) filters it as music comes in,
//! [`offline`](super::offline) finds the best path through a whole piece; the tracker's own
//! model, with bars, is the [bar pointer](super::bar_pointer).

/// Hops a second of the onset strength.
pub(super) const RATE_HZ: f64 = 160.0;
/// Shortest period in hops: 192 BPM.
const SHORTEST: usize = 50;
/// Tempi: every whole number of hops down to 59 BPM, fastest first.
pub(super) const TEMPI: usize = 113;
/// Middle and width of the prior over tempi, a bell over octaves.
const PRIOR_BPM: f64 = 130.0;
const PRIOR_OCTAVES: f64 = 0.63;
/// Weight of the prior, log-likelihood a second, paid at each beat.
const PRIOR_PER_S: f64 = 0.1;
/// The bell around a beat in which onsets count: width in seconds, half length in hops.
const BEAT_SIGMA_S: f32 = 0.017;
pub(super) const BELL: usize = 6;
/// Weight of an onset's strength in the log-likelihood of a beat.
const GAIN: f32 = 2.1;
/// Strength that is neither for nor against a beat.
const NEUTRAL: f32 = 0.07;
/// How fast the probability of a change of tempo falls with its relative size.
const STEADINESS: f32 = 120.0;
/// Largest change of the period at one beat, hops.
pub(super) const REACH: usize = 3;

pub(super) const fn period(tempo: usize) -> usize {
    SHORTEST + tempo
}

pub(super) fn bpm(tempo: usize) -> f64 {
    60.0 * RATE_HZ / period(tempo) as f64
}

/// Prior likelihood of a tempo, 1 at the most usual.
pub(super) fn prior(tempo: usize) -> f32 {
    let octaves = (bpm(tempo) / PRIOR_BPM).log2() / PRIOR_OCTAVES;
    (-0.5 * octaves * octaves).exp() as f32
}

/// Log-likelihood that a beat at an unusual tempo costs.
pub(super) fn beat_cost(tempo: usize) -> f32 {
    (PRIOR_PER_S * 60.0 / bpm(tempo)) as f32 * prior(tempo).ln()
}

/// Log-odds of a beat in a hop with this onset strength.
pub(crate) fn evidence(strength: f32) -> f32 {
    GAIN * (strength - NEUTRAL)
}

/// The bell around a beat, by distance in hops.
pub(super) fn bell() -> [f32; BELL] {
    std::array::from_fn(|hop| {
        let x = hop as f32 / RATE_HZ as f32 / BEAT_SIGMA_S;
        (-0.5 * x * x).exp()
    })
}

/// Probabilities of the steps from each tempo to its neighbours at a beat.
pub(super) fn steps() -> Vec<[f32; 2 * REACH + 1]> {
    (0..TEMPI)
        .map(|from| {
            let mut chances: [f32; 2 * REACH + 1] = std::array::from_fn(|k| {
                let change = (k as f32 - REACH as f32).abs() / period(from) as f32;
                (-STEADINESS * change).exp()
            });
            let sum: f32 = chances.iter().sum();
            chances.iter_mut().for_each(|c| *c /= sum);
            chances
        })
        .collect()
}

/// The states of one tempo, in a ring: a hop moves all of them by moving `zero`.
pub(super) struct TempoStates {
    states: Vec<f32>,
    /// Index of the state "on the beat now".
    zero: usize,
}

impl TempoStates {
    pub(super) fn filled(tempo: usize, value: f32) -> Self {
        let states = vec![value; period(tempo)];
        Self { states, zero: 0 }
    }

    fn index(&self, since_beat: usize) -> usize {
        let at = self.zero + since_beat;
        let period = self.states.len();
        if at < period { at } else { at - period }
    }

    pub(super) fn at(&self, since_beat: usize) -> f32 {
        self.states[self.index(since_beat)]
    }

    pub(super) fn at_mut(&mut self, since_beat: usize) -> &mut f32 {
        let index = self.index(since_beat);
        &mut self.states[index]
    }

    /// Moves every state on by one hop; returns the one that arrives at the
    /// next beat and now has that beat's place.
    pub(super) fn advance(&mut self) -> f32 {
        let period = self.states.len();
        self.zero = (self.zero + period - 1) % period;
        self.states[self.zero]
    }

    /// Changes the states near a beat by their distance from it in hops.
    pub(super) fn near_beat(&mut self, change: impl Fn(&mut f32, usize)) {
        let period = self.states.len();
        change(self.at_mut(0), 0);
        for distance in 1..BELL {
            change(self.at_mut(distance), distance);
            change(self.at_mut(period - distance), distance);
        }
    }

    pub(super) fn total(&self) -> f32 {
        self.states.iter().sum()
    }

    pub(super) fn scale(&mut self, factor: f32) {
        self.states.iter_mut().for_each(|state| *state *= factor);
    }

    /// The most likely number of hops since the last beat.
    pub(super) fn likeliest(&self) -> usize {
        let hops = 0..self.states.len();
        let best = hops.max_by(|&a, &b| self.at(a).total_cmp(&self.at(b)));
        best.unwrap_or(0)
    }
}
