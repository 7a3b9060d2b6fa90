//! The same seed under its own music and under others.

use super::known_song::{KnownSong, WARM_UP_S};
use crate::evaluate::figures::beat_alignment;
use crate::evaluate::reference::SilentMusic;
use serde::Serialize;
use servodance_model::conditioning::{Encodec, HeardFrame};
use servodance_model::motion::Clip;
use servodance_model::{Generator, GeneratorOptions};
use servodance_types::FRAME_RATE_HZ;

/// A figure of the dance to its own music, and of the same seed's dances to what it is not.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct ByMusic {
    /// Its own music.
    pub own: f64,
    /// The song of the nearest tempo, played as fast.
    pub same_tempo: f64,
    /// The song of the most different tempo.
    pub other_tempo: f64,
    /// Its own music half a beat early.
    pub shifted: f64,
    /// Silence.
    pub silent: f64,
}

impl ByMusic {
    pub fn controls(&self) -> [f64; 4] {
        [self.same_tempo, self.other_tempo, self.shifted, self.silent]
    }

    /// Whether its own music is above all controls but the song of the same tempo, which has
    /// the same beats where both songs begin with one.
    pub fn beats_other_beats(&self) -> bool {
        [self.other_tempo, self.shifted, self.silent].iter().all(|control| self.own > *control)
    }

    /// Each figure averaged over dances.
    pub fn mean(all: &[Self]) -> Self {
        let over = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len().max(1) as f64;
        Self {
            own: over(|v| v.own),
            same_tempo: over(|v| v.same_tempo),
            other_tempo: over(|v| v.other_tempo),
            shifted: over(|v| v.shifted),
            silent: over(|v| v.silent),
        }
    }

    /// The share of dances that beat each control, and all of them in `own`.
    pub fn wins(all: &[Self]) -> Self {
        let beats = |of: fn(&Self) -> f64| move |v: &Self| f64::from(u8::from(v.own > of(v)));
        let won: Vec<Self> = all
            .iter()
            .map(|v| Self {
                own: f64::from(u8::from(v.controls().iter().all(|control| v.own > *control))),
                same_tempo: beats(|v| v.same_tempo)(v),
                other_tempo: beats(|v| v.other_tempo)(v),
                shifted: beats(|v| v.shifted)(v),
                silent: beats(|v| v.silent)(v),
            })
            .collect();
        Self::mean(&won)
    }
}

/// What the dances of one song hear.
pub struct ControlMusic {
    same_tempo: Vec<HeardFrame>,
    other_tempo: Vec<HeardFrame>,
    shifted: Vec<HeardFrame>,
    silent: Vec<HeardFrame>,
}

impl ControlMusic {
    /// For one of at least two songs.
    pub fn of(songs: &[KnownSong], at: usize, encodec: Option<&Encodec>) -> anyhow::Result<Self> {
        let song = &songs[at];
        let octaves = |i: usize| (song.tempo_bpm / songs[i].tempo_bpm).log2();
        let others = || (0..songs.len()).filter(|i| *i != at);
        let near = |i: usize| octaves(i).abs();
        // Twice or half the tempo has the same beats.
        let far = |i: usize| (octaves(i) - octaves(i).round()).abs();
        let nearest = others().min_by(|a, b| near(*a).total_cmp(&near(*b))).unwrap_or(at);
        let furthest = others().max_by(|a, b| far(*a).total_cmp(&far(*b))).unwrap_or(at);
        let hear = |of: usize, late_s: f64, faster: f64| {
            songs[of].hear(late_s, faster, song.frames, encodec)
        };
        Ok(Self {
            same_tempo: hear(nearest, 0.0, song.tempo_bpm / songs[nearest].tempo_bpm)?,
            other_tempo: hear(furthest, 0.0, 1.0)?,
            shifted: hear(at, song.half_beat_s(), 1.0)?,
            silent: SilentMusic::new(encodec, song.frames)?.in_place_of(&song.heard),
        })
    }
}

/// The dance of a seed to its own music, behind the warm-up, and the F1 of it and of its
/// controls against the song's beats and against those that the tracker found.
pub fn dance_with_controls(
    generator: &Generator,
    options: &GeneratorOptions,
    song: &KnownSong,
    controls: &ControlMusic,
) -> anyhow::Result<(Clip, [ByMusic; 2])> {
    let own = dance(generator, options, &song.heard)?;
    let same_tempo = dance(generator, options, &controls.same_tempo)?;
    let other_tempo = dance(generator, options, &controls.other_tempo)?;
    let shifted = dance(generator, options, &controls.shifted)?;
    let silent = dance(generator, options, &controls.silent)?;
    let f1 = |beats_s: &[f64]| {
        let of = |clip: &Clip| beat_alignment(&clip.poses, beats_s).f1;
        ByMusic {
            own: of(&own),
            same_tempo: of(&same_tempo),
            other_tempo: of(&other_tempo),
            shifted: of(&shifted),
            silent: of(&silent),
        }
    };
    let scores = [f1(&song.beats_s), f1(&song.found_s)];
    Ok((own, scores))
}

/// A dance to what is heard, without the warm-up.
pub fn dance(
    generator: &Generator,
    options: &GeneratorOptions,
    music: &[HeardFrame],
) -> anyhow::Result<Clip> {
    let mut dance = generator.start(options.clone())?;
    let mut poses = Vec::with_capacity(music.len());
    for heard in music {
        poses.push(dance.step_heard(heard)?.positions);
    }
    poses.drain(..((WARM_UP_S * FRAME_RATE_HZ) as usize).min(poses.len()));
    Ok(Clip::of_frames(poses))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_win_is_counted_for_each_control() {
        let of = |own, same_tempo| ByMusic {
            own,
            same_tempo,
            other_tempo: 0.1,
            shifted: 0.2,
            silent: 0.3,
        };
        let wins = ByMusic::wins(&[of(0.8, 0.5), of(0.4, 0.5), of(0.25, 0.0), of(0.9, 0.0)]);
        let shares = [wins.own, wins.same_tempo, wins.other_tempo, wins.shifted, wins.silent];
        assert_eq!(shares, [0.5, 0.75, 1.0, 1.0, 0.75]);
        let beats = [of(0.4, 0.5), of(0.25, 0.0)].map(|dance| dance.beats_other_beats());
        assert_eq!(beats, [true, false]);
    }
}
