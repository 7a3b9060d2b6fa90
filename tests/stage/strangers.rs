//! Whoever is on the network can say anything: nothing of it breaks a limit or
//! stops a follower. And ROS 2 sees it.

use super::together::{Running, endpoint};
use crate::program::Program;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use servodance_stage::messages::StageFrame;
use servodance_stage::net::{NetConfig, NetSession, StageKeys};
use servodance_stage::ros2::{CdrReader, Node, Topic, TopicType};
use servodance_stage::{Leader, Outgoing};
use servodance_types::{Beat, BeatLock, Posture};
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};

/// A session to which a follower connects.
pub fn net(at: &str) -> NetSession {
    let place = NetConfig { leads: true, listen: vec![at.to_owned()], ..NetConfig::default() };
    NetSession::open(place.config().expect("a configuration")).expect("a session")
}

/// Leads with the wildest motion that the format allows, and says nonsense.
fn rave(net: &NetSession, seconds: u64) {
    let keys = StageKeys::new("main").expect("a name");
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut leader = Leader::new(3, [5; 32]);
    let began = Instant::now();
    let now_ns = move || began.elapsed().as_nanos() as i64;
    let (sender, inbox) = sync_channel(1000);
    let _ear = net.subscribe(&keys.from_follower(None), move |bytes| {
        let _ = sender.try_send((now_ns(), bytes.to_vec()));
    });
    let _token = net.declare_liveliness(&keys.leader(leader.instance(), 3)).expect("a token");
    let key = keys.frames(Some(0));
    let mut sent: Vec<Vec<u8>> = Vec::new();
    for index in 0..seconds as i64 * 20 {
        let present_ns = index * 50_000_000 + 1_500_000_000;
        let wild = |rng: &mut ChaCha8Rng| rng.random_range(-1000.0..1000.0);
        let frame = StageFrame {
            present_ns,
            music_ns: index * 50_000_000,
            beat: Beat {
                phase: rng.random(),
                tempo_bpm: rng.random_range(-500.0..1000.0),
                confidence: 1.0,
                lock: BeatLock::Locked,
                ..Beat::default()
            },
            presence: 1.0,
            level: 1.0,
            contacts: Default::default(),
            positions: std::array::from_fn(|_| std::array::from_fn(|_| wild(&mut rng))),
            posture: Posture {
                heading_rad: wild(&mut rng) / 10.0,
                sway: [wild(&mut rng) / 10.0; 2],
                ..Posture::default()
            },
        };
        let message = leader.frames(now_ns(), 0, "hype", frame);
        let mut other_version = message.clone();
        other_version[2] = 77;
        let replayed = sent.get(sent.len() / 2).cloned().unwrap_or_default();
        let nonsense = vec![rng.random(); rng.random_range(0..200)];
        sent.push(message.clone());
        for bytes in [message, replayed, other_version, nonsense, vec![7; 40_000]] {
            net.put(&key, bytes).expect("it goes out");
        }
        while began.elapsed() < Duration::from_millis(50 * index as u64) {
            let wait = Duration::from_millis(5);
            let Ok((at_ns, bytes)) = inbox.recv_timeout(wait) else {
                continue;
            };
            if let Ok(Outgoing::Reply(follower, messages)) = leader.receive(at_ns, &bytes, now_ns) {
                for message in messages {
                    net.put(&keys.to_follower(follower), message).expect("it goes out");
                }
            }
        }
    }
}

#[test]
fn no_leader_can_make_a_follower_break_its_limits() {
    let program = Program::new();
    let at = endpoint();
    let net = net(&at);
    let follower = Running::follow(&program, &at, &["--report", "f.json"]);
    rave(&net, 10);
    follower.stop();
    let text = std::fs::read_to_string(program.path("f.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(report["joined"], 1, "{report}");
    assert!(report["frames"].as_u64() > Some(50), "{report}");
    for limit in ["position", "velocity", "acceleration"] {
        assert_eq!(report["violations"][limit], 0, "{report}");
    }
    for cause in ["malformed", "huge", "other_version", "replayed"] {
        assert!(report["dropped"][cause].as_u64() > Some(50), "{cause}: {report}");
    }
}

#[test]
fn ros_2_sees_the_joints_of_a_follower() {
    let program = Program::new();
    let at = endpoint();
    let net = net(&at);
    let words = ["--name", "my-neck", "--ros2", "--ros-domain", "7"];
    let (sender, heard) = sync_channel(1000);
    let node = Node {
        domain: 7,
        session: String::new(),
        namespace: "main/my_neck".into(),
        name: "servodance".into(),
    };
    let topic = |name| Topic { name, message: TopicType::JointState };
    let _ears = ["joint_states", "joint_commands"].map(|name| {
        let sender = sender.clone();
        let ear = net.subscribe(&node.key(&topic(name)), move |bytes| {
            let _ = sender.try_send((name, bytes.to_vec()));
        });
        ear.expect("an ear")
    });
    let follower = Running::follow(&program, &at, &words);
    rave(&net, 4); // without a leader it drives no servo
    for wanted in ["joint_states", "joint_commands"] {
        let read = loop {
            let (name, bytes) = heard.recv_timeout(Duration::from_secs(60)).expect(wanted);
            if name == wanted {
                break bytes;
            }
        };
        let mut cdr = CdrReader::new(&read).expect("CDR");
        cdr.header().expect("a header");
        let names: Vec<_> = (0..cdr.u32().expect("a count")).map(|_| cdr.string()).collect();
        let robot = servodance_runtime::robot::Robot::load("neck").expect("the robot");
        let joints = robot.servos.iter().map(|servo| Some(servo.name.as_str()));
        assert_eq!(names, joints.collect::<Vec<_>>());
        let positions = cdr.f64s().expect("positions");
        assert_eq!(positions.len(), names.len());
    }
    let tokens = net.live_keys("@ros2_lv/7/**", Duration::from_secs(2)).expect("tokens");
    for part in
        ["/NN/%/%main%my_neck/servodance", "%joint_states/", "%joint_commands/", "%skeleton/"]
    {
        assert!(tokens.iter().any(|token| token.contains(part)), "{part}: {tokens:?}");
    }
    follower.stop();
}
