//! The medley: another style for each phrase of the music.
//!
//! Every second phrase is danced at home, the liveliest style, unless the music is quiet;
//! between them guests take turns. A phrase has four bars, or
//! begins anew where the music does: where a bar is further from those before it than
//! bars usually are from each other. Causal, and allocates nothing after it was made.

use servodance_types::{BeatLock, MusicFrame};

/// The name of the style that is another one for each phrase.
pub const MEDLEY: &str = "medley";
/// The style between the guests. All are learned from people nearly alone.
const HOME: &str = "salsa";
const GUESTS: [&str; 2] = ["pop", "street"];
/// Phrases are quiet whose last bar is softer, 0 to 1 between the quietest and the loudest.
const QUIET: f32 = 0.35;
const PHRASE_BARS: u32 = 4;
/// Bars that are longer than this make phrases of half as many, frames.
const LONG_BAR_FRAMES: u32 = 70;
/// Beats of a bar where the music does not show any.
const BEATS_IN_BAR: u32 = 4;
/// A bar begins a section that is so much further from the bars before it than usual.
const SECTION_RATIO: f32 = 1.6;
/// Bars that are nearer than this to those before are like them, in deviations of the
/// training music.
const SECTION_LEAST: f32 = 0.25;
/// A section is no shorter than this.
const SECTION_BARS: u32 = 2;
/// Share of the newest distance in the usual one.
const USUAL_SHARE: f32 = 0.2;
/// Differences of loudness below this are none, in deviations of the training music.
const LEAST_RANGE: f32 = 0.5;
/// How loud bars are where all are as loud.
const EVEN: f32 = 0.75;
/// Place of the first coefficient of the MFCC, the loudness, among the features.
const LOUDNESS: usize = 1;

/// Follows the bars of one dance.
#[derive(Clone, Debug, Default)]
pub(super) struct StyleByPhrase {
    home: usize,
    guests: Vec<usize>,
    /// Guests that have danced.
    turns: usize,
    is_away: bool,
    bars: BarMeans,
    /// Bars of this phrase, and beats of a bar that is not known.
    phrase_bars: u32,
    beats: u32,
    last_phase: f32,
    last_place: Option<u8>,
}

impl StyleByPhrase {
    /// `None` for weights that know no home or no guest; `width` features a frame.
    pub fn new(styles: &[String], width: usize) -> Option<Self> {
        let place = |name: &str| styles.iter().position(|style| style == name);
        let guests: Vec<usize> = GUESTS.into_iter().filter_map(place).collect();
        let home = place(HOME)?;
        Some(Self { home, guests, bars: BarMeans::new(width), ..Self::default() })
            .filter(|styles| !styles.guests.is_empty())
    }

    /// The style that a dance begins with.
    pub fn home(&self) -> usize {
        self.home
    }

    /// Forgets the music.
    pub fn reset(&mut self) {
        let Self { home, guests, mut bars, .. } = std::mem::take(self);
        bars.reset();
        *self = Self { home, guests, bars, ..Self::default() };
    }

    /// Takes in a frame and its normalised features; the style to go on in, where a phrase
    /// begins.
    pub fn observe(&mut self, music: &MusicFrame, features: &[f32]) -> Option<usize> {
        self.bars.push(features);
        if !self.is_bar(music) {
            return None;
        }
        let section = self.bars.finish(self.phrase_bars);
        self.phrase_bars += 1;
        let whole = match self.bars.last_frames > LONG_BAR_FRAMES {
            true => PHRASE_BARS / 2,
            false => PHRASE_BARS,
        };
        if section && self.phrase_bars > SECTION_BARS {
            // The bar that tells of the section was its first.
            self.phrase_bars = 1;
        } else if self.phrase_bars >= whole {
            self.phrase_bars = 0;
        } else {
            return None;
        }
        Some(self.next_style())
    }

    fn is_bar(&mut self, music: &MusicFrame) -> bool {
        let beat = music.beat;
        let is_beat = beat.lock != BeatLock::Lost && beat.phase < self.last_phase - 0.5;
        let place = beat.beat_in_bar;
        let is_first = place == Some(0) && self.last_place != Some(0);
        (self.last_phase, self.last_place) = (beat.phase, place);
        match place {
            Some(_) => {
                self.beats = 0;
                is_first && beat.lock != BeatLock::Lost
            }
            None => {
                self.beats = (self.beats + u32::from(is_beat)) % BEATS_IN_BAR;
                is_beat && self.beats == 0
            }
        }
    }

    fn next_style(&mut self) -> usize {
        self.is_away = !self.is_away || self.bars.loudness() < QUIET;
        if !self.is_away {
            return self.home;
        }
        self.turns += 1;
        self.guests[(self.turns - 1) % self.guests.len()]
    }
}

