//! The whole program while it is watched, in real time.

use crate::program::Program;
use crate::torque_off::{alone, signal};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

const WATCHED_S: f64 = 8.0;

/// Processor time of the thread with this name, seconds.
fn thread_s(child: &Child, name: &str) -> f64 {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", child.id())).expect("its threads");
    for task in tasks.flatten() {
        let read = |file| std::fs::read_to_string(task.path().join(file)).unwrap_or_default();
        if read("comm").trim() == name {
            let spent = read("schedstat");
            let nanoseconds = spent.split(' ').next().and_then(|n| n.parse::<f64>().ok());
            return nanoseconds.expect("its time") * 1e-9;
        }
    }
    panic!("no thread {name}");
}

#[test]
fn a_viewer_takes_at_most_five_per_cent_of_a_core() {
    let _alone = alone();
    let program = Program::new();
    let robot = program.unhurried_robot("op3");
    let arguments = ["dance", "--robot", &robot, "--view", "--no-picture", "--quiet"];
    let mut child =
        program.command(&arguments).stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut address = String::new();
    let mut stdout = BufReader::new(child.stdout.take().expect("its output"));
    stdout.read_line(&mut address).expect("the address");
    let address = address.trim().replace("http:", "ws:") + "api/live";
    let host = address.split('/').nth(2).expect("a host");
    let stream = TcpStream::connect(host).expect("a connection");
    let (mut socket, _) = tungstenite::client(&address, stream).expect("a socket");
    let next = |socket: &mut tungstenite::WebSocket<TcpStream>| {
        let text = socket.read().expect("a frame").into_text().expect("text");
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")
    };
    while next(&mut socket)["activity"] != "dancing" {}
    let (before_s, began) = (thread_s(&child, "viewers"), Instant::now());
    let (mut frames, mut moved, mut last) = (0, 0, serde_json::Value::Null);
    while began.elapsed() < Duration::from_secs_f64(WATCHED_S) {
        let frame = next(&mut socket);
        frames += 1;
        moved += u64::from(frame["positions_rad"] != last);
        last = frame["positions_rad"].clone();
    }
    let spent_s = thread_s(&child, "viewers") - before_s;
    let share = spent_s / began.elapsed().as_secs_f64();
    let rate = f64::from(frames) / WATCHED_S;
    println!("{rate:.1} frames a second, {:.2} % of a core", share * 100.0);
    assert!(moved > 10, "the robot moves: {moved} of {frames}");
    assert!(share < 0.05, "{share}");
    signal(&child, "-INT");
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
}

#[test]
fn a_robot_whose_operator_is_gone_holds_and_goes_to_rest() {
    let _alone = alone();
    let program = Program::new();
    let robot = program.unhurried_robot("neck");
    let dance = ["dance", "--robot", &robot, "--view", "--view-dead-man", "1", "--no-picture"];
    program.succeed(&[&dance[..], &["--quiet", "--report", "out.json"]].concat());
    let report = std::fs::read_to_string(program.path("out.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let safety = report["safety"].as_array().expect("a log").iter();
    let causes: Vec<&str> = safety.filter_map(|event| event["cause"].as_str()).collect();
    let at = |words: &str| causes.iter().position(|cause| cause.contains(words));
    let order = ["s: holding", "asked to hold", "going to rest", "stopped on request"].map(at);
    assert!(order.iter().all(Option::is_some) && order.is_sorted(), "{causes:?}");
    assert_eq!(causes.last(), Some(&"torque is off"));
}
