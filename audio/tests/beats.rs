//! The causal tracker on music that does not stay as it is: breaks, drift, a
//! jump to another song. The truth is known, since the songs are rendered.

use servodance_audio::MusicAnalyzer;
use servodance_audio::song::noise::{crowd, hiss, knocks, mix, motors, room, speech};
use servodance_audio::song::{Grid, Layers, Mix, Section, Song, SongSpec, Style};
use servodance_types::{BeatLock, MusicFrame};

fn spec(style: Style, beats_s: Vec<f64>, duration_s: f64) -> SongSpec {
    let mut spec = SongSpec::on_beats(&beats_s, duration_s, 4).expect("a usable grid");
    spec.grid = Grid::Beats(beats_s);
    spec.style = style;
    spec.mix = Mix::clean();
    spec.sections = vec![section(0, Layers::ALL)];
    spec
}

fn section(first_bar: i64, layers: Layers) -> Section {
    Section { first_bar, layers, intensity: 0.7 }
}

fn steady(bpm: f64, duration_s: f64) -> Vec<f64> {
    let count = (duration_s * bpm / 60.0) as usize;
    (0..count).map(|i| i as f64 * 60.0 / bpm).collect()
}

fn listen(samples: &[f32], rate_hz: u32) -> Vec<MusicFrame> {
    let mut analyzer = MusicAnalyzer::new(rate_hz).expect("a usable rate");
    analyzer.push(samples);
    std::iter::from_fn(|| analyzer.pop()).collect()
}

/// Seconds by which the tracked phase is off the true one, -half to half a beat.
fn error_s(song: &Song, frame: &MusicFrame) -> f64 {
    let next = song.beats_s.partition_point(|&beat| beat <= frame.time_s);
    let next = next.clamp(1, song.beats_s.len() - 1);
    let (a, b) = (song.beats_s[next - 1], song.beats_s[next]);
    let truth = (frame.time_s - a) / (b - a);
    let off = f64::from(frame.beat.phase) - truth;
    (off - off.round()) * (b - a)
}

/// The share of frames between two times that are sure and right within 50 ms.
fn right(song: &Song, frames: &[MusicFrame], from_s: f64, to_s: f64) -> f64 {
    let span = frames.iter().filter(|f| (from_s..to_s).contains(&f.time_s));
    let (mut hit, mut all) = (0, 0);
    for frame in span {
        all += 1;
        hit += usize::from(frame.beat.confidence >= 0.5 && error_s(song, frame).abs() < 0.05);
    }
    hit as f64 / f64::from(all)
}

#[test]
fn phase_is_exact_once_locked() {
    for (style, bpm) in
        [(Style::House, 124.0), (Style::Rock, 140.0), (Style::Disco, 116.0), (Style::Soul, 96.0)]
    {
        let song = spec(style, steady(bpm, 25.0), 25.0).render().expect("a song");
        let frames = listen(&song.samples, song.sample_rate_hz);
        let late: Vec<f64> =
            frames.iter().filter(|f| f.time_s > 8.0).map(|f| error_s(&song, f)).collect();
        let worst = late.iter().fold(0.0f64, |w, e| w.max(e.abs()));
        assert!(worst < 0.03, "{style:?}: {worst} s off");
        assert!(right(&song, &frames, 5.0, 25.0) > 0.95, "{style:?}");
    }
}

#[test]
fn break_is_danced_through() {
    let mut spec = spec(Style::House, steady(120.0, 40.0), 40.0);
    // Bars of 2 s: drums stop from 16 s to 24 s, chords go on.
    let quiet = Layers { drums: false, bass: false, lead: false, chords: true };
    spec.sections.push(section(8, quiet));
    spec.sections.push(section(12, Layers::ALL));
    let song = spec.render().expect("a song");
    let frames = listen(&song.samples, song.sample_rate_hz);
    assert!(right(&song, &frames, 6.0, 16.0) > 0.95);
    // Once the drums are back the beat is where it was.
    assert!(right(&song, &frames, 27.0, 40.0) > 0.9);
}

