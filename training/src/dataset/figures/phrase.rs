//! Which figure is danced when: phrases of four bars that repeat and answer themselves.

use super::figure::{Figure, FigureLibrary};
use super::song_form::{Bar, SongForm};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

const PHRASE_BARS: usize = 4;
const BEATS_IN_BAR: usize = 4;
/// Figures that are looked at for each place, and how many of the best are drawn from.
const LOOKED_AT: usize = 48;
const DRAWN_FROM: usize = 4;
/// Figures may be danced so much slower or faster.
const STRETCH: (f64, f64) = (0.8, 1.25);
/// What a figure of the wrong liveliness is worth, metres a joint for the whole range.
const LIVELINESS_M: f64 = 0.25;
/// So likely the upper body dances another figure than the legs.
const TWO_FIGURES: f64 = 0.2;
/// How much larger loud bars are danced than soft ones.
const SIZES: (f64, f64) = (0.82, 1.15);

/// What is danced from one beat of the song on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// First beat, and how many.
    pub beat: usize,
    pub beats: usize,
    /// A figure of the library; `None`: the dancer holds still.
    pub figure: Option<usize>,
    /// A figure of as many beats for the upper body.
    pub upper: Option<usize>,
    /// Size of the upper body's movement.
    pub size: f64,
}

/// A dance to a song in one style.
pub fn plan(
    library: &FigureLibrary,
    style: usize,
    form: &SongForm,
    rng: &mut ChaCha8Rng,
) -> Vec<Step> {
    let mut planner = Planner { library, style, last: None, rng };
    let mut steps = Vec::new();
    let mut motif: Vec<usize> = Vec::new();
    let mut from = 0;
    while from < form.bars.len() {
        let phrase = phrase_at(&form.bars, from);
        // Another section is another motif; within one every second phrase answers.
        if phrase[0].begins_section || motif.is_empty() || planner.rng.random_bool(0.35) {
            motif = planner.motif(&form.song.beats_s, phrase);
        } else {
            motif = planner.answer(&motif);
        }
        planner.dance(&form.song.beats_s, phrase, &motif, &mut steps);
        from += phrase.len();
    }
    steps
}

/// Bars up to the next section, four at most.
fn phrase_at(bars: &[Bar], from: usize) -> &[Bar] {
    let later = (from + 1..bars.len()).find(|bar| bars[*bar].begins_section);
    let end = later.unwrap_or(bars.len()).min(from + PHRASE_BARS);
    &bars[from..end]
}

struct Planner<'a> {
    library: &'a FigureLibrary,
    style: usize,
    /// The figure that was danced last.
    last: Option<usize>,
    rng: &'a mut ChaCha8Rng,
}

impl Planner<'_> {
    /// Figures for a phrase of eight beats: one of eight, or two of four, or with twos.
    fn motif(&mut self, beats_s: &[f64], phrase: &[Bar]) -> Vec<usize> {
        let loudness = phrase.iter().map(|bar| bar.loudness).sum::<f64>() / phrase.len() as f64;
        let beat = phrase[0].beat;
        let period_s = beats_s[beat + 1] - beats_s[beat];
        let lengths: &[usize] = match self.rng.random_range(0..4) {
            0 => &[8],
            1 => &[4, 2, 2],
            _ => &[4, 4],
        };
        let mut motif = Vec::new();
        for &beats in lengths {
            if let Some(figure) = self.choose(beats, period_s, loudness) {
                self.last = Some(figure);
                motif.push(figure);
            }
        }
        motif
    }

    /// The same motif, or in the mirror.
    fn answer(&mut self, motif: &[usize]) -> Vec<usize> {
        let mirror = self.rng.random_bool(0.6);
        let side = |figure: &usize| match mirror {
            true => self.library.figures[*figure].mirrored,
            false => *figure,
        };
        motif.iter().map(side).collect()
    }

    /// One of the figures that go on best from the last one and are as lively as the music.
    fn choose(&mut self, beats: usize, period_s: f64, loudness: f64) -> Option<usize> {
        let figures = &self.library.figures;
        let stretch = |figure: &Figure| period_s / figure.period_s();
        let fits = |at: &usize| {
            let figure = &figures[*at];
            figure.style == self.style
                && figure.beats() == beats
                && (STRETCH.0..STRETCH.1).contains(&stretch(figure))
        };
        let mut known: Vec<usize> = (0..figures.len()).filter(fits).collect();
        if known.is_empty() {
            known = (0..figures.len()).filter(|at| figures[*at].beats() == beats).collect();
        }
        known.sort_by(|a, b| figures[*a].speed_m_s.total_cmp(&figures[*b].speed_m_s));
        let rank = |place: usize| place as f64 / known.len().max(2) as f64;
        let mut looked_at: Vec<(f64, usize)> = Vec::with_capacity(LOOKED_AT);
        for _ in 0..LOOKED_AT.min(4 * known.len()) {
            let place = self.rng.random_range(0..known.len());
            let join = self
                .last
                .map_or(0.0, |last| figures[last].exit.distance_m(&figures[known[place]].entry));
            let again = if self.last == Some(known[place]) { 0.1 } else { 0.0 };
            let cost = join + again + LIVELINESS_M * (rank(place) - loudness).abs();
            looked_at.push((cost, known[place]));
        }
        looked_at.sort_by(|a, b| a.0.total_cmp(&b.0));
        looked_at.dedup_by_key(|(_, figure)| *figure);
        let best = looked_at.len().min(DRAWN_FROM);
        (best > 0).then(|| looked_at[self.rng.random_range(0..best)].1)
    }

    /// The motif over and over through the bars of a phrase; still in breaks.
    fn dance(&mut self, beats_s: &[f64], phrase: &[Bar], motif: &[usize], steps: &mut Vec<Step>) {
        let mut turn = 0;
        let mut bar = 0;
        while bar < phrase.len() {
            let Bar { beat, loudness, is_break, .. } = phrase[bar];
            if is_break || motif.is_empty() {
                let hold = Step { beat, beats: BEATS_IN_BAR, figure: None, upper: None, size: 1.0 };
                steps.push(hold);
                bar += 1;
                continue;
            }
            let size = SIZES.0 + (SIZES.1 - SIZES.0) * loudness;
            let mut danced = 0;
            // Whole bars, so that a break or a section begins with a bar.
            let room = phrase[bar..].iter().take_while(|bar| !bar.is_break).count() * BEATS_IN_BAR;
            while danced < room.min(2 * BEATS_IN_BAR) {
                let figure = motif[turn % motif.len()];
                let beats = self.library.figures[figure].beats().min(room - danced);
                let upper = self.upper(figure, beats_s[beat + 1] - beats_s[beat], loudness);
                let figure = Some(figure);
                steps.push(Step { beat: beat + danced, beats, figure, upper, size });
                self.last = figure;
                (danced, turn) = (danced + beats, turn + 1);
            }
            bar += danced.div_ceil(BEATS_IN_BAR);
        }
    }

    fn upper(&mut self, figure: usize, period_s: f64, loudness: f64) -> Option<usize> {
        if !self.rng.random_bool(TWO_FIGURES) {
            return None;
        }
        let last = self.last;
        let upper = self.choose(self.library.figures[figure].beats(), period_s, loudness);
        self.last = last;
        upper
    }
}
