//! The report is computed again from the recording alone: its own reader, its
//! own beats, its own limits. Only the MCAP container is read by a library.

use crate::program::Program;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// A recording, in memory.
pub struct Recording {
    messages: BTreeMap<String, Vec<(u64, Vec<u8>)>>,
    facts: BTreeMap<String, String>,
}

impl Recording {
    pub fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).expect("the recording");
        let mut messages: BTreeMap<String, Vec<(u64, Vec<u8>)>> = BTreeMap::new();
        for message in mcap::read::MessageStream::new(&bytes).expect("an MCAP file") {
            let message = message.expect("a message");
            let topic = messages.entry(message.channel.topic.clone()).or_default();
            topic.push((message.log_time, message.data.to_vec()));
        }
        let mut facts = BTreeMap::new();
        for record in mcap::read::LinearReader::new(&bytes).expect("an MCAP file") {
            if let mcap::records::Record::Metadata(found) = record.expect("a record") {
                facts.extend(found.metadata);
            }
        }
        Self { messages, facts }
    }

    /// The undecoded messages of a topic, with their times in nanoseconds.
    pub fn raw(&self, topic: &str) -> &[(u64, Vec<u8>)] {
        self.messages.get(topic).map_or(&[], Vec::as_slice)
    }

    fn numbers(&self, topic: &str) -> Vec<f64> {
        let decode = |(_, data): &(u64, Vec<u8>)| Cdr::new(data).f64();
        self.raw(topic).iter().map(decode).collect()
    }

    /// Numbers of a topic with their times, seconds of music.
    pub fn timed_numbers(&self, topic: &str) -> Vec<(f64, f64)> {
        let music_start_s = self.fact("music_start_s");
        let times =
            self.raw(topic).iter().map(|(time_ns, _)| *time_ns as f64 * 1e-9 - music_start_s);
        times.zip(self.numbers(topic)).collect()
    }

    /// Positions of a JointState topic: time in seconds of music, radians.
    pub fn positions(&self, topic: &str) -> Vec<(f64, Vec<f64>)> {
        let music_start_s = self.fact("music_start_s");
        let decode = |(time_ns, data): &(u64, Vec<u8>)| {
            let mut cdr = Cdr::new(data);
            cdr.header();
            for _ in 0..cdr.u32() {
                cdr.string();
            }
            (*time_ns as f64 * 1e-9 - music_start_s, cdr.f64s())
        };
        self.raw(topic).iter().map(decode).collect()
    }

    /// The 22 points of each motion frame.
    fn motion(&self) -> Vec<Vec<[f64; 3]>> {
        let decode = |(_, data): &(u64, Vec<u8>)| {
            let mut cdr = Cdr::new(data);
            cdr.header();
            (0..cdr.u32())
                .map(|_| {
                    let pose: [f64; 7] = std::array::from_fn(|_| cdr.f64());
                    [pose[0], pose[1], pose[2]]
                })
                .collect()
        };
        self.raw("/motion").iter().map(decode).collect()
    }

    fn fact(&self, key: &str) -> f64 {
        self.facts[key].parse().expect("a number")
    }
}

/// A reader of little-endian CDR, written from its rules: every number is
/// aligned to its size, counted from byte 4.
struct Cdr<'a> {
    data: &'a [u8],
    at: usize,
}

impl<'a> Cdr<'a> {
    fn new(data: &'a [u8]) -> Self {
        assert_eq!(data[..4], [0, 1, 0, 0], "little-endian CDR");
        Self { data, at: 4 }
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        self.at = 4 + (self.at - 4).div_ceil(N) * N;
        self.at += N;
        self.data[self.at - N..self.at].try_into().expect("N bytes")
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }

    fn f64(&mut self) -> f64 {
        f64::from_le_bytes(self.take())
    }

    fn string(&mut self) -> String {
        let length = self.u32() as usize;
        let text = &self.data[self.at..self.at + length - 1];
        self.at += length;
        String::from_utf8(text.to_vec()).expect("text")
    }

    fn header(&mut self) {
        self.u32();
        self.u32();
        self.string();
    }

    fn f64s(&mut self) -> Vec<f64> {
        (0..self.u32()).map(|_| self.f64()).collect()
    }
}

/// Mean distance that the points or joints moved a second, around each sample.
fn mean_speed<T>(samples: &[Vec<T>], rate_hz: f64, distance: impl Fn(&T, &T) -> f64) -> Vec<f64> {
    let moved = |a: &Vec<T>, b: &Vec<T>| {
        let sum: f64 = a.iter().zip(b).map(|(a, b)| distance(a, b)).sum();
        sum / a.len() as f64 * rate_hz
    };
    let last = samples.len() - 1;
    (0..samples.len())
        .map(|i| match i {
            0 => moved(&samples[0], &samples[1]),
            i if i == last => moved(&samples[i - 1], &samples[i]),
            i => (moved(&samples[i - 1], &samples[i]) + moved(&samples[i], &samples[i + 1])) / 2.0,
        })
        .collect()
}

