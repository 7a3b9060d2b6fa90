//! How far apart robots are in time, from where their servos truly were.
//!
//! Two robots that dance the same are compared in windows of [`WINDOW_S`]: the
//! shift in time by which one's joints fit the other's best, by least squares
//! (Gauss-Newton from the best of a grid). What still differs after it, as a
//! share of the movement, says whether they dance the same at all.

use anyhow::Context;
use std::path::Path;

/// Length of a window and from one to the next, seconds.
pub const WINDOW_S: f64 = 1.0;
/// See [`WINDOW_S`].
pub const HOP_S: f64 = 0.1;
/// Shifts are looked for up to this, in steps of that, seconds.
const FARTHEST_S: f64 = 0.4;
const GRID_S: f64 = 0.02;
/// Joints that move less than this tell nothing, rad/s root mean square.
const STILL_RAD_S: f64 = 0.05;
/// Robots differ no more than this share of their movement when they dance the same.
const ALIKE: f64 = 0.3;

/// What one follower's servos did: seconds of the shared clock, ascending.
#[derive(Clone, Debug, Default)]
pub struct Track {
    times_s: Vec<f64>,
    idle: Vec<f64>,
    /// One row a sample.
    positions_rad: Vec<Vec<f64>>,
}

/// How one robot compares with another in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Match {
    /// Neither moves enough, or one has no samples.
    Nothing,
    /// They do not dance the same.
    Otherwise,
    /// It is so many seconds later.
    Later(f64),
}

impl Track {
    /// Reads what a witness wrote.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        let mut track = Self::default();
        for line in text.lines() {
            let numbers: Result<Vec<f64>, _> = line.split(' ').map(str::parse).collect();
            let numbers = numbers.with_context(|| format!("{}: no numbers", path.display()))?;
            if let [time_s, idle, positions @ ..] = numbers.as_slice() {
                track.push(*time_s, *idle, positions.to_vec());
            }
        }
        Ok(track)
    }

    fn push(&mut self, time_s: f64, idle: f64, positions_rad: Vec<f64>) {
        self.times_s.push(time_s);
        self.idle.push(idle);
        self.positions_rad.push(positions_rad);
    }

    /// When the robot idles more than it dances for the first time after
    /// `after_s`; or dances more than it idles.
    pub fn idles_s(&self, after_s: f64, idles: bool) -> Option<f64> {
        let from = self.times_s.partition_point(|t| *t < after_s);
        let place = self.idle[from..]
            .iter()
            .position(|idle| (*idle > 0.5) == idles)?;
        Some(self.times_s[from + place])
    }

    /// Joint positions and speeds at a time, between two samples.
    fn at(&self, time_s: f64, each: &mut impl FnMut(usize, f64, f64)) -> bool {
        let after = self.times_s.partition_point(|t| *t <= time_s);
        if after == 0 || after == self.times_s.len() {
            return false;
        }
        let (from_s, to_s) = (self.times_s[after - 1], self.times_s[after]);
        let share = (time_s - from_s) / (to_s - from_s);
        let (from, to) = (&self.positions_rad[after - 1], &self.positions_rad[after]);
        for (joint, (a, b)) in from.iter().zip(to).enumerate() {
            each(joint, a + share * (b - a), (b - a) / (to_s - from_s));
        }
        true
    }

    /// How `other` compares in the window that begins at `from_s`.
    pub fn compare(&self, other: &Track, from_s: f64) -> Match {
        let first = self.times_s.partition_point(|t| *t < from_s);
        let last = self.times_s.partition_point(|t| *t < from_s + WINDOW_S);
        if last < first + 10 {
            return Match::Nothing;
        }
        let fit = |shift_s| self.fit(other, first..last, shift_s);
        let steps = (FARTHEST_S / GRID_S) as i32;
        let grid = (-steps..=steps).map(|i| f64::from(i) * GRID_S);
        let best = grid.filter_map(|shift_s| Some((shift_s, fit(shift_s)?.error)));
        let Some((mut shift_s, _)) = best.min_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Match::Nothing;
        };
        for _ in 0..4 {
            let Some(fit) = fit(shift_s).filter(|fit| fit.speed > 0.0) else {
                return Match::Nothing;
            };
            shift_s += (fit.slope / fit.speed).clamp(-GRID_S, GRID_S);
        }
        match fit(shift_s) {
            Some(fit) if fit.speed.sqrt() < STILL_RAD_S => Match::Nothing,
            Some(fit) if fit.error > ALIKE * fit.movement => Match::Otherwise,
            Some(_) => Match::Later(shift_s),
            None => Match::Nothing,
        }
    }

    /// Sums over the samples of a window, `other` looked at `shift_s` later;
    /// `None` where it has none.
    fn fit(&self, other: &Track, window: std::ops::Range<usize>, shift_s: f64) -> Option<Fit> {
        let count = window.len() as f64;
        let joints = self.positions_rad.get(window.start)?.len();
        let mut means = vec![0.0; joints];
        for row in &self.positions_rad[window.clone()] {
            for (mean, position) in means.iter_mut().zip(row) {
                *mean += position / count;
            }
        }
        let mut fit = Fit::default();
        for sample in window {
            let own = &self.positions_rad[sample];
            let known = other.at(
                self.times_s[sample] + shift_s,
                &mut |joint, theirs, speed| {
                    let difference = own[joint] - theirs;
                    fit.error += difference * difference / count;
                    fit.slope += difference * speed / count;
                    fit.speed += speed * speed / count;
                    fit.movement += (own[joint] - means[joint]).powi(2) / count;
                },
            );
            if !known {
                return None;
            }
        }
        Some(fit)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    error: f64,
    slope: f64,
    speed: f64,
    movement: f64,
}

