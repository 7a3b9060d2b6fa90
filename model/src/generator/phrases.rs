//! Where phrases of the music begin: every fourth bar, in step with its sections.
//!
//! A section is heard once the first beat of its first bar has passed, and sections begin
//! four bars apart, or eight: where bars began otherwise than those before them, the next ones
//! are expected. Causal, and allocates nothing.

use servodance_types::{Beat, BeatLock, MusicFrame};

const PHRASE_BARS: usize = 4;
/// Bars that are longer than this make phrases of half as many, frames.
const LONG_BAR_FRAMES: u32 = 70;
/// Bars that are shorter or longer are no figure of a dance, frames.
const REPEATED_FRAMES: std::ops::RangeInclusive<u32> = 20..=100;
/// Beats of a bar where the music does not show any.
const BEATS_IN_BAR: u8 = 4;
/// Features that tell sections apart (onset strength, level, the next five MFCC) and how much
/// each counts.
const WEIGHTS: [f32; 7] = [3.0, 4.0, 1.5, 1.5, 1.5, 1.5, 1.5];
/// Place of the level among them.
const LEVEL: usize = 1;
const LEVEL_UNIT_DB: f32 = 20.0;
/// No music has features beyond this.
const MOST_FEATURE: f32 = 100.0;
/// A bar whose first beat is so much further from those before it than usual tells where
/// phrases begin,
const NOVEL_RATIO: f32 = 1.5;
/// and begins one if it is so much further;
const SECTION_RATIO: f32 = 2.0;
/// one that is no further than this does not.
const LEAST_DISTANCE: f32 = 0.4;
/// The most that one bar tells, in usual distances.
const MOST_EVIDENCE: f32 = 3.0;
/// What is left of that after another bar.
const KEPT_EVIDENCE: f32 = 0.98;
/// The first bar of the music begins a phrase unless more than this tells otherwise.
const FIRST_BAR_EVIDENCE: f32 = 0.5;
/// Phrases begin elsewhere once that is so much surer.
const SURER: f32 = 0.3;
/// Share of the newest bar in the bars before, and of its distance in the usual one.
const BEFORE_SHARE: f32 = 0.5;
const USUAL_SHARE: f32 = 0.15;
/// Differences of level below this are none: 5 dB.
const LEAST_RANGE: f32 = 0.25;
/// How loud bars are where all are as loud.
const EVEN: f32 = 0.75;

/// Follows the bars of one song.
#[derive(Clone, Debug, Default)]
pub(super) struct Phrases {
    /// Frames since the music began, and since the last bar did.
    frames: u32,
    bar_frames: u32,
    last_bar_frames: u32,
    /// Number of the bar that is being heard, once one began.
    bar: Option<usize>,
    /// Bars since a phrase began.
    bars_danced: usize,
    /// Where among four bars phrases begin, and what tells of each place.
    first: usize,
    evidence: [f32; PHRASE_BARS],
    /// Beats of a bar that is not known.
    beats: u8,
    last: Beat,
    first_beat: Option<FirstBeat>,
    novelty: BarNovelty,
    level: f32,
    loudness: BarLoudness,
}

/// Features of a bar until its second beat.
#[derive(Clone, Copy, Debug, Default)]
struct FirstBeat {
    sum: [f32; WEIGHTS.len()],
    frames: u32,
}

impl Phrases {
    /// Takes in a frame; whether a phrase begins with it.
    pub fn observe(&mut self, music: &MusicFrame) -> bool {
        self.frames += 1;
        self.bar_frames += 1;
        let [is_beat, is_bar] = self.beat_and_bar(music.beat);
        let heard = if is_beat && !is_bar { self.first_beat.take() } else { None };
        let begins = match heard {
            Some(beat) => self.is_section(beat),
            None => is_bar && self.begin_bar(music.beat),
        };
        if let Some(features) = features(music) {
            self.level = features[LEVEL];
            self.loudness.push(self.level);
            if let Some(beat) = &mut self.first_beat {
                beat.push(&features);
            }
        }
        if begins {
            self.bars_danced = 0;
        }
        begins
    }

    /// How loud the last bar was among all, 0 to 1.
    pub fn loudness(&self) -> f32 {
        self.loudness.among_all()
    }

    /// Frames of the bar before, if that was of this phrase and can be danced again.
    pub fn bar_to_repeat(&self) -> Option<usize> {
        (self.bars_danced > 0 && REPEATED_FRAMES.contains(&self.last_bar_frames))
            .then_some(self.last_bar_frames as usize)
    }

