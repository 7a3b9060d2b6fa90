//! Whatever is asked, in any order: the simulated servos count no violation.

use clap::Parser;
use rand::{Rng, SeedableRng};
use servodance::cli::{Cli, Command};
use servodance_runtime::control::idle::IdleStyle;
use servodance_runtime::pipeline::audio_input::AudioChoice;
use servodance_runtime::session::config::DanceConfig;
use servodance_runtime::session::dance::Outcome;
use servodance_runtime::session::dance_session::Session;
use servodance_runtime::viewer::{Activity, ViewerEnd, ViewerRequest};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A dance in simulated time, as the command line would set it up.
fn configured(arguments: &[&str]) -> DanceConfig {
    let words = ["servodance", "dance", "--no-picture", "--quiet"];
    let cli = Cli::try_parse_from(words.iter().chain(arguments)).expect("arguments");
    let Some(Command::Dance(args)) = cli.command else {
        panic!("not a dance");
    };
    servodance::cli::dance::configuration(args).expect("a dance")
}

fn session(config: DanceConfig) -> (Session, ViewerEnd) {
    let mut session = Session::new(config).expect("a session");
    let end = session.add_viewer();
    (session, end)
}

/// Runs the session while `audience` has the other end of the line.
fn run(
    (mut session, mut end): (Session, ViewerEnd),
    audience: impl FnOnce(&mut ViewerEnd, &AtomicBool) + Send,
) -> Vec<anyhow::Result<Outcome>> {
    let (over, stop) = (AtomicBool::new(false), AtomicBool::new(false));
    let mut outcomes = Vec::new();
    std::thread::scope(|scope| {
        let (over, stop_it) = (&over, &stop);
        scope.spawn(move || {
            audience(&mut end, stop_it);
            while !over.load(Ordering::Acquire) {
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        let result = session.run(&stop, |_, outcome| {
            outcomes.push(match outcome {
                Ok(outcome) => Ok(Outcome { report: outcome.report.clone(), ..*outcome }),
                Err(error) => Err(anyhow::anyhow!("{error:#}")),
            });
        });
        over.store(true, Ordering::Release);
        drop(result); // the same as the last outcome
    });
    outcomes
}

fn wait_for(end: &mut ViewerEnd, activity: Activity) {
    for _ in 0..12_000 {
        if end.newest().now.activity == activity {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("never {activity:?}: {:?}", end.newest().now);
}

#[test]
fn requests_rain_in_and_no_limit_is_broken() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
    let mut asked = 0;
    let outcomes = run(session(configured(&["--robot", "op3"])), |end, _| {
        wait_for(end, Activity::Dancing);
        loop {
            let activity = end.newest().now.activity;
            if activity == Activity::Over {
                break;
            }
            let request = match (rng.random_range(0..8), activity) {
                // Held for ever, simulated time would never end.
                (_, Activity::Finale) => ViewerRequest::Resume,
                (0, _) => ViewerRequest::Hold,
                (1 | 2, _) => ViewerRequest::Resume,
                (3, _) => ViewerRequest::Amplitude(rng.random_range(0.0..=1.0)),
                (4, _) => ViewerRequest::Mirror(rng.random()),
                (5, _) => ViewerRequest::Idle(
                    [IdleStyle::Sway, IdleStyle::Hold, IdleStyle::Rest][rng.random_range(0..3)],
                ),
                (6, _) => ViewerRequest::Style(rng.random_range(0..8)),
                _ => ViewerRequest::Seed(rng.random()),
            };
            asked += u64::from(end.ask(&[request]));
            std::thread::sleep(Duration::from_micros(300));
        }
    });
    let outcome = outcomes[0].as_ref().expect("a dance");
    let broken = outcome.report.violations.expect("simulated servos");
    assert_eq!(broken.position + broken.velocity + broken.acceleration, 0);
    let holds = outcome.report.safety.iter();
    let holds = holds.filter(|e| e.cause == "asked to hold").count();
    assert!(asked > 200 && holds > 3, "{asked} requests, {holds} holds");
}

#[test]
fn stop_leads_to_rest_and_torque_off_from_a_hold_too() {
    let outcomes = run(session(configured(&["--robot", "neck"])), |end, _| {
        wait_for(end, Activity::Dancing);
        end.ask(&[ViewerRequest::Hold]);
        std::thread::sleep(Duration::from_millis(20));
        end.ask(&[ViewerRequest::Stop]);
    });
    let outcome = outcomes[0].as_ref().expect("a dance");
    let safety = &outcome.report.safety;
    assert!(safety.iter().any(|e| e.cause == "stopped on request"));
    assert_eq!(safety.last().map(|e| e.to.as_str()), Some("Disarmed"));
    assert!(!outcome.interrupted);
    assert_eq!(outcome.report.violations, Some(Default::default()));
}

#[test]
fn an_evening_waits_for_start_and_survives_an_emergency_stop() {
    // `--view` lives in real time; here only the waiting is asked for.
    let config = DanceConfig { wait_for_start: true, ..configured(&["--robot", "neck"]) };
    let outcomes = run(session(config), |end, stop| {
        for round in 0..2 {
            wait_for(end, Activity::Waiting);
            end.ask(&[ViewerRequest::Amplitude(0.25), ViewerRequest::Start]);
            wait_for(end, Activity::Dancing);
            assert_eq!(end.newest().now.settings.amplitude, 0.25);
            if round == 0 {
                end.estop.press("the test");
                wait_for(end, Activity::Waiting);
                end.ask(&[ViewerRequest::Start]);
                std::thread::sleep(Duration::from_millis(100));
                assert_eq!(end.newest().now.activity, Activity::Waiting, "still down");
                end.ask(&[ViewerRequest::Release]);
            }
        }
        end.ask(&[ViewerRequest::Stop]);
        wait_for(end, Activity::Waiting);
        stop.store(true, Ordering::Release);
    });
    assert_eq!(outcomes.len(), 2);
    let error = outcomes[0].as_ref().expect_err("an emergency stop");
    assert!(error.to_string().contains("the test"), "{error}");
    let second = outcomes[1].as_ref().expect("a dance");
    assert_eq!(second.report.violations, Some(Default::default()));
}

/// Three seconds of sound as a file.
fn short_song() -> Vec<u8> {
    let mut wav = std::io::Cursor::new(Vec::new());
    let format = hound::WavSpec {
        channels: 1,
        sample_rate: 16_000,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut writer = hound::WavWriter::new(&mut wav, format).expect("a writer");
    (0..48_000).for_each(|i| writer.write_sample((i % 100 * 200) as i16).expect("written"));
    writer.finalize().expect("whole");
    wav.into_inner()
}

#[test]
fn songs_that_wait_are_not_danced_with_nobody_there() {
    let config = DanceConfig { dead_man_s: Some(0.05), ..configured(&["--robot", "neck"]) };
    let (session, end) = session(config);
    let songs = session.songs();
    songs.add("two.wav", [Ok(short_song())]).expect("a song");
    let outcomes = run((session, end), |_, _| ());
    assert_eq!(outcomes.len(), 1, "torque came back with nobody there");
    assert!(outcomes[0].as_ref().expect("a dance").unattended);
    assert_eq!(songs.waiting(), ["two.wav"]);
}

#[test]
fn the_end_of_a_song_is_no_sign_of_an_operator() {
    let config = DanceConfig { dead_man_s: Some(1e3), ..configured(&["--robot", "neck"]) };
    let (session, end) = session(config);
    session.songs().add("two.wav", [Ok(short_song())]).expect("a song");
    let outcomes = run((session, end), |end, _| {
        wait_for(end, Activity::Dancing);
        let began = Instant::now();
        wait_for(end, Activity::Starting);
        wait_for(end, Activity::Dancing);
        assert!(end.operators.silent_s() >= began.elapsed().as_secs_f64());
    });
    assert_eq!(outcomes.len(), 2);
}

#[test]
fn a_song_that_cannot_begin_makes_room_for_the_next() {
    let gone = AudioChoice::File("gone.wav".into());
    let (session, end) = session(DanceConfig { audio: gone, ..configured(&["--robot", "neck"]) });
    session.songs().add("two.wav", [Ok(short_song())]).expect("a song");
    let outcomes = run((session, end), |_, _| ());
    assert_eq!(outcomes.len(), 1);
    outcomes[0].as_ref().expect("a dance to the second song");
}