/// How robots are together in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Together {
    /// So many seconds between the first and the last.
    Within(f64),
    /// They do not all dance the same.
    Apart,
    /// They stand still, or there is too little of them.
    Unknown,
}

/// How far apart all of them are in the window that begins at `from_s`.
pub fn together(tracks: &[&Track], from_s: f64) -> Together {
    let Some((first, others)) = tracks.split_first() else {
        return Together::Unknown;
    };
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for other in others {
        match first.compare(other, from_s) {
            Match::Later(shift_s) => {
                least = least.min(shift_s);
                most = most.max(shift_s);
            }
            Match::Otherwise => return Together::Apart,
            Match::Nothing => return Together::Unknown,
        }
    }
    Together::Within(most - least)
}

/// Seconds from `from_s` until they are within `most_s` for good, looked at up
/// to `to_s`; `None` if they are not.
pub fn settled_s(tracks: &[&Track], from_s: f64, to_s: f64, most_s: f64) -> Option<f64> {
    let count = ((to_s - WINDOW_S - from_s) / HOP_S).max(0.0) as u32;
    let mut since_s = None;
    for window in 0..count {
        let at_s = from_s + f64::from(window) * HOP_S;
        match together(tracks, at_s) {
            Together::Within(spread_s) if spread_s <= most_s => {
                since_s.get_or_insert(at_s - from_s);
            }
            Together::Unknown => {}
            _ => since_s = None,
        }
    }
    since_s
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two joints that move like a dance, `late_s` late, with sensor noise.
    fn track(late_s: f64, other: f64) -> Track {
        let mut track = Track::default();
        for i in 0..600 {
            let time_s = 100.0 + f64::from(i) * 0.0101 + late_s * 0.1;
            let t = time_s - late_s;
            let noise = 0.0005 * f64::from((i * 7919) % 13 - 6) / 6.0;
            track.push(
                time_s,
                f64::from(u8::from(i > 300)),
                vec![0.4 * (5.0 * t).sin() + noise, 0.3 * (8.3 * t + other).cos()],
            );
        }
        track
    }

    #[test]
    fn shifts_are_found_to_a_fraction_of_a_millisecond() {
        let first = track(0.0, 0.0);
        for late_s in [0.0, 0.003, -0.012, 0.15] {
            let Match::Later(found_s) = first.compare(&track(late_s, 0.0), 102.0) else {
                panic!("{late_s}")
            };
            assert!((found_s - late_s).abs() < 3e-4, "{late_s}: {found_s}");
        }
        assert_eq!(first.compare(&track(0.0, 2.0), 102.0), Match::Otherwise);
        assert_eq!(first.compare(&track(0.0, 0.0), 900.0), Match::Nothing);
    }

    #[test]
    fn the_spread_is_between_the_first_and_the_last() {
        let tracks = [0.0, 0.004, -0.003].map(|late_s| track(late_s, 0.0));
        let all: Vec<&Track> = tracks.iter().collect();
        let Together::Within(spread_s) = together(&all, 102.0) else {
            panic!("they dance the same")
        };
        assert!((spread_s - 0.007).abs() < 4e-4, "{spread_s}");
        let unlike = track(0.0, 2.0);
        assert_eq!(together(&[&tracks[0], &unlike], 102.0), Together::Apart);
        assert_eq!(settled_s(&all, 101.0, 105.0, 0.01), Some(0.0));
        assert_eq!(settled_s(&all, 101.0, 105.0, 0.005), None);
    }

    #[test]
    fn idle_is_seen() {
        let idles_s = track(0.0, 0.0).idles_s(100.0, true).unwrap();
        assert!((idles_s - 103.04).abs() < 0.01, "{idles_s}");
    }
}
