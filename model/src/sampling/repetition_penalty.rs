//! Repetition penalty: logits of what was danced before fall before a code is drawn.
//!
//! There are two, added up. One counts how often a code came in the last two
//! seconds (option `repetition`). The other is for whole figures (option
//! `variety`), into which a model with little material falls back: the last frames
//! are compared with those of every moment of the last half minute; where they are
//! alike, the code that followed then becomes less likely now.
//!
//! Within a phrase the opposite holds: what was danced a bar before becomes likelier (option
//! `bar_repeat`).

#[derive(Clone, Copy, Debug)]
pub(crate) struct PenaltyStrength {
    /// For a code that came in each of the last frames; less in proportion.
    pub repetition: f32,
    /// For a code that goes on with a figure just as the last time.
    pub variety: f32,
    /// Added for a code that came a bar before.
    pub bar_repeat: f32,
    /// Frames of a bar that is to be danced again.
    pub bar_frames: Option<usize>,
}

/// Both penalties and the codes that they remember.
#[derive(Clone, Debug)]
pub(crate) struct RepetitionPenalty {
    recent: RecentCodes,
    figures: RepeatedFigures,
}

impl RepetitionPenalty {
    /// Without a past, for `parts` of `codes` codes each.
    pub fn new(parts: usize, codes: usize) -> Self {
        Self { recent: RecentCodes::new(parts, codes), figures: RepeatedFigures::new(parts, codes) }
    }

    pub fn clear(&mut self) {
        self.recent.clear();
        self.figures.clear();
    }

    /// Remembers the codes of a frame, one per part.
    pub fn push(&mut self, codes: &[usize]) {
        self.recent.push(codes);
        self.figures.push(codes);
    }

    pub fn apply(&mut self, part: usize, strength: PenaltyStrength, logits: &mut [f32]) {
        self.recent.apply(part, strength.repetition, logits);
        self.figures.apply(part, strength.variety, logits);
        if let Some(bar_frames) = strength.bar_frames {
            self.figures.repeat(part, bar_frames, strength.bar_repeat, logits);
        }
    }
}

/// Frames of which codes are counted: two seconds.
const RECENT_FRAMES: usize = 40;

/// How often each code came in the last two seconds.
#[derive(Clone, Debug)]
struct RecentCodes {
    codes: usize,
    counts: Vec<u16>,
    /// Codes of the last frames, the oldest at `next`.
    frames: Vec<usize>,
    next: usize,
    filled: usize,
}

impl RecentCodes {
    fn new(parts: usize, codes: usize) -> Self {
        Self {
            codes,
            counts: vec![0; parts * codes],
            frames: vec![0; parts * RECENT_FRAMES],
            next: 0,
            filled: 0,
        }
    }

    fn clear(&mut self) {
        self.counts.fill(0);
        (self.next, self.filled) = (0, 0);
    }

    fn push(&mut self, codes: &[usize]) {
        let slot = &mut self.frames[self.next * codes.len()..][..codes.len()];
        for (part, (old, new)) in slot.iter_mut().zip(codes).enumerate() {
            if self.filled == RECENT_FRAMES {
                self.counts[part * self.codes + *old] -= 1;
            }
            self.counts[part * self.codes + new] += 1;
            *old = *new;
        }
        self.next = (self.next + 1) % RECENT_FRAMES;
        self.filled = (self.filled + 1).min(RECENT_FRAMES);
    }

    fn apply(&self, part: usize, strength: f32, logits: &mut [f32]) {
        if strength == 0.0 {
            return;
        }
        let counts = &self.counts[part * self.codes..][..self.codes];
        for (logit, count) in logits.iter_mut().zip(counts) {
            *logit -= strength * f32::from(*count) / RECENT_FRAMES as f32;
        }
    }
}

/// Frames that are remembered: 32 seconds.
const MEMORY_FRAMES: usize = 640;
/// The nearest past that counts, two seconds: what comes back sooner is a step
/// of one figure, not a figure danced again.
const NEAREST_FRAMES: usize = 40;
/// How much of the likeness stays from frame to frame: half of it for a third of
/// a second, so that one differing code does not hide a repetition.
const KEPT: f32 = 0.9;

/// Codes of the last half minute, and how much the present is like each moment.
#[derive(Clone, Debug)]
struct RepeatedFigures {
    parts: usize,
    /// Codes of the last frames, one row a frame, the next one to `next`.
    rows: Vec<usize>,
    next: usize,
    filled: usize,
    /// For every lag in frames, 0 to 1: the share of codes that were the same
    /// that long ago, over the last frames.
    likeness: Vec<f32>,
    /// For every code of one part, how much it is discouraged.
    worst: Vec<f32>,
}

impl RepeatedFigures {
    fn new(parts: usize, codes: usize) -> Self {
        Self {
            parts,
            rows: vec![0; parts * MEMORY_FRAMES],
            next: 0,
            filled: 0,
            likeness: vec![0.0; MEMORY_FRAMES + 1],
            worst: vec![0.0; codes],
        }
    }

    fn clear(&mut self) {
        (self.next, self.filled) = (0, 0);
        self.likeness.fill(0.0);
    }

