//! Scripted streams: the test is the capture callback and the clock.

use super::clock::seconds_between;
use super::ring::{RingFormat, RingReader, RingWriter, ring};
use super::supervisor::{DeviceOpener, FailureReporter};
use super::*;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

const BLOCK_S: f64 = 0.01;

/// A stream, its clock, and the callback's end of the ring.
struct Bench {
    stream: LiveStream,
    start: Instant,
    now_s: f64,
    writer: Option<RingWriter>,
    rate_hz: u32,
    /// Samples written, for a tone without jumps.
    written: u64,
    heard: Vec<f32>,
}

impl Bench {
    fn new(kind: InputKind, rate_hz: u32) -> Self {
        let start = Instant::now();
        let (writer, reader) = ring(RingFormat { sample_rate_hz: rate_hz, channels: 2 });
        let supervisor = DeviceSupervisor::of_one_ring(reader);
        Self {
            stream: LiveStream::new(kind, supervisor, start),
            start,
            now_s: 0.0,
            writer: Some(writer),
            rate_hz,
            written: 0,
            heard: Vec::new(),
        }
    }

    fn now(&self) -> Instant {
        self.start + Duration::from_secs_f64(self.now_s)
    }

    /// A block of a 440 Hz tone, twice for two channels, as the callback has it.
    fn block(&mut self, seconds: f64) {
        let frames = (seconds * f64::from(self.rate_hz)).round() as u64;
        let rate_hz = f64::from(self.rate_hz);
        let tone = |i: u64| (std::f64::consts::TAU * 440.0 * i as f64 / rate_hz).sin() as f32;
        let from = self.written;
        let samples: Vec<f32> = (0..2 * frames).map(|i| tone(from + i / 2)).collect();
        self.written += frames;
        let now = self.now();
        if let Some(writer) = &mut self.writer {
            writer.write(samples.into_iter(), now);
        }
    }

    /// The clock goes on in blocks; `delivered_s` of sound come with each.
    fn run(&mut self, seconds: f64, delivered_s: f64) {
        for _ in 0..(seconds / BLOCK_S).round() as usize {
            self.now_s += BLOCK_S;
            if delivered_s > 0.0 {
                self.block(delivered_s);
            }
            self.take();
        }
    }

    fn take(&mut self) {
        let now = self.now();
        self.stream.read(now, &mut self.heard);
    }

    /// Waits, while the clock stands, until the supervisor (a real thread) has handed
    /// over what it opened.
    fn await_opening(&mut self, count: u64) {
        while self.stream.stats().opened < count {
            std::thread::yield_now();
            self.take();
        }
    }

    fn heard_s(&self) -> f64 {
        self.heard.len() as f64 / f64::from(LIVE_RATE_HZ)
    }

    fn notices(&mut self) -> Vec<CaptureEvent> {
        std::iter::from_fn(|| self.stream.next_event()).collect()
    }

    /// Loudest sample of the newest seconds.
    fn loudness(&self, seconds: f64) -> f32 {
        let count = (seconds * f64::from(LIVE_RATE_HZ)) as usize;
        let newest = &self.heard[self.heard.len() - count..];
        newest.iter().fold(0.0, |peak, s| peak.max(s.abs()))
    }
}

#[test]
fn sound_is_heard_as_long_as_it_lasts() {
    let mut bench = Bench::new(InputKind::Device, 48_000);
    bench.run(5.0, BLOCK_S);
    assert!((bench.heard_s() - 5.0).abs() < 0.01, "{}", bench.heard_s());
    assert!((bench.loudness(4.0) - 1.0).abs() < 0.01);
    assert_eq!(bench.notices(), []);
    let captured = bench.stream.captured_at(4.9).expect("it is live");
    let error_s = seconds_between(bench.start, captured) - 4.9;
    assert!(error_s.abs() < 0.005, "{error_s}");
}

#[test]
fn a_stall_is_said_once_and_time_goes_on_in_silence() {
    let mut bench = Bench::new(InputKind::Device, 44_100);
    bench.run(3.0, BLOCK_S);
    bench.run(4.0, 0.0);
    assert!((bench.heard_s() - 7.0).abs() < 0.01, "{}", bench.heard_s());
    assert_eq!(bench.loudness(3.0), 0.0);
    assert_eq!(bench.notices(), [CaptureEvent::Stalled]);
    bench.run(3.0, BLOCK_S);
    assert!((bench.heard_s() - 10.0).abs() < 0.01, "{}", bench.heard_s());
    assert!(bench.loudness(2.9) > 0.9);
    let notices = bench.notices();
    assert!(
        matches!(notices[..], [CaptureEvent::Back { away_s }] if (away_s - 4.0).abs() < 0.1),
        "{notices:?}"
    );
}

#[test]
fn a_device_that_never_delivers_is_silence_in_real_time() {
    let mut bench = Bench::new(InputKind::Device, 48_000);
    bench.run(3.0, 0.0);
    assert!((bench.heard_s() - 3.0).abs() < 0.01, "{}", bench.heard_s());
    assert_eq!(bench.notices(), [CaptureEvent::Stalled]);
}

#[test]
fn a_device_with_a_fast_or_slow_clock_stays_in_time() {
    for drift in [0.9995, 1.0005] {
        let mut bench = Bench::new(InputKind::Device, 48_000);
        // Ten milliseconds by its clock are not ten by ours.
        for _ in 0..12_000 {
            bench.now_s += BLOCK_S / drift;
            bench.block(BLOCK_S);
            bench.take();
        }
        let error_s = bench.heard_s() - bench.now_s;
        assert!(error_s.abs() < 0.01, "drift {drift}: {error_s} s after {} s", bench.now_s);
        assert_eq!(bench.notices(), []);
    }
}