#[test]
fn drift_of_ten_percent_is_followed() {
    let mut beats_s = vec![0.0];
    let mut now_s = 0.0f64;
    while now_s < 40.0 {
        let bpm = 110.0 + 11.0 * (now_s / 30.0).min(1.0);
        now_s += 60.0 / bpm;
        beats_s.push(now_s);
    }
    let song = spec(Style::Rock, beats_s, 40.0).render().expect("a song");
    let frames = listen(&song.samples, song.sample_rate_hz);
    let share = right(&song, &frames, 6.0, 39.0);
    assert!(share > 0.9, "right in {share} of the frames");
}

#[test]
fn another_song_is_found() {
    let first = spec(Style::House, steady(126.0, 20.0), 20.0);
    let second = spec(Style::Rock, steady(140.0, 25.0), 25.0);
    let (first, second) = (first.render().expect("a song"), second.render().expect("a song"));
    let mut both = first.samples.clone();
    both.extend_from_slice(&second.samples);
    let mut frames = listen(&both, first.sample_rate_hz);
    frames.retain(|f| f.time_s >= 20.0);
    frames.iter_mut().for_each(|f| f.time_s -= 20.0);
    let share = right(&second, &frames, 10.0, 25.0);
    assert!(share > 0.9, "right in {share} of the frames");
}

#[test]
fn slow_song_after_a_faster_one_is_followed_at_its_own_tempo() {
    let first = spec(Style::House, steady(126.0, 20.0), 20.0).render().expect("a song");
    for style in [Style::Soul, Style::HipHop, Style::Rock] {
        let second = spec(style, steady(98.0, 30.0), 30.0).render().expect("a song");
        let mut both = first.samples.clone();
        both.extend_from_slice(&second.samples);
        let frames = listen(&both, first.sample_rate_hz);
        let late: Vec<&MusicFrame> = frames.iter().filter(|f| f.time_s >= 35.0).collect();
        let slow = |f: &&&MusicFrame| (f.beat.tempo_bpm / 98.0 - 1.0).abs() < 0.04;
        let share = late.iter().filter(slow).count() as f64 / late.len() as f64;
        assert!(share > 0.9, "{style:?}: at 98 BPM in {share} of the frames");
    }
}

/// Where the robot turns round: a little after each beat.
fn turns(song: &Song) -> Vec<f64> {
    song.beats_s.iter().map(|beat| beat + 0.15).collect()
}

#[test]
fn own_motors_in_the_microphone_do_not_disturb() {
    let song = spec(Style::House, steady(124.0, 25.0), 25.0).render().expect("a song");
    let whine = motors(&turns(&song), 25.0, song.sample_rate_hz, 3);
    for (snr_db, least) in [(10.0, 0.9), (0.0, 0.8)] {
        let heard = mix(&song.samples, &whine, snr_db);
        let frames = listen(&heard, song.sample_rate_hz);
        let share = right(&song, &frames, 6.0, 25.0);
        assert!(share > least, "{snr_db} dB: right in {share} of the frames");
    }
}

#[test]
fn people_who_talk_do_not_disturb() {
    let song = spec(Style::Rock, steady(132.0, 25.0), 25.0).render().expect("a song");
    for (name, noise) in [
        ("speech", speech(25.0, song.sample_rate_hz, 5)),
        ("crowd", crowd(25.0, song.sample_rate_hz, 5)),
    ] {
        let frames = listen(&mix(&song.samples, &noise, 10.0), song.sample_rate_hz);
        let share = right(&song, &frames, 6.0, 25.0);
        assert!(share > 0.8, "{name}: right in {share} of the frames");
    }
}

/// The share of frames after 6 s in which there is music.
fn presence(frames: &[MusicFrame]) -> f64 {
    let late: Vec<f32> = frames.iter().filter(|f| f.time_s > 6.0).map(|f| f.presence).collect();
    late.iter().filter(|presence| **presence > 0.5).count() as f64 / late.len() as f64
}

