//! How loud the music is, beside how loud it usually is.

use super::average::Average;

/// Differences of loudness that are hardly heard, decibels.
const LEAST_SPREAD_DB: f32 = 1.5;

/// Follows the level of one song. Causal, whatever the gain.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loudness {
    level_db: Average,
    variance_db2: f32,
}

impl Loudness {
    /// `now_share` is the share of the newest frame in the loudness of now.
    pub fn new(now_share: f32) -> Self {
        Self { level_db: Average::new(now_share), variance_db2: 0.0 }
    }

    /// Takes in a level, decibels above anything.
    pub fn push(&mut self, level_db: f32) {
        self.level_db.push(level_db);
        let off_db = self.above_usual_db();
        self.variance_db2 += (off_db * off_db - self.variance_db2) * self.level_db.usual_share();
    }

    /// In usual spreads: 1 is one standard deviation above the usual.
    pub fn above_usual(&self) -> f32 {
        self.above_usual_db() / self.variance_db2.sqrt().max(LEAST_SPREAD_DB)
    }

    fn above_usual_db(&self) -> f32 {
        self.level_db.now - self.level_db.usual
    }
}
