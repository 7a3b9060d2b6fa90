//! Dances of figures, from a choreography that stands in for captured dance.

use super::*;
use crate::choreography::{DanceBeat, DanceStyle, choreograph};
use crate::dataset::captured::EMPHASIS;
use crate::metrics::quality::foot_skate_ratio;
use phrase::Step;
use servodance_model::motion::{Clip, alignment, mean_joint_speed};

fn library() -> FigureLibrary {
    let folder = tempfile::tempdir().unwrap();
    let mut index = String::from("clip,source,minutes,dance,label\n");
    for (number, style) in [DanceStyle::Groove, DanceStyle::Disco].into_iter().enumerate() {
        let beats: Vec<DanceBeat> = (0..80)
            .map(|beat| DanceBeat { time_s: 0.5 * f64::from(beat), downbeat: beat % 4 == 0 })
            .collect();
        let clip = choreograph(&beats, 40.0, style, number as u64);
        clip.write_npz(folder.path().join(format!("dance{number}.npz"))).unwrap();
        index.push_str(&format!("dance{number},home,0.66,yes,dance\n"));
    }
    std::fs::write(folder.path().join("index.csv"), index).unwrap();
    let mut entries = index::read(folder.path()).unwrap();
    entries.iter_mut().for_each(|entry| entry.split = Split::Train);
    FigureLibrary::cut(folder.path(), &entries, Split::Train)
}

fn planned(library: &FigureLibrary, seed: u64) -> (SongForm, Vec<Step>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let style = library.styles()[0];
    let form = SongForm::random("test", 40.0, 0.5, &mut rng).unwrap();
    let steps = plan(library, style, &form, &mut rng);
    (form, steps)
}

#[test]
fn figures_have_two_four_and_eight_beats_and_a_mirror() {
    let library = library();
    for beats in [2, 4, 8] {
        assert!(library.figures.iter().any(|figure| figure.beats() == beats), "{beats}");
    }
    for (at, figure) in library.figures.iter().enumerate() {
        let mirrored = &library.figures[figure.mirrored];
        assert_eq!(mirrored.mirrored, at);
        assert_eq!(mirrored.beats_s, figure.beats_s);
    }
}

#[test]
fn a_plan_is_danced_without_a_gap_and_changes_with_the_sections() {
    let library = library();
    let (mut sections, mut changed) = (0, 0);
    for seed in 0..4 {
        let (form, steps) = planned(&library, seed);
        for pair in steps.windows(2) {
            assert_eq!(pair[0].beat + pair[0].beats, pair[1].beat, "{pair:?}");
        }
        for bar in form.bars.iter().filter(|bar| bar.is_break) {
            let step =
                steps.iter().find(|step| step.beat == bar.beat).expect("a step of the break");
            assert_eq!(step.figure, None);
        }
        for bar in form.bars.iter().skip(1).filter(|bar| bar.begins_section && !bar.is_break) {
            let now = steps.iter().position(|step| step.beat == bar.beat);
            let now = now.expect("a section begins with a step");
            sections += 1;
            changed += usize::from(steps[now].figure != steps[now - 1].figure);
        }
    }
    assert!(sections > 4 && 10 * changed >= 9 * sections, "{changed} of {sections}");
}

#[test]
fn joined_figures_dance_on_the_beat_without_jumps_on_their_feet() {
    let library = library();
    let (form, steps) = planned(&library, 3);
    let poses = JoinedMotion::of(&library, &steps, &form, 700).poses();
    assert_eq!(poses.len(), 700);
    let speed = mean_joint_speed(&poses, FRAME_RATE_HZ);
    // Choreography stays below 3 m/s; who lingers on the beats hurries between them.
    let fastest = 3.0 * (1.0 + EMPHASIS);
    assert!(speed.iter().all(|v| *v < fastest), "{:?}", speed.iter().copied().fold(0.0, f64::max));
    let beats: Vec<f64> = form.audible_beats_s();
    let score = alignment(&speed, FRAME_RATE_HZ, &beats);
    assert!(score.f1 > 0.8, "{score:?}");
    let skate = foot_skate_ratio(&Clip::of_frames(poses)).unwrap();
    assert!(skate < 0.1, "{skate}");
}
