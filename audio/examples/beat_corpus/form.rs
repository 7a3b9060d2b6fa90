//! The form of a piece: sections, who plays in them, and how.

use std::ops::Range;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::style::{DrumLine, Style};

/// How one kind of section (verse, chorus) is played.
#[derive(Clone)]
pub struct Scene {
    pub drums: Vec<DrumLine>,
    /// Beats of the drummer's pattern for one of the band: 2 is half-time feel.
    pub feel: f64,
    /// Index of the bass part and its pattern.
    pub bass: Option<(usize, usize)>,
    /// Pattern of each accompanying part, if it plays.
    pub comps: Vec<Option<usize>>,
    pub lead: bool,
    pub phrase: usize,
    pub harmony: usize,
}

pub struct Section {
    pub bars: Range<usize>,
    pub scene: Scene,
    pub fill: bool,
    pub crash: bool,
}

/// The sections of so many bars.
pub fn draw(style: &Style, bars: usize, bar_s: f64, rng: &mut ChaCha8Rng) -> Vec<Section> {
    let drummer = rng.random_bool(0.93);
    let verse = scene(style, drummer, 0, rng);
    let chorus = scene(style, drummer, 1, rng);
    let length = [4, 4, 8, 8, 6][rng.random_range(0..5)];
    let mut sections = Vec::new();
    let mut first = 0;
    if rng.random_bool(0.35) {
        let intro = ((rng.random_range(3.0..35.0) / bar_s) as usize).max(1);
        let scene = intro_scene(&verse, rng);
        sections.push(Section { bars: 0..intro, scene, fill: rng.random_bool(0.4), crash: false });
        first = intro;
    }
    while first < bars {
        let mut scene = if rng.random_bool(0.6) { verse.clone() } else { chorus.clone() };
        if first > 0 {
            vary(&mut scene, rng);
        }
        let bars = first..first + length;
        let (fill, crash) = (rng.random_bool(0.5), rng.random_bool(0.5));
        sections.push(Section { bars, scene, fill, crash });
        first += length;
    }
    sections
}

fn scene(style: &Style, drummer: bool, index: usize, rng: &mut ChaCha8Rng) -> Scene {
    let mut drums = match style.drums.len() {
        0 if style.name.starts_with("chance") => chance_drums(style.beats, rng),
        0 => Vec::new(),
        count => style.drums[rng.random_range(0..count)].clone(),
    };
    drums.retain(|(voice, _)| rng.random_bool(if "KS".contains(*voice) { 0.96 } else { 0.85 }));
    if !drummer {
        drums.clear();
    }
    let bass = (!style.bass.is_empty() && rng.random_bool(0.92)).then(|| {
        let part = rng.random_range(0..style.bass.len());
        (part, rng.random_range(0..style.bass[part].patterns.len()))
    });
    let mut comps: Vec<Option<usize>> = style
        .comps
        .iter()
        .map(|part| rng.random_bool(0.6).then(|| rng.random_range(0..part.patterns.len())))
        .collect();
    if drums.is_empty() && comps.iter().all(Option::is_none) {
        comps.iter_mut().for_each(|c| *c = Some(0));
    }
    let lead = rng.random_bool(0.65) || (drums.is_empty() && bass.is_none());
    Scene { drums, feel: 1.0, bass, comps, lead, phrase: index, harmony: index }
}

/// A beginning without drums: one or two instruments.
fn intro_scene(verse: &Scene, rng: &mut ChaCha8Rng) -> Scene {
    let mut scene = verse.clone();
    if rng.random_bool(0.8) {
        scene.drums.clear();
    } else {
        scene.drums.truncate(1);
    }
    if rng.random_bool(0.5) {
        scene.bass = None;
    }
    if scene.comps.iter().all(Option::is_none) {
        scene.comps.iter_mut().take(1).for_each(|c| *c = Some(0));
    }
    scene.lead = rng.random_bool(0.5) || scene.comps.is_empty();
    scene
}

/// Breaks, thinner and differently felt repetitions.
fn vary(scene: &mut Scene, rng: &mut ChaCha8Rng) {
    if rng.random_bool(0.12) {
        scene.drums.clear();
    }
    if rng.random_bool(0.1) {
        scene.bass = None;
    }
    if rng.random_bool(0.06) {
        scene.comps.iter_mut().for_each(|c| *c = None);
    }
    scene.lead ^= rng.random_bool(0.25);
    scene.feel = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 0.5]
        [rng.random_range(0..14)];
}

/// A drummer who follows no pattern that is written down: how likely a stroke is
/// depends on how strong its place in the bar is.
fn chance_drums(beats: usize, rng: &mut ChaCha8Rng) -> Vec<DrumLine> {
    let steps = 4 * beats;
    let busy = rng.random_range(0.05..0.35);
    let backbeat = rng.random_bool(0.8);
    let mut line = |chance: &dyn Fn(usize) -> f64| -> Vec<u8> {
        let stroke = |step| match rng.random_bool(chance(step)) {
            true => b'x',
            false => b'.',
        };
        (0..steps).map(stroke).collect()
    };
    let kick = line(&|step| match step {
        0 => 0.95,
        8 => 0.6,
        s if s % 4 == 0 => 0.25,
        s if s % 2 == 0 => busy,
        _ => 0.4 * busy,
    });
    let snare = line(&|step| match (step / 4 % 2 == 1) == backbeat {
        true if step % 4 == 0 => 0.93,
        _ if step % 4 == 0 => 0.08,
        _ => 0.25 * busy,
    });
    let hat_every = [1, 2, 2, 4][rng.random_range(0..4)];
    let hats = (0..steps).map(|s| if s % hat_every == 0 { b'x' } else { b'.' }).collect();
    let hat = ['H', 'H', 'R', 'O', 'D', 'C'][rng.random_range(0..6)];
    vec![('K', kick), ('S', snare), (hat, hats)]
}
