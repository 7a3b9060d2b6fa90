//! What was danced in the last half minute, so that it is not danced again.
//!
//! A model with little material falls back into the same figures. [`Echo`]
//! compares the last frames with the frames of every moment that it remembers;
//! where they are alike, what followed then becomes less likely now.

/// Frames that are remembered: 32 seconds.
const MEMORY_FRAMES: usize = 640;
/// The nearest past that counts, two seconds: what comes back sooner is a step
/// of one figure, not a figure danced again.
const NEAREST_FRAMES: usize = 40;
/// How much of the likeness stays from frame to frame: half of it for a third of
/// a second, so that one differing code does not hide a repetition.
const KEPT: f32 = 0.9;

/// Codes of the past, and how much the present is like it.
#[derive(Clone, Debug)]
pub struct Echo {
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

impl Echo {
    /// Nothing yet, for `parts` of `codes` codes each.
    pub fn new(parts: usize, codes: usize) -> Self {
        Self {
            parts,
            rows: vec![0; parts * MEMORY_FRAMES],
            next: 0,
            filled: 0,
            likeness: vec![0.0; MEMORY_FRAMES + 1],
            worst: vec![0.0; codes],
        }
    }

    /// Nothing again.
    pub fn clear(&mut self) {
        (self.next, self.filled) = (0, 0);
        self.likeness.fill(0.0);
    }

    /// Remembers the codes of a frame, one per part.
    pub fn push(&mut self, codes: &[usize]) {
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
    pub fn discourage(&mut self, part: usize, strength: f32, logits: &mut [f32]) {
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
        let mut echo = Echo::new(1, 200);
        (0..frames).for_each(|t| echo.push(&[code(t)]));
        let mut logits = vec![0.0; 200];
        echo.discourage(0, 2.0, &mut logits);
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
        let mut echo = Echo::new(1, 200);
        (0..120).for_each(|t| echo.push(&[t % 50]));
        echo.clear();
        let mut logits = vec![0.0; 200];
        echo.discourage(0, 2.0, &mut logits);
        assert!(logits.iter().all(|l| *l == 0.0));
    }
}