#[test]
fn another_rate_than_the_one_promised_is_found_out() {
    let mut bench = Bench::new(InputKind::Device, 48_000);
    // In truth 44.1 kHz: a block holds fewer samples than it should.
    bench.run(8.0, BLOCK_S * 44_100.0 / 48_000.0);
    let change = CaptureEvent::RateChanged { from_hz: 48_000, to_hz: 44_100 };
    assert!(bench.notices().contains(&change));
    assert!((bench.heard_s() - 8.0).abs() < 0.3, "{}", bench.heard_s());
}

#[test]
fn an_overrun_is_counted_and_time_stays_right() {
    let mut bench = Bench::new(InputKind::Device, 48_000);
    bench.run(1.0, BLOCK_S);
    // Nobody takes sound for three seconds; the ring holds two.
    for _ in 0..300 {
        bench.now_s += BLOCK_S;
        bench.block(BLOCK_S);
    }
    bench.run(5.0, BLOCK_S);
    let stats = bench.stream.stats();
    assert_eq!(stats.overruns, 1);
    assert!((stats.lost_s - 1.0).abs() < 0.02, "{stats:?}");
    assert!((bench.heard_s() - 9.0).abs() < 0.02, "{}", bench.heard_s());
    let overruns = bench.notices();
    let overruns = overruns.iter().filter(|n| matches!(n, CaptureEvent::Overrun { .. }));
    assert_eq!(overruns.count(), 1);
}

#[test]
fn a_burst_after_a_stall_does_not_make_the_robot_late() {
    for kind in [InputKind::Device, InputKind::PcmStream] {
        let mut bench = Bench::new(kind, 48_000);
        bench.run(2.0, BLOCK_S);
        bench.run(1.5, 0.0);
        for _ in 0..150 {
            bench.block(BLOCK_S); // all that was held back, at once
        }
        bench.run(2.0, BLOCK_S);
        let ahead_s = bench.heard_s() - bench.now_s;
        assert!(ahead_s.abs() < 0.06, "{kind:?}: {ahead_s}");
        assert!(bench.notices().contains(&CaptureEvent::TooLate), "{kind:?}");
    }
}

#[test]
fn a_pipe_may_be_ahead_and_ends() {
    let mut bench = Bench::new(InputKind::PcmStream, 48_000);
    bench.run(0.5, 2.0 * BLOCK_S); // twice as fast as real time
    assert!((bench.heard_s() - 1.0).abs() < 0.01, "{}", bench.heard_s());
    assert_eq!(bench.notices(), []);
    bench.writer = None;
    let now = bench.now();
    assert!(!bench.stream.read(now, &mut bench.heard));
}

/// A device that the test breaks and mends.
struct Scripted {
    script: Receiver<Result<u32, String>>,
    opened: Sender<(RingWriter, FailureReporter)>,
}

impl DeviceOpener for Scripted {
    type Open = ();

    fn open(&mut self, failure: FailureReporter) -> Result<(RingReader, ()), String> {
        let rate_hz = self.script.recv().map_err(|_| "the test is over".to_owned())??;
        let (writer, reader) = ring(RingFormat { sample_rate_hz: rate_hz, channels: 2 });
        self.opened.send((writer, failure)).map_err(|e| e.to_string())?;
        Ok((reader, ()))
    }
}

#[test]
fn an_unplugged_device_is_opened_again_at_another_rate() {
    let (script, orders) = channel();
    let (outbox, opened) = channel();
    let scripted = Scripted { script: orders, opened: outbox };
    let supervisor = DeviceSupervisor::start(scripted).expect("a thread");
    let mut bench = Bench::new(InputKind::Device, 48_000);
    bench.stream = LiveStream::new(InputKind::Device, supervisor, bench.start);
    script.send(Ok(48_000)).expect("it opens");
    let (writer, failure) = opened.recv().expect("it is open");
    bench.writer = Some(writer);
    bench.await_opening(1);
    bench.run(2.0, BLOCK_S);

    failure.report("unplugged".into());
    script.send(Err("still unplugged".into())).expect("it tries");
    bench.writer = None;
    let mut lost = Vec::new();
    while lost.is_empty() {
        std::thread::yield_now(); // the supervisor is a real thread
        bench.take();
        lost = bench.notices();
    }
    assert_eq!(lost, [CaptureEvent::Lost { reason: "unplugged".into() }]);
    bench.run(2.0, 0.0);

    script.send(Ok(44_100)).expect("it opens");
    bench.writer = Some(opened.recv().expect("it is open").0);
    bench.rate_hz = 44_100;
    bench.await_opening(2);
    bench.run(2.0, BLOCK_S);
    // What arrived before the new ring was there may be a little too much.
    assert!((bench.heard_s() - 6.0).abs() < 0.06, "{}", bench.heard_s());
    assert!(bench.loudness(1.5) > 0.9);
    let notices = bench.notices();
    let change = CaptureEvent::RateChanged { from_hz: 48_000, to_hz: 44_100 };
    assert!(notices.contains(&change), "{notices:?}");
    let said: Vec<_> = notices.iter().filter(|n| matches!(n, CaptureEvent::Lost { .. })).collect();
    assert!(said.is_empty(), "said again: {said:?}");
}