#[test]
fn drums_alone_are_music() {
    let drums = Layers { drums: true, bass: false, chords: false, lead: false };
    for (style, bpm) in [(Style::House, 124.0), (Style::Rock, 104.0), (Style::Soul, 92.0)] {
        let mut spec = spec(style, steady(bpm, 25.0), 25.0);
        spec.sections = vec![section(0, drums)];
        let song = spec.render().expect("a song");
        let frames = listen(&song.samples, song.sample_rate_hz);
        assert!(presence(&frames) > 0.8, "{style:?}: music in {}", presence(&frames));
    }
}

#[test]
fn motors_in_a_room_do_not_hide_the_music() {
    let tune = Layers { drums: false, bass: true, chords: true, lead: true };
    for seed in 0..3 {
        let mut spec = spec(Style::Soul, steady(92.0, 25.0), 25.0);
        spec.sections = vec![section(0, tune)];
        let song = spec.render().expect("a song");
        let whine = motors(&turns(&song), 25.0, song.sample_rate_hz, seed);
        let heard = room(&song.samples, song.sample_rate_hz, 0.5, 0.5, seed);
        let frames = listen(&mix(&heard, &whine, 10.0), song.sample_rate_hz);
        assert!(presence(&frames) > 0.8, "seed {seed}: music in {}", presence(&frames));
    }
}

#[test]
fn bars_of_four_are_told_with_their_first_beat() {
    for (style, bpm) in [(Style::House, 124.0), (Style::Rock, 140.0), (Style::Soul, 96.0)] {
        let song = spec(style, steady(bpm, 40.0), 40.0).render().expect("a song");
        let frames = listen(&song.samples, song.sample_rate_hz);
        let late = frames.iter().filter(|f| f.time_s > 15.0 && f.beat.phase < 0.5);
        let (mut right, mut all) = (0, 0);
        for frame in late {
            let beats = song.beats_s.partition_point(|&beat| beat <= frame.time_s + 0.05);
            right += usize::from(frame.beat.beat_in_bar == Some(((beats + 3) % 4) as u8));
            all += 1;
        }
        assert!(right * 10 > all * 9, "{style:?}: right in {right} of {all} frames");
    }
}

#[test]
fn a_beat_that_has_become_the_off_beat_is_left_and_that_is_told_before() {
    for (style, bpm) in [(Style::House, 124.0), (Style::Disco, 116.0)] {
        let song = spec(style, steady(bpm, 40.0), 40.0).render().expect("a song");
        // Half a beat is cut out of it.
        let (cut_s, rate) = (20.0, f64::from(song.sample_rate_hz));
        let (from, to) = ((cut_s * rate) as usize, ((cut_s + 30.0 / bpm) * rate) as usize);
        let samples = [&song.samples[..from], &song.samples[to..]].concat();
        let frames = listen(&samples, song.sample_rate_hz);
        let mut late = frames.iter().filter(|f| f.time_s > cut_s);
        let told = late.find(|f| f.beat.lock == BeatLock::Changing).expect("it is told");
        let shifted = |f: &&MusicFrame| {
            let off = error_s(&song, &MusicFrame { time_s: f.time_s + 30.0 / bpm, ..**f });
            f.time_s > cut_s && off.abs() < 0.05
        };
        let followed = frames.iter().find(shifted).expect("it is followed");
        assert!(told.time_s < followed.time_s, "{style:?}: {told:?} {followed:?}");
        assert!(followed.time_s < cut_s + 7.0, "{style:?}: {followed:?}");
        let late = frames.iter().filter(|f| f.time_s > cut_s + 7.0);
        assert!(late.clone().all(|f| shifted(&f)), "{style:?}: it is kept");
    }
}

