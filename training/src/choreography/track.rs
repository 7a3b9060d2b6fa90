//! Key poses over time: every key is arrived at with velocity zero.
//!
//! Between keys the path is minimum-jerk, as human reaching is, so the speed
//! is lowest exactly at the keys: put them on beats.

/// Position 0 to 1 along a minimum-jerk path at time share `u` (clamped). A
/// `snap` above 1 lingers at the start and then hurries; 1 is symmetric.
pub(crate) fn minimum_jerk(u: f64, snap: f64) -> f64 {
    let u = u.clamp(0.0, 1.0).powf(snap);
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// A bump that is 0 at `u` = 0 and 1, flat there, and 1 in the middle.
pub(crate) fn bump(u: f64) -> f64 {
    (std::f64::consts::PI * u.clamp(0.0, 1.0)).sin().powi(2)
}

/// Keys of one part of the body, in order of time.
#[derive(Clone, Debug)]
pub(crate) struct KeyTrack<K> {
    keys: Vec<(f64, K)>,
}

impl<K: Clone> KeyTrack<K> {
    pub(crate) fn starting_with(key: K) -> Self {
        Self { keys: vec![(0.0, key)] }
    }

    /// Adds a key; one at or before the last key replaces it.
    pub(crate) fn push(&mut self, time_s: f64, key: K) {
        while self.keys.len() > 1 && self.keys[self.keys.len() - 1].0 >= time_s - 1e-6 {
            self.keys.pop();
        }
        self.keys.push((time_s.max(0.0), key));
    }

    pub(crate) fn last(&self) -> &K {
        &self.keys[self.keys.len() - 1].1
    }

    pub(crate) fn last_time_s(&self) -> f64 {
        self.keys[self.keys.len() - 1].0
    }

    /// The keys around a time, and the share of time passed between them.
    pub(crate) fn around(&self, time_s: f64) -> (&K, &K, f64) {
        let after = self.keys.partition_point(|(at, _)| *at <= time_s);
        let from = &self.keys[after.saturating_sub(1)];
        let Some(to) = self.keys.get(after) else {
            return (&from.1, &from.1, 1.0);
        };
        (&from.1, &to.1, (time_s - from.0) / (to.0 - from.0))
    }
}

/// Element by element from `a` to `b`.
pub(crate) fn mix<const N: usize>(a: &[f64; N], b: &[f64; N], t: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minimum_jerk_rests_at_both_ends() {
        for snap in [1.0, 1.6] {
            assert_eq!(minimum_jerk(0.0, snap), 0.0);
            assert_eq!(minimum_jerk(1.0, snap), 1.0);
            assert!(minimum_jerk(0.01, snap) < 1e-5);
            assert!(minimum_jerk(0.99, snap) > 1.0 - 1e-4);
        }
    }

    #[test]
    fn track_names_the_keys_around() {
        let mut track = KeyTrack::starting_with('a');
        track.push(1.0, 'b');
        track.push(3.0, 'c');
        assert_eq!(track.around(2.0), (&'b', &'c', 0.5));
        assert_eq!(track.around(9.0), (&'c', &'c', 1.0));
    }
}