/// Mean features of bars: this one, and those of the phrase.
#[derive(Clone, Debug, Default)]
struct BarMeans {
    sum: Vec<f32>,
    frames: u32,
    last_frames: u32,
    phrase: Vec<f32>,
    usual: Option<f32>,
    loud: f32,
    range: Option<[f32; 2]>,
}

impl BarMeans {
    fn new(width: usize) -> Self {
        Self { sum: vec![0.0; width], phrase: vec![0.0; width], ..Self::default() }
    }

    fn reset(&mut self) {
        self.sum.fill(0.0);
        (self.frames, self.last_frames) = (0, 0);
        (self.usual, self.loud, self.range) = (None, 0.0, None);
    }

    fn push(&mut self, features: &[f32]) {
        for (sum, value) in self.sum.iter_mut().zip(features) {
            *sum += value;
        }
        self.frames += 1;
    }

    /// Ends a bar behind `before` others of its phrase; whether a section began with it.
    fn finish(&mut self, before: u32) -> bool {
        let frames = self.frames.max(1) as f32;
        self.sum.iter_mut().for_each(|sum| *sum /= frames);
        self.loud = self.sum.get(LOUDNESS).copied().unwrap_or(0.0);
        let [quiet, loud] = self.range.unwrap_or([self.loud; 2]);
        self.range = Some([quiet.min(self.loud), loud.max(self.loud)]);
        let squares = self.sum.iter().zip(&self.phrase).map(|(now, then)| (now - then).powi(2));
        let distance = (squares.sum::<f32>() / self.sum.len().max(1) as f32).sqrt();
        let share = 1.0 / (before + 1) as f32;
        for (mean, now) in self.phrase.iter_mut().zip(&self.sum) {
            *mean += (now - *mean) * share;
        }
        self.sum.fill(0.0);
        (self.last_frames, self.frames) = (self.frames, 0);
        if before == 0 {
            return false;
        }
        let usual = *self.usual.get_or_insert(distance);
        self.usual = Some(usual + (distance - usual) * USUAL_SHARE);
        distance > SECTION_LEAST.max(SECTION_RATIO * usual)
    }

    /// How loud the last bar was among all, 0 to 1.
    fn loudness(&self) -> f32 {
        match self.range {
            Some([quiet, loud]) if loud - quiet > LEAST_RANGE => {
                (self.loud - quiet) / (loud - quiet)
            }
            _ => EVEN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::Beat;

    const STYLES: [&str; 4] = ["salsa", "pop", "street", "groove"];

    fn styles() -> StyleByPhrase {
        StyleByPhrase::new(&STYLES.map(String::from), 4).expect("known styles")
    }

    /// Styles at the bars (of 40 frames) where they change; `loudness` by bar.
    fn danced(loudness: &[f32]) -> Vec<(usize, &'static str)> {
        let mut styles = styles();
        let mut changes = Vec::new();
        for frame in 0..40 * loudness.len() {
            let (bar, at) = (frame / 40, frame % 40);
            let beat = Beat {
                phase: (at % 10) as f32 / 10.0,
                lock: BeatLock::Locked,
                beat_in_bar: Some((at / 10) as u8),
                ..Beat::default()
            };
            let music = MusicFrame { beat, ..MusicFrame::default() };
            if let Some(style) = styles.observe(&music, &[0.0, loudness[bar], 0.0, 0.0]) {
                changes.push((bar, STYLES[style]));
            }
        }
        changes
    }

    #[test]
    fn every_second_phrase_is_danced_at_home() {
        let changes = danced(&[0.0; 16]);
        let names: Vec<&str> = changes.iter().map(|change| change.1).collect();
        assert_eq!(changes.iter().map(|change| change.0).collect::<Vec<_>>(), [3, 7, 11, 15]);
        assert_eq!(names, ["pop", "salsa", "street", "salsa"]);
    }

    #[test]
    fn quiet_music_is_danced_by_guests() {
        let mut loudness = [1.0; 24];
        loudness[9..20].fill(-1.0);
        let changes = danced(&loudness);
        let quiet = || changes.iter().filter(|change| (10..20).contains(&change.0));
        assert!(quiet().count() > 1 && quiet().all(|change| change.1 != "salsa"), "{changes:?}");
        assert!(changes.iter().any(|&(bar, name)| bar < 9 && name == "salsa"), "{changes:?}");
    }

    #[test]
    fn a_section_begins_a_phrase() {
        let mut loudness = [0.0, 0.1, 0.0, 0.1, 0.0, 0.1, 0.0, 0.1, 0.0, 0.1, 0.0, 0.1];
        loudness[6..].fill(3.0);
        let bars: Vec<usize> = danced(&loudness).iter().map(|change| change.0).collect();
        assert!(bars.contains(&7), "{bars:?}");
    }

    #[test]
    fn weights_without_these_styles_have_one_style() {
        assert!(StyleByPhrase::new(&["groove".to_owned()], 4).is_none());
        assert!(StyleByPhrase::new(&["salsa".to_owned(), "groove".to_owned()], 4).is_none());
    }
}