    /// The level of the music that was heard last, decibels above -40 dB of its loudest.
    pub fn level_db(&self) -> f32 {
        self.level * LEVEL_UNIT_DB
    }

    /// Whether a phrase begins with a bar.
    fn begin_bar(&mut self, beat: Beat) -> bool {
        let bar = match self.bar {
            Some(bar) => bar + 1,
            None => self.bars_before(beat),
        };
        self.bar = Some(bar);
        self.bars_danced += 1;
        self.loudness.finish_bar();
        self.first_beat = Some(FirstBeat::default());
        self.last_bar_frames = std::mem::take(&mut self.bar_frames);
        let is_long = self.last_bar_frames > LONG_BAR_FRAMES;
        let bars = if is_long { PHRASE_BARS / 2 } else { PHRASE_BARS };
        bar % bars == self.first % bars
    }

    /// Whether the bar whose first beat was heard begins a section, and no phrase yet.
    fn is_section(&mut self, beat: FirstBeat) -> bool {
        let Some(bar) = self.bar.filter(|_| beat.frames > 0) else {
            return false;
        };
        let novelty = self.novelty.of(beat.mean());
        self.evidence.iter_mut().for_each(|evidence| *evidence *= KEPT_EVIDENCE);
        let place = bar % PHRASE_BARS;
        self.evidence[place] += (novelty - NOVEL_RATIO).clamp(0.0, MOST_EVIDENCE);
        let sure = |place: &usize| self.evidence[*place];
        let best = (0..PHRASE_BARS).max_by(|a, b| sure(a).total_cmp(&sure(b))).unwrap_or_default();
        if sure(&best) > sure(&self.first) + SURER {
            self.first = best;
        }
        novelty > SECTION_RATIO && self.bars_danced > 0
    }

    /// Bars before the first one that is heard as such, counted back to where the music began.
    fn bars_before(&mut self, beat: Beat) -> usize {
        self.evidence[0] = FIRST_BAR_EVIDENCE;
        let beats = f32::from(beat.beats_in_bar.unwrap_or(BEATS_IN_BAR));
        let frames = beats * 1200.0 / beat.tempo_bpm.max(30.0);
        (self.frames as f32 / frames).round() as usize
    }

    /// Whether a beat begins, and whether a bar does.
    fn beat_and_bar(&mut self, beat: Beat) -> [bool; 2] {
        let last = std::mem::replace(&mut self.last, beat);
        let is_heard = beat.lock != BeatLock::Lost;
        let is_beat = is_heard && beat.phase < last.phase - 0.5;
        let is_bar = match beat.beat_in_bar {
            Some(place) => {
                self.beats = 0;
                is_heard && place == 0 && last.beat_in_bar != Some(0)
            }
            None => {
                self.beats = (self.beats + u8::from(is_beat)) % BEATS_IN_BAR;
                is_beat && self.beats == 0
            }
        };
        [is_beat, is_bar]
    }
}

/// What tells sections apart in a frame, if that is finite.
fn features(music: &MusicFrame) -> Option<[f32; WEIGHTS.len()]> {
    let features: &[f32; WEIGHTS.len()] = music.spectral.first_chunk()?;
    let is_finite = features.iter().all(|value| value.is_finite());
    is_finite.then(|| features.map(|value| value.clamp(-MOST_FEATURE, MOST_FEATURE)))
}

impl FirstBeat {
    fn push(&mut self, features: &[f32]) {
        for (sum, value) in self.sum.iter_mut().zip(features) {
            *sum += value;
        }
        self.frames += 1;
    }

    fn mean(&self) -> [f32; WEIGHTS.len()] {
        self.sum.map(|sum| sum / self.frames as f32)
    }
}

/// How different the beginnings of bars are.
#[derive(Clone, Copy, Debug, Default)]
struct BarNovelty {
    before: Option<[f32; WEIGHTS.len()]>,
    usual: Option<f32>,
}

impl BarNovelty {
    /// How much further a bar is from those before it than usual; 0 where it is near them.
    fn of(&mut self, bar: [f32; WEIGHTS.len()]) -> f32 {
        let before = self.before.get_or_insert(bar);
        let off = |i: usize| WEIGHTS[i] * (bar[i] - before[i]);
        let distance = (0..WEIGHTS.len()).map(|i| off(i).powi(2)).sum::<f32>().sqrt();
        for (before, now) in before.iter_mut().zip(bar) {
            *before += (now - *before) * BEFORE_SHARE;
        }
        if distance == 0.0 {
            return 0.0;
        }
        let usual = *self.usual.get_or_insert(distance);
        self.usual = Some(usual + (distance - usual) * USUAL_SHARE);
        if distance > LEAST_DISTANCE { distance / usual } else { 0.0 }
    }
}