/// Local minima of a speed, by the published rule: at 60 Hz, strictly below
/// all of the ten neighbours on either side. Seconds.
fn kinematic_beats(speed: &[f64], rate_hz: f64) -> Vec<f64> {
    let seconds = (speed.len() - 1) as f64 / rate_hz;
    let count = (seconds * 60.0 + 1e-9).floor() as usize + 1;
    // Cubic Hermite with slopes from the neighbours (Catmull-Rom).
    let at = |i: i64| speed[i.clamp(0, speed.len() as i64 - 1) as usize];
    let fine: Vec<f64> = (0..count)
        .map(|i| {
            let x = i as f64 / 60.0 * rate_hz;
            let k = (x + 1e-9).floor() as i64;
            let t = x - k as f64;
            let (p0, p1) = (at(k), at(k + 1));
            let (m0, m1) = ((p1 - at(k - 1)) / 2.0, (at(k + 2) - p0) / 2.0);
            p0 + t * (m0 + t * (3.0 * (p1 - p0) - 2.0 * m0 - m1 + t * (2.0 * (p0 - p1) + m0 + m1)))
        })
        .collect();
    (0..count)
        .filter(|&i| {
            (1..=10).all(|d| {
                let left = i < d || fine[i] < fine[i - d];
                let right = i + d >= count || fine[i] < fine[i + d];
                left && right && i >= 1 && i + 1 < count
            })
        })
        .map(|i| i as f64 / 60.0)
        .collect()
}

fn mean_closeness(from_s: &[f64], to_s: &[f64], sigma_s: f64) -> f64 {
    if from_s.is_empty() || to_s.is_empty() {
        return 0.0;
    }
    let nearest = |a: &f64| to_s.iter().map(|b| (a - b).abs()).fold(f64::INFINITY, f64::min);
    let score = |a| (-nearest(a).powi(2) / (2.0 * sigma_s * sigma_s)).exp();
    from_s.iter().map(score).sum::<f64>() / from_s.len() as f64
}

/// F1 of two lists of beats: as many pairs within 100 ms as can be made, each
/// beat used once (dynamic programming over both lists).
fn f1(moves: &[f64], beats: &[f64]) -> f64 {
    let mut pairs = vec![vec![0usize; beats.len() + 1]; moves.len() + 1];
    for (i, a) in moves.iter().enumerate() {
        for (j, b) in beats.iter().enumerate() {
            let paired = pairs[i][j] + usize::from((a - b).abs() <= 0.1 + 1e-9);
            pairs[i + 1][j + 1] = paired.max(pairs[i][j + 1]).max(pairs[i + 1][j]);
        }
    }
    2.0 * pairs[moves.len()][beats.len()] as f64 / (moves.len() + beats.len()) as f64
}

fn close(report: &Value, found: f64, tolerance: f64, what: &str) {
    let told = report.as_f64().unwrap_or_else(|| panic!("{what}: {report}"));
    assert!(
        (told - found).abs() <= tolerance,
        "{what}: the report says {told}, the recording {found}"
    );
}

/// Counts samples outside the limits, allowing each position `slack_rad`.
fn broken_limits(
    samples: &[(f64, Vec<f64>)],
    joints: &[Value],
    hz: f64,
    slack_rad: f64,
) -> [u64; 3] {
    let mut broken = [0; 3];
    for (j, joint) in joints.iter().enumerate() {
        let limit = |key: &str| joint[key].as_f64().expect("a limit");
        let at = |i: usize| samples[i].1[j];
        for i in 0..samples.len() {
            let outside =
                at(i) < limit("lower_rad") - slack_rad || at(i) > limit("upper_rad") + slack_rad;
            broken[0] += u64::from(outside);
            if i >= 1 {
                let velocity = (at(i) - at(i - 1)).abs() - 2.0 * slack_rad;
                broken[1] += u64::from(velocity * hz > limit("velocity_rad_s") * 1.0001);
            }
            if i >= 2 {
                let change = (at(i) - 2.0 * at(i - 1) + at(i - 2)).abs() - 4.0 * slack_rad;
                broken[2] += u64::from(change * hz * hz > limit("acceleration_rad_s2") * 1.0001);
            }
        }
    }
    broken
}