#[test]
fn what_is_not_music_is_not_present_and_has_no_beat() {
    const RATE_HZ: u32 = 22_050;
    let turns: Vec<f64> = (0..60).map(|i| 0.5 * f64::from(i)).collect();
    for (name, sound) in [
        ("silence", vec![0.0; 20 * RATE_HZ as usize]),
        ("speech", speech(20.0, RATE_HZ, 8)),
        ("crowd", crowd(20.0, RATE_HZ, 8)),
        ("white noise", hiss(20.0, RATE_HZ, 0.0, 8)),
        ("brown noise", hiss(20.0, RATE_HZ, 0.9, 8)),
        ("knocks", knocks(20.0, RATE_HZ, 4.0, 8)),
        ("motors", motors(&turns, 20.0, RATE_HZ, 8)),
    ] {
        let quiet: Vec<f32> = sound.iter().map(|s| 0.1 * s).collect();
        let frames = listen(&quiet, RATE_HZ);
        let late = || frames.iter().filter(|f| f.time_s > 3.0);
        let wrong = late().filter(|f| f.presence >= 0.5 || f.beat.lock != BeatLock::Lost);
        assert_eq!(wrong.count(), 0, "{name} of {} frames", late().count());
    }
}

#[test]
fn speech_after_a_song_is_noticed() {
    let song = spec(Style::Disco, steady(118.0, 15.0), 15.0).render().expect("a song");
    let mut heard = song.samples.clone();
    let talk = speech(15.0, song.sample_rate_hz, 2);
    heard.extend(talk.iter().map(|s| 0.05 * s));
    let frames = listen(&heard, song.sample_rate_hz);
    let at = |s: f64| frames[(20.0 * s) as usize];
    assert!(at(14.0).presence > 0.5 && at(14.0).beat.lock == BeatLock::Locked);
    for frame in frames.iter().filter(|f| f.time_s > 24.0) {
        assert!(frame.presence < 0.5, "{} s: {}", frame.time_s, frame.presence);
        assert_eq!(frame.beat.lock, BeatLock::Lost, "{} s", frame.time_s);
    }
}

#[test]
fn quiet_music_is_music_with_the_same_beats() {
    let song = spec(Style::House, steady(126.0, 20.0), 20.0).render().expect("a song");
    let loud = listen(&song.samples, song.sample_rate_hz);
    for gain in [0.1, 0.01] {
        let soft: Vec<f32> = song.samples.iter().map(|s| gain * s).collect();
        let soft = listen(&soft, song.sample_rate_hz);
        for (a, b) in loud.iter().zip(&soft).filter(|(a, _)| a.time_s > 4.0) {
            assert!(a.presence > 0.5 && (a.presence - b.presence).abs() < 0.1);
            let turn = a.beat.phase - b.beat.phase;
            assert!((turn - turn.round()).abs() < 0.05, "{gain}: {} s", a.time_s);
        }
    }
}

#[test]
fn sounds_that_no_one_dances_to_claim_no_beat() {
    const RATE_HZ: u32 = 8_000;
    let seconds = 20.0;
    let count = (seconds * f64::from(RATE_HZ)) as usize;
    let loud = hiss(seconds, RATE_HZ, 0.3, 4);
    for (name, sound) in [
        ("direct current", vec![0.5; count]),
        ("clicks at random", knocks(seconds, RATE_HZ, 2.0, 3)),
        ("clipped noise", loud.iter().map(|s| (20.0 * s).clamp(-1.0, 1.0)).collect()),
        ("speech at 8 kHz", speech(seconds, RATE_HZ, 9)),
    ] {
        let frames = listen(&sound, RATE_HZ);
        let claimed = frames.iter().filter(|f| f.beat.lock != BeatLock::Lost).count();
        assert!(claimed * 20 <= frames.len(), "{name}: {claimed} of {} frames", frames.len());
    }
}

#[test]
fn clipped_music_at_8_khz_keeps_its_beat() {
    let song = spec(Style::House, steady(124.0, 25.0), 25.0).render().expect("a song");
    let clipped: Vec<f32> = song.samples.iter().map(|s| (8.0 * s).clamp(-0.7, 0.7)).collect();
    let frames = listen(&clipped, song.sample_rate_hz);
    assert!(right(&song, &frames, 6.0, 25.0) > 0.9);
}