/// How loud bars are.
#[derive(Clone, Copy, Debug, Default)]
struct BarLoudness {
    sum: f32,
    frames: u32,
    last: f32,
    range: Option<[f32; 2]>,
}

impl BarLoudness {
    fn push(&mut self, level: f32) {
        self.sum += level;
        self.frames += 1;
    }

    fn finish_bar(&mut self) {
        self.last = std::mem::take(&mut self.sum) / std::mem::take(&mut self.frames).max(1) as f32;
        let [quiet, loud] = self.range.unwrap_or([self.last; 2]);
        self.range = Some([quiet.min(self.last), loud.max(self.last)]);
    }

    fn among_all(&self) -> f32 {
        match self.range {
            Some([quiet, loud]) if loud - quiet > LEAST_RANGE => {
                (self.last - quiet) / (loud - quiet)
            }
            _ => EVEN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bars of 40 frames at which phrases begin (in beats, four a bar); `level` by bar; the
    /// first `unheard` bars are heard without their beats.
    fn begins(level: &[f32], unheard: usize) -> Vec<usize> {
        let mut phrases = Phrases::default();
        let mut begins = Vec::new();
        for frame in 0..40 * level.len() {
            let (bar, at) = (frame / 40, frame % 40);
            let beat = Beat {
                phase: (at % 10) as f32 / 10.0,
                tempo_bpm: 120.0,
                lock: if bar < unheard { BeatLock::Lost } else { BeatLock::Locked },
                beat_in_bar: Some((at / 10) as u8),
                beats_in_bar: Some(4),
                ..Beat::default()
            };
            let mut music = MusicFrame { beat, ..MusicFrame::default() };
            // Bars that are all alike but for a little.
            music.spectral[LEVEL] = level[bar] + 0.01 * (bar % 2) as f32;
            if phrases.observe(&music) {
                begins.push(frame / 10);
            }
        }
        begins
    }

    #[test]
    fn phrases_have_four_bars_from_the_beginning_of_the_music() {
        assert_eq!(begins(&[0.0; 14], 1), [16, 32, 48]);
        assert_eq!(begins(&[0.0; 14], 3), [16, 32, 48]);
    }

    #[test]
    fn a_section_begins_a_phrase_after_its_first_beat() {
        let mut level = [0.0; 12];
        level[6..].fill(0.5);
        assert!(begins(&level, 0).contains(&(6 * 4 + 1)), "{:?}", begins(&level, 0));
    }

    #[test]
    fn phrases_are_expected_where_sections_were() {
        // Sections of eight bars that begin with the third bar.
        let level: Vec<f32> = (0..36).map(|bar| f32::from((bar + 6) / 8 % 2 == 0)).collect();
        let begins = begins(&level, 0);
        assert!([18, 22, 26, 30, 34].iter().all(|bar| begins.contains(&(bar * 4))), "{begins:?}");
    }

    #[test]
    fn a_bar_is_danced_again_within_its_phrase() {
        let mut phrases = Phrases { bars_danced: 1, last_bar_frames: 40, ..Phrases::default() };
        assert_eq!(phrases.bar_to_repeat(), Some(40));
        phrases.bars_danced = 0;
        assert_eq!(phrases.bar_to_repeat(), None);
    }

    #[test]
    fn one_bar_beyond_any_music_leaves_levels_and_distances_finite() {
        let mut phrases = Phrases::default();
        for level in [0.0, f32::MAX, 0.0, 0.5] {
            for beat_in_bar in 0..4 {
                let beat = Beat {
                    lock: BeatLock::Locked,
                    beat_in_bar: Some(beat_in_bar),
                    phase: 1.0,
                    ..Beat::default()
                };
                let mut music = MusicFrame { beat, ..MusicFrame::default() };
                music.spectral[..WEIGHTS.len()].fill(level);
                phrases.observe(&music);
                music.beat.phase = 0.0;
                phrases.observe(&music);
            }
        }
        let told = [phrases.level_db(), phrases.loudness(), phrases.novelty.usual.unwrap()];
        assert!(told.iter().all(|v| v.is_finite()), "{told:?}");
        assert!(phrases.evidence.iter().all(|v| v.is_finite()), "{:?}", phrases.evidence);
    }

    #[test]
    fn features_that_are_not_finite_are_left_out() {
        let mut phrases = Phrases { level: -0.5, ..Phrases::default() };
        let mut music = MusicFrame::default();
        music.spectral[2] = f32::NAN;
        phrases.observe(&music);
        assert_eq!(phrases.level_db(), -10.0);
    }
}
