//! The value of now beside the usual one.

/// Frames over which the usual value is averaged: half a minute.
const USUAL_FRAMES: f32 = 600.0;

/// Two averages of one value, over a moment and over half a minute.
#[derive(Clone, Copy, Debug)]
pub(super) struct Average {
    now_share: f32,
    frames: f32,
    pub now: f32,
    pub usual: f32,
}

impl Average {
    /// `now_share` is the share of the newest frame in the value of now.
    pub fn new(now_share: f32) -> Self {
        Self { now_share, frames: 0.0, now: 0.0, usual: 0.0 }
    }

    pub fn push(&mut self, value: f32) {
        self.frames = (self.frames + 1.0).min(USUAL_FRAMES);
        let share = self.usual_share();
        self.now += (value - self.now) * share.max(self.now_share);
        self.usual += (self.now - self.usual) * share;
    }

    /// Share of the newest frame among all, until the average has its length.
    pub fn usual_share(&self) -> f32 {
        self.frames.recip()
    }
}
