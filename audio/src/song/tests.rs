//! Songs: reproducible, in range, with beats where the grid has them.

use super::noise::rms;
use super::*;

#[test]
fn same_seed_gives_same_samples() {
    let song = |seed| SongSpec::random(6.0, seed).unwrap().render().unwrap();
    assert_eq!(song(7), song(7));
    assert_ne!(song(7).samples, song(8).samples);
}

#[test]
fn every_style_sounds_and_stays_in_range() {
    for style in Style::ALL {
        let mut spec = SongSpec::random(5.0, 3).unwrap();
        spec.style = style;
        let song = spec.render().unwrap();
        assert_eq!(song.samples.len(), 5 * DEFAULT_RATE_HZ as usize);
        assert!(song.samples.iter().all(|s| s.abs() <= 1.0), "{style:?}");
        assert!(rms(&song.samples) > 1e-3, "{style:?} is silent");
    }
}

#[test]
fn beats_given_are_beats_heard() {
    let beats_s: Vec<f64> = (0..16).map(|i| 0.31 + 0.5 * f64::from(i)).collect();
    let mut spec = SongSpec::on_beats(&beats_s, 8.5, 5).unwrap();
    spec.style = Style::House;
    spec.mix = Mix::clean();
    spec.sections = vec![Section {
        first_bar: 0,
        layers: Layers { bass: false, chords: false, lead: false, drums: true },
        intensity: 0.0,
    }];
    let song = spec.render().unwrap();
    for beat in &beats_s {
        assert!(song.beats_s.iter().any(|b| (b - beat).abs() < 1e-9));
        let at = (beat * f64::from(song.sample_rate_hz)) as usize;
        let (before, after) = (&song.samples[at - 220..at - 1], &song.samples[at..at + 220]);
        assert!(
            rms(after) > 4.0 * rms(before),
            "no onset at {beat} s: {} then {}",
            rms(before),
            rms(after)
        );
    }
}

#[test]
fn demo_rises_from_112_to_126_bpm() {
    let song = Song::demo();
    let interval = |i: usize| song.beats_s[i + 1] - song.beats_s[i];
    assert!((60.0 / interval(0) - 112.0).abs() < 1e-6);
    assert!((60.0 / interval(song.beats_s.len() - 2) - 126.0).abs() < 1e-6);
    assert!((36.0..44.0).contains(&song.duration_s()), "{}", song.duration_s());
    assert_eq!(song.downbeats[..3], [0, 4, 8]);
}

#[test]
fn unusable_specs_are_refused() {
    assert_eq!(
        SongSpec::random(f64::NAN, 0).unwrap_err().to_string(),
        "a song lasts above 0 and at most 3600 seconds, not NaN"
    );
    assert_eq!(SongSpec::on_beats(&[1.0], 4.0, 0), Err(SongError::TooFewBeats(1)));
    assert!(matches!(
        SongSpec::on_beats(&[1.0, 1.5, 1.4], 4.0, 0),
        Err(SongError::Interval { index: 2, .. })
    ));
    assert!(SongSpec::on_beats(&[0.0, f64::NAN], 4.0, 0).is_err());
    let mut spec = SongSpec::random(1.0, 0).unwrap();
    spec.sample_rate_hz = 100;
    assert_eq!(spec.render(), Err(SongError::SampleRate(100)));
}
