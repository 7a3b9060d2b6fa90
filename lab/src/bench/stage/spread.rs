//! How far apart robots are in time, from where their servos truly were.
//!
//! Two robots are compared in windows of [`WINDOW_S`]: the shift in time by which
//! the movement of one explains that of the other best. Each joint's mean and
//! size are free, because a robot that holds its head lower, or shows less, is
//! not late. The share of the movement that is explained says how alike they
//! dance; below [`ALIKE`] there is no shift to speak of.

use anyhow::Context;
use std::path::Path;

/// Length of a window, seconds.
pub const WINDOW_S: f64 = 1.0;
/// From the start of one window to that of the next, seconds.
pub const HOP_S: f64 = 0.1;
/// Shifts are looked for up to this, in steps of that, seconds.
const FARTHEST_S: f64 = 0.4;
const GRID_S: f64 = 0.02;
/// Robots that move less than this tell nothing, rad/s root mean square.
const STILL_RAD_S: f64 = 0.05;
/// Two robots dance the same where one explains this share of the other.
const ALIKE: f64 = 0.7;
/// Robots are on one beat when they stay there for this long, seconds.
pub const HOLD_S: f64 = 2.0;

/// What one follower's servos did: seconds of the shared clock, ascending.
#[derive(Clone, Debug, Default)]
pub struct Track {
    times_s: Vec<f64>,
    idle: Vec<f64>,
    positions_rad: Vec<Vec<f64>>,
}

/// How one robot compares with another in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Match {
    /// Neither moves enough, or one has no samples.
    Nothing,
    Otherwise,
    /// It is so many seconds later; the share of movement that this explains.
    Later(f64, f64),
}

impl Track {
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
        let place = self.idle[from..].iter().position(|idle| (*idle > 0.5) == idles)?;
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
        let best = grid.filter_map(|shift_s| Some((shift_s, fit(shift_s)?)));
        let Some((mut shift_s, mut best)) = best.max_by(|a, b| a.1.alike.total_cmp(&b.1.alike))
        else {
            return Match::Nothing;
        };
        if best.speed_rad_s < STILL_RAD_S {
            return Match::Nothing;
        }
        // The vertex of a parabola through the best and its neighbours.
        for step_s in [GRID_S / 2.0, GRID_S / 4.0, GRID_S / 4.0] {
            let (Some(before), Some(after)) = (fit(shift_s - step_s), fit(shift_s + step_s)) else {
                return Match::Nothing;
            };
            let bend = before.alike - 2.0 * best.alike + after.alike;
            if bend < 0.0 {
                let vertex = 0.5 * (before.alike - after.alike) / bend;
                shift_s += step_s * vertex.clamp(-1.0, 1.0);
            }
            best = fit(shift_s).unwrap_or(best);
        }
        match best.alike >= ALIKE {
            true => Match::Later(shift_s, best.alike),
            false => Match::Otherwise,
        }
    }

    /// How the movement in a window is explained by that of `other`, looked at
    /// `shift_s` later; `None` where it has no samples.
    fn fit(&self, other: &Track, window: std::ops::Range<usize>, shift_s: f64) -> Option<Fit> {
        let count = window.len() as f64;
        let joints = self.positions_rad.get(window.start)?.len();
        let mut sums = vec![Sums::default(); joints];
        for sample in window.clone() {
            let own = &self.positions_rad[sample];
            let at_s = self.times_s[sample] + shift_s;
            let known = other.at(at_s, &mut |joint, theirs, speed| {
                sums[joint].add(own[joint], theirs, speed);
            });
            if !known {
                return None;
            }
        }
        let own_s = self.times_s[window.end - 1] - self.times_s[window.start];
        let (mut movement, mut explained, mut speed) = (0.0, 0.0, 0.0_f64);
        for (joint, sums) in sums.iter().enumerate() {
            let [own, theirs, both] = sums.variances(count);
            movement += own;
            if both > 0.0 && theirs > 0.0 {
                explained += both * both / theirs;
            }
            let rows = self.positions_rad[window.clone()].windows(2);
            let way: f64 = rows.map(|row| (row[1][joint] - row[0][joint]).powi(2)).sum();
            let own_speed = way * count / own_s.powi(2);
            speed += (sums.speed / count).max(own_speed);
        }
        Some(Fit {
            alike: if movement > 0.0 { explained / movement } else { 0.0 },
            speed_rad_s: speed.sqrt(),
        })
    }
}

/// Sums over the samples of one joint: own and the other's position.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    own: f64,
    theirs: f64,
    squares: [f64; 3],
    speed: f64,
}

impl Sums {
    fn add(&mut self, own: f64, theirs: f64, speed: f64) {
        self.own += own;
        self.theirs += theirs;
        for (sum, value) in
            { self.squares.iter_mut() }.zip([own * own, theirs * theirs, own * theirs])
        {
            *sum += value;
        }
        self.speed += speed * speed;
    }

    /// Variances of own, of theirs, and of both together.
    fn variances(&self, count: f64) -> [f64; 3] {
        let [own, theirs, both] = self.squares.map(|sum| sum / count);
        let (mean, their_mean) = (self.own / count, self.theirs / count);
        [own - mean * mean, theirs - their_mean * their_mean, both - mean * their_mean]
    }
}

