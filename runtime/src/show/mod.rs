//! A show: a song, its outline, and cues at moments of the music; written down as TOML and
//! played again.
//!
//! Times are seconds of the music that is shown. A cue changes a follower's role and nothing
//! else: no cue moves a robot beyond its limits.

mod file;
mod outline;
mod timed_cue;

pub use file::ShowFile;
pub use outline::SongOutline;
pub use timed_cue::TimedCue;

/// The cues of a show, in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Show {
    /// The song as the show file names it; none for the built-in one.
    song: Option<String>,
    style: Option<String>,
    cues: Vec<TimedCue>,
}

/// Cues of a show, at most.
const MOST: usize = 1000;

impl Show {
    /// A show without cues.
    pub fn new(song: Option<String>, style: Option<String>) -> Self {
        Self { song, style, cues: Vec::new() }
    }

    /// The cues, in the order of time.
    pub fn cues(&self) -> &[TimedCue] {
        &self.cues
    }

    /// Adds a cue behind those of the same moment; `false` if there are too many.
    pub fn add(&mut self, cue: TimedCue) -> bool {
        let room = self.cues.len() < MOST;
        if room {
            let place = self.cues.partition_point(|other| other.time_s() <= cue.time_s());
            self.cues.insert(place, cue);
        }
        room
    }

    /// Takes the cue at this place away, if there is one.
    pub fn remove(&mut self, place: usize) {
        if place < self.cues.len() {
            self.cues.remove(place);
        }
    }

    /// The cues of the moments after `from_s`, up to `to_s`.
    pub fn due(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &TimedCue> {
        self.cues.iter().filter(move |cue| (from_s < cue.time_s()) && (cue.time_s() <= to_s))
    }
}