#[test]
fn the_report_agrees_with_the_recording() {
    let program = Program::new();
    program.succeed(&[
        "dance",
        "--record",
        "out.mcap",
        "--report",
        "out.json",
        "--no-picture",
        "--quiet",
    ]);
    let recording = Recording::read(&program.path("out.mcap"));
    let text = std::fs::read_to_string(program.path("out.json")).expect("the report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    let hz = recording.fact("control_hz");

    // Counts and totals.
    let motion = recording.motion();
    close(&report["frames"], motion.len() as f64, 0.0, "frames");
    let cycles = recording.raw("/joint_states").len();
    close(&report["bus_stats"]["cycles"], cycles as f64, 0.0, "cycles");
    close(&report["audio_s"], recording.fact("audio_s"), 1e-9, "audio_s");
    let bytes = *recording.numbers("/bus/bytes").last().expect("bytes");
    let told = report["bus_stats"]["bytes"].as_f64().expect("bytes");
    assert!(told >= bytes && told < bytes + 5_000.0, "{bytes} then {told}");

    let packets = *recording.numbers("/bus/packets").last().expect("packets");
    let told = report["bus_stats"]["packets"].as_f64().expect("packets");
    assert!(told >= packets && told < packets + 200.0, "{packets} then {told}");
    let rate_hz = report["bus_stats"]["rate_hz"].as_f64().expect("a rate");
    assert!((rate_hz - hz).abs() < 0.01 * hz, "{rate_hz} Hz of {hz}");

    // Beats.
    let start_ns = (recording.fact("music_start_s") * 1e9) as i64;
    let beats: Vec<f64> =
        recording.raw("/beat").iter().map(|(t, _)| (*t as i64 - start_ns) as f64 * 1e-9).collect();
    assert!(beats.len() > 30, "{} beats", beats.len());
    assert_eq!(report["beats"]["times_s"].as_array().map(Vec::len), Some(beats.len()));
    close(&report["beats"]["tempo_bpm"], recording.numbers("/beat")[0], 1e-9, "tempo");
    for (i, beat) in beats.iter().enumerate() {
        close(&report["beats"]["times_s"][i], *beat, 1e-6, "beat time");
    }

    // Alignment, at the dancer, the targets and the servos.
    let points = |a: &[f64; 3], b: &[f64; 3]| -> f64 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    };
    let every = (hz / 20.0).round() as usize;
    let first = (recording.fact("music_start_s") * hz).round() as usize;
    let sampled = |topic: &str| -> Vec<f64> {
        let all = recording.positions(topic);
        let first = first.next_multiple_of(every);
        let kept: Vec<Vec<f64>> = all[first..].iter().step_by(every).map(|s| s.1.clone()).collect();
        mean_speed(&kept, hz / every as f64, |a, b| (a - b).abs())
    };
    let speeds = [
        ("generator", mean_speed(&motion, 20.0, points), 20.0),
        ("targets", sampled("/joint_targets"), hz / every as f64),
        ("servos", sampled("/joint_states"), hz / every as f64),
    ];
    for (stage, speed, rate_hz) in &speeds {
        let moves = kinematic_beats(speed, *rate_hz);
        let told = &report["alignment"][stage];
        let end_s = (speed.len() - 1) as f64 / rate_hz;
        let heard: Vec<f64> = beats.iter().copied().filter(|b| (0.0..=end_s).contains(b)).collect();
        close(&told["f1"], f1(&moves, &heard), 1e-2, stage);
        close(&told["fact"], mean_closeness(&moves, &beats, 3.0 / 60.0), 5e-3, stage);
        close(&told["bailando"], mean_closeness(&beats, &moves, 5.0 / 60.0), 5e-3, stage);
    }

    // Limits, of what the servos were told and of where they went, as the judge has them:
    // half a tick is a rounding.
    let joints: Vec<Value> = serde_json::from_str(&recording.facts["joints"]).expect("JSON");
    let half_tick = joints[0]["tick_rad"].as_f64().expect("a tick") / 2.0;
    let told = broken_limits(&recording.positions("/joint_commands"), &joints, hz, half_tick);
    let went = broken_limits(&recording.positions("/servo_truth"), &joints, hz, half_tick);
    for (i, kind) in ["position", "velocity", "acceleration"].iter().enumerate() {
        close(&report["violations"][kind], told[i] as f64, 0.0, kind);
        close(&report["body"]["beyond_limits"][kind], went[i] as f64, 0.0, kind);
    }

    // Stage times.
    for stage in ["features", "model", "retarget", "control", "bus"] {
        let mut times = recording.numbers(&format!("/stage/{stage}"));
        times.sort_by(f64::total_cmp);
        let rank = |share: f64| times[(share * times.len() as f64).ceil() as usize - 1];
        let told = &report["stages"][stage];
        close(&told["p50_ms"], rank(0.5), 1e-9, stage);
        close(&told["p99_ms"], rank(0.99), 1e-9, stage);
        close(&told["max_ms"], rank(1.0), 1e-9, stage);
    }
}