#[derive(Clone, Copy, Debug)]
struct Fit {
    alike: f64,
    speed_rad_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Together {
    /// So many seconds between the first and the last; how alike the least alike
    /// is, 0 to 1.
    Within(f64, f64),
    Apart,
    /// They stand still, or there is too little of them.
    Unknown,
}

impl Together {
    fn is_within(self, most_s: f64) -> bool {
        matches!(self, Self::Within(spread_s, _) if spread_s <= most_s)
    }
}

/// How far apart all of them are in the window that begins at `from_s`.
pub fn together(tracks: &[&Track], from_s: f64) -> Together {
    let Some((first, others)) = tracks.split_first() else {
        return Together::Unknown;
    };
    let (mut least, mut most, mut alike) = (0.0_f64, 0.0_f64, 1.0_f64);
    for other in others {
        match first.compare(other, from_s) {
            Match::Later(shift_s, quality) => {
                least = least.min(shift_s);
                most = most.max(shift_s);
                alike = alike.min(quality);
            }
            Match::Otherwise => return Together::Apart,
            Match::Nothing => return Together::Unknown,
        }
    }
    Together::Within(most - least, alike)
}

/// All windows from `from_s` to `to_s`, [`HOP_S`] apart.
pub fn windows(tracks: &[&Track], from_s: f64, to_s: f64) -> Vec<Together> {
    let count = ((to_s - WINDOW_S - from_s) / HOP_S).max(0.0) as u32;
    let starts = (0..count).map(|window| from_s + f64::from(window) * HOP_S);
    starts.map(|at_s| together(tracks, at_s)).collect()
}

/// The first of these windows from which all that begin in the next [`HOLD_S`]
/// are within `most_s`; those in which nobody moves say nothing against it.
pub fn settled(windows: &[Together], most_s: f64) -> Option<usize> {
    let hold = (HOLD_S / HOP_S).round() as usize;
    let holds = |held: &[Together]| {
        let good = |window: &Together| *window == Together::Unknown || window.is_within(most_s);
        held[0].is_within(most_s) && held.iter().all(good)
    };
    windows.windows(hold).position(holds)
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
            let Match::Later(found_s, alike) = first.compare(&track(late_s, 0.0), 102.0) else {
                panic!("{late_s}")
            };
            assert!((found_s - late_s).abs() < 3e-4, "{late_s}: {found_s}");
            assert!(alike > 0.99, "{alike}");
        }
        assert_eq!(first.compare(&track(0.0, 2.0), 102.0), Match::Otherwise);
        assert_eq!(first.compare(&track(0.0, 0.0), 900.0), Match::Nothing);
    }

    #[test]
    fn a_head_held_lower_and_a_smaller_movement_are_not_late() {
        let (first, mut other) = (track(0.0, 0.0), track(0.006, 0.0));
        for row in &mut other.positions_rad {
            row[0] = 0.3 + 0.6 * row[0];
        }
        let Match::Later(found_s, _) = first.compare(&other, 102.0) else {
            panic!("they dance the same")
        };
        assert!((found_s - 0.006).abs() < 3e-4, "{found_s}");
        other.positions_rad.iter_mut().for_each(|row| row.fill(0.1));
        assert_eq!(first.compare(&other, 102.0), Match::Otherwise, "one stands");
    }

    #[test]
    fn the_spread_is_between_the_first_and_the_last() {
        let tracks = [0.0, 0.004, -0.003].map(|late_s| track(late_s, 0.0));
        let all: Vec<&Track> = tracks.iter().collect();
        let Together::Within(spread_s, _) = together(&all, 102.0) else {
            panic!("they dance the same")
        };
        assert!((spread_s - 0.007).abs() < 4e-4, "{spread_s}");
        let unlike = track(0.0, 2.0);
        assert_eq!(together(&[&tracks[0], &unlike], 102.0), Together::Apart);
        let seen = windows(&all, 101.0, 105.0);
        assert_eq!(settled(&seen, 0.01), Some(0));
        assert_eq!(settled(&seen, 0.005), None);
    }

    #[test]
    fn robots_are_together_when_they_stay_so_for_two_seconds() {
        let (good, bad) = (Together::Within(0.002, 0.9), Together::Within(0.02, 0.9));
        let mut seen = vec![good; 60];
        seen[3] = bad;
        seen[25] = Together::Unknown;
        assert_eq!(settled(&seen, 0.01), Some(4));
        seen[20] = Together::Apart;
        assert_eq!(settled(&seen, 0.01), Some(21));
        seen[40] = bad;
        assert_eq!(settled(&seen, 0.01), None, "too little is left");
        assert_eq!(settled(&[Together::Unknown; 60], 0.01), None);
    }

    #[test]
    fn idle_is_seen() {
        let idles_s = track(0.0, 0.0).idles_s(100.0, true).unwrap();
        assert!((idles_s - 103.04).abs() < 0.01, "{idles_s}");
    }
}