    fn push(&mut self, codes: &[usize]) {
        for lag in NEAREST_FRAMES..=self.filled {
            let then = self.row(lag);
            let same = codes.iter().zip(then).filter(|(a, b)| a == b).count();
            let share = same as f32 / self.parts as f32;
            self.likeness[lag] += (1.0 - KEPT) * (share - self.likeness[lag]);
        }
        self.rows[self.next * self.parts..][..self.parts].copy_from_slice(codes);
        self.next = (self.next + 1) % MEMORY_FRAMES;
        self.filled = (self.filled + 1).min(MEMORY_FRAMES);
    }

    /// Makes the codes of one part less likely that followed when the dancer
    /// last moved as now: a logit falls by up to `strength`.
    fn apply(&mut self, part: usize, strength: f32, logits: &mut [f32]) {
        if strength == 0.0 {
            return;
        }
        self.worst.fill(0.0);
        for lag in NEAREST_FRAMES..=self.filled {
            // The lag counts from the frame before this one to the one like it.
            let followed = self.row(lag)[part];
            self.worst[followed] = self.worst[followed].max(self.likeness[lag]);
        }
        for (logit, worst) in logits.iter_mut().zip(&self.worst) {
            *logit -= strength * worst;
        }
    }

    /// Makes the codes of one part likelier that came `lag` frames before, and half as much
    /// those beside.
    fn repeat(&self, part: usize, lag: usize, strength: f32, logits: &mut [f32]) {
        if lag < 2 || lag >= self.filled {
            return;
        }
        for (lag, share) in [(lag - 1, 0.5), (lag, 1.0), (lag + 1, 0.5)] {
            logits[self.row(lag)[part]] += strength * share;
        }
    }

    /// Codes `lag` frames before the frame that comes next.
    fn row(&self, lag: usize) -> &[usize] {
        let row = (self.next + MEMORY_FRAMES - lag) % MEMORY_FRAMES;
        &self.rows[row * self.parts..][..self.parts]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Logits of part 0 after `frames` frames of a dance of one part.
    fn logits_after(frames: usize, code: impl Fn(usize) -> usize) -> Vec<f32> {
        let mut figures = RepeatedFigures::new(1, 200);
        (0..frames).for_each(|t| figures.push(&[code(t)]));
        let mut logits = vec![0.0; 200];
        figures.apply(0, 2.0, &mut logits);
        logits
    }

    #[test]
    fn what_followed_the_last_time_becomes_unlikely() {
        // A figure of 50 frames, again and again: after 120 frames code 20 comes.
        let logits = logits_after(120, |t| t % 50);
        assert!(logits[20] < -1.9, "{}", logits[20]);
        assert!(logits.iter().enumerate().all(|(c, l)| c == 20 || *l > -0.2));
    }

    #[test]
    fn steps_within_two_seconds_and_what_never_came_are_left_alone() {
        assert!(logits_after(39, |t| t % 10).iter().all(|l| *l == 0.0));
        assert!(logits_after(180, |t| t).iter().all(|l| *l == 0.0));
    }

    #[test]
    fn one_differing_code_hides_nothing() {
        let stumble = |t: usize| if t == 115 { 199 } else { t % 50 };
        assert!(logits_after(120, stumble)[20] < -1.7);
    }

    #[test]
    fn the_past_is_forgotten_after_half_a_minute_and_when_told() {
        let once_again = |t: usize| if t < 660 { 60 + t % 100 } else { t - 660 };
        assert!(logits_after(680, once_again)[20] == 0.0);
        let mut figures = RepeatedFigures::new(1, 200);
        (0..120).for_each(|t| figures.push(&[t % 50]));
        figures.clear();
        let mut logits = vec![0.0; 200];
        figures.apply(0, 2.0, &mut logits);
        assert!(logits.iter().all(|l| *l == 0.0));
    }

    #[test]
    fn what_came_a_bar_before_gets_likelier() {
        let mut figures = RepeatedFigures::new(1, 200);
        (0..60).for_each(|t| figures.push(&[t]));
        let mut logits = vec![0.0; 200];
        figures.repeat(0, 40, 3.0, &mut logits);
        assert_eq!((logits[19], logits[20], logits[21]), (1.5, 3.0, 1.5));
        figures.repeat(0, 60, 3.0, &mut logits);
        assert_eq!(logits.iter().sum::<f32>(), 6.0);
    }

    #[test]
    fn only_what_came_in_the_last_two_seconds_gets_less_likely() {
        let mut recent = RecentCodes::new(2, 4);
        let logits_of = |recent: &RecentCodes, part| {
            let mut logits = [1.0; 4];
            recent.apply(part, 8.0, &mut logits);
            logits
        };
        (0..10).for_each(|_| recent.push(&[2, 0]));
        assert_eq!(logits_of(&recent, 0), [1.0, 1.0, -1.0, 1.0]);
        assert_eq!(logits_of(&recent, 1), [-1.0, 1.0, 1.0, 1.0]);
        (0..35).for_each(|_| recent.push(&[3, 0]));
        assert_eq!(logits_of(&recent, 0), [1.0, 1.0, 0.0, -6.0]);
        recent.clear();
        assert_eq!(logits_of(&recent, 1), [1.0; 4]);
    }
}
