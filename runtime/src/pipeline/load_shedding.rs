//! Load shedding: what is left out while the machine is too slow, in this order,
//! never control:
//!
//! | level | left out | what it gives |
//! |---|---|---|
//! | 1 | the picture | the processor is free at once after the dance |
//! | 2 | viewers: two frames a second | the viewers' thread rests |
//! | 3 | guidance of the generator | half the time of a step |
//! | 4 | the generator: a held figure | nearly all of it |
//!
//! The load is the share of its time that a motion frame takes in
//! feature extractor and generator. Above `HIGH` for a second one thing more is left out; below `LOW`
//! for ten seconds one comes back (the picture does not). Time is counted in
//! motion frames. In simulated time nothing is ever left out: it waits.

use servodance_types::FRAME_RATE_HZ;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Above this share of its time a frame takes too long.
const HIGH: f64 = 0.8;
/// Below this there is room for more.
const LOW: f64 = 0.5;
/// Frames over which the load is averaged.
const AVERAGED: f64 = 10.0;
/// Frames from one step to the next, for worse and for better.
const WORSE_AFTER: u32 = FRAME_RATE_HZ as u32;
const BETTER_AFTER: u32 = 10 * FRAME_RATE_HZ as u32;
/// A frame that takes longer than this many counts as this: one stall is no load.
const LONGEST: f64 = 3.0;

/// A level of load shedding: this and all before it are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum LeftOut {
    #[default]
    Nothing,
    Picture,
    Viewers,
    Guidance,
    Generator,
}

impl LeftOut {
    /// All levels above `Nothing`, rising.
    const ORDER: [LeftOut; 4] =
        [LeftOut::Picture, LeftOut::Viewers, LeftOut::Guidance, LeftOut::Generator];

    pub const fn name(self) -> &'static str {
        match self {
            LeftOut::Nothing => "nothing",
            LeftOut::Picture => "picture",
            LeftOut::Viewers => "viewers",
            LeftOut::Guidance => "guidance",
            LeftOut::Generator => "generator",
        }
    }

    const fn means(self) -> &'static str {
        match self {
            LeftOut::Nothing => "everything is there",
            LeftOut::Picture => "no picture will be drawn",
            LeftOut::Viewers => "viewers get five frames a second",
            LeftOut::Guidance => "the dance follows the music less closely (no guidance)",
            LeftOut::Generator => "the figure is held",
        }
    }

    fn at(level: usize) -> Self {
        match level {
            0 => LeftOut::Nothing,
            level => Self::ORDER[(level - 1).min(Self::ORDER.len() - 1)],
        }
    }
}

/// The present and the highest level, shared by all clones.
#[derive(Clone, Debug, Default)]
pub struct LoadShedding {
    now: Arc<AtomicU8>,
    most: Arc<AtomicU8>,
}

impl LoadShedding {
    pub fn now(&self) -> LeftOut {
        LeftOut::at(self.now.load(Ordering::Relaxed).into())
    }

    /// The most that was left out at any time.
    pub fn most(&self) -> LeftOut {
        LeftOut::at(self.most.load(Ordering::Relaxed).into())
    }

    /// Names of all that was left out at any time, in order.
    pub fn names(&self) -> Vec<String> {
        let all = LeftOut::ORDER.into_iter();
        let left_out = all.take_while(|what| *what <= self.most());
        left_out.map(|what| what.name().to_owned()).collect()
    }

    fn set(&self, level: LeftOut) {
        self.now.store(level as u8, Ordering::Relaxed);
        self.most.fetch_max(level as u8, Ordering::Relaxed);
    }
}

/// Gets a line for the user whenever the level changes.
pub type OnChange = Box<dyn FnMut(&str) + Send>;

pub struct OverloadWatch {
    shedding: LoadShedding,
    on_change: OnChange,
    load: f64,
    frames: u32,
}

impl OverloadWatch {
    /// A watch that sets the level of `shedding`.
    pub fn new(shedding: LoadShedding, on_change: OnChange) -> Self {
        Self { shedding, on_change, load: 0.0, frames: 0 }
    }

    /// Takes in the milliseconds that one motion frame took.
    pub fn note(&mut self, work_ms: f64) {
        let share = (work_ms * 1e-3 * FRAME_RATE_HZ).min(LONGEST);
        self.load += (share - self.load) / AVERAGED;
        self.frames += 1;
        let level = self.shedding.now();
        if self.load > HIGH && self.frames >= WORSE_AFTER && level < LeftOut::Generator {
            let next = LeftOut::at(level as usize + 1);
            let percent = self.load * 100.0;
            let means = next.means();
            self.set_level(
                next,
                &format!(
                    "hearing and inventing take {percent:.0} % of the time that there is: {means}"
                ),
            );
        } else if self.load < LOW && self.frames >= BETTER_AFTER && level > LeftOut::Picture {
            let next = LeftOut::at(level as usize - 1);
            let name = level.name();
            self.set_level(next, &format!("the machine keeps up again: back with the {name}"));
        }
    }

    pub fn left_out(&self) -> LeftOut {
        self.shedding.now()
    }

    fn set_level(&mut self, level: LeftOut, why: &str) {
        self.shedding.set(level);
        self.frames = 0;
        (self.on_change)(why);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch() -> (OverloadWatch, LoadShedding) {
        let shedding = LoadShedding::default();
        (OverloadWatch::new(shedding.clone(), Box::new(|_| ())), shedding)
    }

    /// The levels passed through while frames take `work_ms(level)`.
    fn levels(
        watch: &mut OverloadWatch,
        frames: u32,
        work_ms: impl Fn(LeftOut) -> f64,
    ) -> Vec<LeftOut> {
        let mut seen = vec![watch.left_out()];
        for _ in 0..frames {
            watch.note(work_ms(watch.left_out()));
            if seen.last() != Some(&watch.left_out()) {
                seen.push(watch.left_out());
            }
        }
        seen
    }

    #[test]
    fn the_order_is_picture_viewers_guidance_generator_and_back() {
        use LeftOut::{Generator, Guidance, Nothing, Picture, Viewers};
        let (mut watch, shedding) = watch();
        let worse = levels(&mut watch, 200, |_| 100.0);
        assert_eq!(worse, [Nothing, Picture, Viewers, Guidance, Generator]);
        let better = levels(&mut watch, 2000, |_| 5.0);
        assert_eq!(better, [Generator, Guidance, Viewers, Picture]);
        assert_eq!(shedding.most(), Generator);
        assert_eq!(shedding.names(), ["picture", "viewers", "guidance", "generator"]);
    }

    #[test]
    fn no_more_is_left_out_than_need_be() {
        let (mut watch, shedding) = watch();
        // Guidance is half of the work.
        let work_ms = |level| match level >= LeftOut::Guidance {
            true => 30.0,
            false => 60.0,
        };
        levels(&mut watch, 2000, work_ms);
        assert_eq!((shedding.now(), shedding.most()), (LeftOut::Guidance, LeftOut::Guidance));
    }

    #[test]
    fn a_stall_now_and_then_is_no_overload() {
        let (mut watch, shedding) = watch();
        for frame in 0..1000 {
            watch.note(if frame % 100 == 0 { 2000.0 } else { 10.0 });
        }
        assert_eq!(shedding.most(), LeftOut::Nothing);
        assert!(shedding.names().is_empty());
    }
}
