//! Builds the training file: captured motion and choreography with music.

use super::error::DatasetError;
use super::options::{DatasetOptions, DatasetSummary};
use super::sources::SOURCES;
use super::styles::STYLES;
use super::training_file::{self, TrainingClip};
use super::{captured, figures, synthetic, tilted};
use servodance_model::conditioning::Encodec;

/// Builds the training file. A motion file that cannot be read is left out and
/// named in the summary; an unreadable index is an error. With `encodec` its latents of all
/// music are written as well. `on_progress` receives the share that is done.
pub fn build(
    options: &DatasetOptions,
    encodec: Option<&Encodec>,
    on_progress: &(dyn Fn(f64) + Sync),
) -> Result<DatasetSummary, DatasetError> {
    let mut summary = DatasetSummary::default();
    let mut clips = Vec::new();
    if let Some(folder) = &options.motion {
        let first = |share: f64| on_progress(0.4 * share);
        captured::collect(folder, options, encodec, &mut clips, &mut summary, &first)?;
        let second = |share: f64| on_progress(0.4 + 0.4 * share);
        figures::collect(folder, options, encodec, &mut clips, &second)?;
        tilted::collect(folder, options, &mut clips)?;
    }
    synthetic::collect(options, encodec, &mut clips, &|share| on_progress(0.8 + 0.2 * share))?;
    summary.clips = clips.len();
    for clip in &clips {
        *summary.minutes.entry(kind(clip)).or_default() += clip.motion.len() as f64 / 1200.0;
    }
    let mut recipe = serde_json::json!({
        "seed": options.seed,
        "songs_per_clip": options.songs,
        "figure_minutes": options.figures,
        "choreography_minutes": options.choreography,
        "music": "all music is synthetic, rendered on the beats of the motion",
        "sources": SOURCES.map(|(source, terms)| serde_json::json!({ "source": source, "terms": terms })),
        "summary": summary,
    });
    if options.tilted > 0.0 {
        recipe["tilted_minutes"] = options.tilted.into(); // files without it keep their bytes
    }
    training_file::write(&options.out, &clips, &recipe)?;
    Ok(summary)
}

fn kind(clip: &TrainingClip) -> String {
    let source =
        if clip.synthetic { "choreography" } else { clip.name.split('/').next().unwrap_or("") };
    let split = clip.split.name();
    let music = if clip.music.is_some() { "music" } else { "no music" };
    format!("{source} / {} / {split} / {music}", STYLES[clip.style])
}

#[cfg(test)]
mod tests {
    use super::super::FeatureArgs;
    use super::*;

    fn options(folder: &std::path::Path, name: &str) -> DatasetOptions {
        DatasetOptions {
            motion: None,
            out: folder.join(name),
            songs: 1,
            figures: 0.0,
            tilted: 0.0,
            choreography: 2.0,
            features: FeatureArgs::default(),
            seed: 3,
            quiet: true,
        }
    }

    #[test]
    fn choreography_alone_needs_no_data_and_is_the_same_every_time() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| options(folder.path(), name));
        let summary = build(&a, None, &|_| {}).unwrap();
        build(&b, None, &|_| {}).unwrap();
        assert_eq!(summary.clips, 2);
        assert!((summary.minutes.values().sum::<f64>() - 2.0).abs() < 0.01);
        let bytes = |options: &DatasetOptions| std::fs::read(&options.out).unwrap();
        assert!(bytes(&a) == bytes(&b), "two builds differ");
    }

    #[test]
    fn captured_motion_gets_music_on_its_beats_and_bad_files_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let index =
            "clip,source,minutes,dance,label\nswing,home,0.3,yes,swing\nbroken,home,1,yes,x\n";
        std::fs::write(path("index.csv"), index).unwrap();
        std::fs::write(path("broken.npz"), "no archive").unwrap();
        swing().write_npz(path("swing.npz")).unwrap();
        let options = DatasetOptions {
            motion: Some(folder.path().to_owned()),
            choreography: 0.0,
            ..options(folder.path(), "out")
        };
        let summary = build(&options, None, &|_| {}).unwrap();
        // Original and mirror, each with and without music.
        assert_eq!(summary.clips, 4, "{summary:?}");
        assert!(summary.left_out[0].contains("broken.npz"), "{summary:?}");
        assert!((summary.captured_dance_with_beat_minutes - 0.3).abs() < 1e-9);
    }

    /// A body whose arms stop every 0.5 s.
    fn swing() -> servodance_model::motion::Clip {
        use servodance_types::BodyJoint;
        let pose = |i: usize| {
            let swing = 0.3 * (std::f64::consts::TAU * i as f64 / 20.0).cos();
            BodyJoint::ALL.map(|joint| {
                let name = joint.name();
                let side = match name.split_once('_') {
                    Some(("left", _)) => 0.15,
                    Some(_) => -0.15,
                    None => 0.0,
                };
                let arm = name.contains("elbow") || name.contains("wrist");
                let legs = ["knee", "ankle", "foot"].iter().position(|leg| name.contains(leg));
                let height =
                    legs.map_or(0.9 + 0.01 * joint as usize as f32, |at| [0.45, 0.08, 0.02][at]);
                [side, height, if arm { swing as f32 } else { 0.0 }]
            })
        };
        servodance_model::motion::Clip {
            name: "swing".into(),
            fps: 20.0,
            poses: (0..360).map(pose).collect(),
        }
    }
}
