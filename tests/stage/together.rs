//! Leaders and followers, each a program.

use crate::program::Program;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// A program that is ended with the test, and its lines on standard error.
pub struct Running {
    child: Child,
    lines: Receiver<String>,
}

impl Running {
    pub fn start(program: &Program, words: &[&str]) -> Self {
        let mut child = program
            .command(words)
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("it starts");
        let (sender, lines) = channel();
        let errors = BufReader::new(child.stderr.take().expect("standard error"));
        std::thread::spawn(move || {
            for line in errors.lines().map_while(Result::ok) {
                let _ = sender.send(line);
            }
        });
        Self { child, lines }
    }

    /// A simulated neck that follows whoever leads `at` this endpoint.
    pub fn follow(program: &Program, at: &str, more: &[&str]) -> Self {
        // It is about the network: a starved machine's servos may answer late.
        let robot = program.unhurried_robot("neck");
        let words = ["follow", "--robot", &robot, "--connect", at];
        Self::start(program, &[&words, more].concat())
    }

    /// Waits until it says this.
    pub fn says(&self, word: &str) -> String {
        let mut seen = Vec::new();
        while let Ok(line) = self.lines.recv_timeout(Duration::from_secs(60)) {
            if line.contains(word) {
                return line;
            }
            seen.push(line);
        }
        panic!("it never says {word:?}, only {seen:?}");
    }

    /// Ends it as a user would, and waits.
    pub fn stop(mut self) {
        let pid = nix::unistd::Pid::from_raw(self.child.id() as i32);
        nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGTERM).expect("it is there");
        self.child.wait().expect("it ends");
    }

    /// Its exit status.
    pub fn end(mut self) -> Option<i32> {
        self.child.wait().expect("it ends").code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A port of loopback that nobody has.
pub fn endpoint() -> String {
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    format!("tcp/{}", free.local_addr().expect("an address"))
}

#[test]
fn robots_in_namespaces_are_on_one_beat_and_idle_when_their_leader_is_killed() {
    let program = Program::new();
    let namespaces = Command::new("unshare").args(["--net", "--", "ip", "link"]).output();
    let namespaces = namespaces.is_ok_and(|output| output.status.success());
    let words = "bench stage --followers 3 --delay-ms 20 --loss 0.05 --seconds 10 --json";
    // It is about the network: a starved machine's servos may answer late.
    let robot = program.path(&program.unhurried_robot("neck"));
    let robot = robot.to_str().expect("a path in UTF-8");
    let words: Vec<&str> = words.split(' ').chain(["--robot", robot]).collect();
    let output = match namespaces {
        true => {
            let mut command = Command::new("unshare");
            command.args(["--net", "--", env!("CARGO_BIN_EXE_servodance")]);
            command.args(&words).arg("--namespaces").output()
        }
        false => {
            eprintln!("no network namespaces here (root, Linux): side by side on loopback");
            program.command(&words).output()
        }
    };
    let output = output.expect("it runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    let figures: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(figures["namespaces"], namespaces);
    assert_eq!(figures["violations"], 0, "{figures}");
    assert!(figures["windows"].as_u64() > Some(20), "{figures}");
    let spread_ms = figures["spread_ms_p50"].as_f64().expect("a spread");
    assert!(spread_ms < 10.0, "{figures}");
    // Of the three one came 11 s late: it moves like the others all the same.
    let alike = figures["alike_p50"].as_f64().expect("a share");
    assert!(alike > 0.95, "{figures}");
    assert!(figures["idle_s"].is_number(), "they go on: {figures}");
}

#[test]
fn a_second_leader_is_refused_and_may_take_over() {
    let program = Program::new();
    let (first, second) = (endpoint(), endpoint());
    let leader = Running::start(&program, &["lead", "--listen", &first]);
    leader.says("leading the stage");
    let words = ["lead", "--connect", &first, "--listen", &second];
    program.refused(&words, &["\"main\" has a leader", "--take-over"]);
    let next = Running::start(&program, &[&words[..], &["--take-over"]].concat());
    leader.says("took over");
    assert_eq!(leader.end(), Some(0));
    next.stop();
}

#[test]
fn a_follower_without_a_leader_says_so_and_turns_no_torque_on() {
    let program = Program::new();
    let at = endpoint();
    let follower = Running::follow(&program, &at, &["--report", "f.json"]);
    follower.says(&format!("nobody leads the stage \"main\" at {at}: torque stays off"));
    follower.stop();
    let text = std::fs::read_to_string(program.path("f.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&report["frames"], &report["idled_s"]), (&0.into(), &0.0.into()), "{report}");
}

#[cfg(feature = "view")]
#[test]
fn a_follower_is_seen_on_a_page() {
    let program = Program::new();
    let at = endpoint();
    let leader = Running::start(&program, &["lead", "--listen", &at]);
    leader.says("leading the stage");
    let robot = program.unhurried_robot("neck");
    let words = ["follow", "--robot", &robot, "--connect", &at, "--view"];
    let mut follower = program.command(&words).stdout(Stdio::piped()).spawn().expect("it starts");
    let mut address = String::new();
    let mut lines = BufReader::new(follower.stdout.take().expect("standard output"));
    lines.read_line(&mut address).expect("an address");
    let activity = || {
        let (host, path) = address.trim().strip_prefix("http://")?.split_once('/')?;
        let mut page = std::net::TcpStream::connect(host).ok()?;
        let ask = format!("GET /{path}api/state HTTP/1.1\r\nHost: {host}\r\n\r\n");
        page.write_all(ask.as_bytes()).ok()?;
        let mut answer = String::new();
        page.read_to_string(&mut answer).ok()?;
        let frame: Value = serde_json::from_str(answer.split_once("\r\n\r\n")?.1).ok()?;
        frame["activity"].as_str().map(str::to_owned)
    };
    let began = std::time::Instant::now();
    while activity().as_deref() != Some("dancing") {
        assert!(began.elapsed() < Duration::from_secs(60), "{:?} at {address}", activity());
        std::thread::sleep(Duration::from_millis(200));
    }
    let _ = follower.kill();
    let _ = follower.wait();
    leader.stop();
}

#[test]
fn a_cue_reaches_its_follower() {
    let program = Program::new();
    let at = endpoint();
    program.refused(&["cue", "left", "--connect", &at], &["--mirror"]);
    let nonsense = ["cue", "left", "--amplitude", "7", "--connect", &at];
    program.refused(&nonsense, &["amplitude", "0 to 1"]);
    program.refused(
        &["cue", "left", "--mirror", "--connect", &at],
        &["nobody leads the stage \"main\""],
    );
    let leader = Running::start(&program, &["lead", "--listen", &at]);
    leader.says("leading the stage");
    let cue = ["cue", "left", "--mirror", "--connect", &at];
    program.refused(&cue, &["nobody follows"]);
    let words = ["--name", "left", "--report", "f.json"];
    let follower = Running::follow(&program, &at, &words);
    follower.says("following");
    let cue = ["cue", "left", "--canon", "2", "--mirror", "--connect", &at];
    program.succeed(&cue);
    let cue = ["cue", "lefd", "--mirror", "--connect", &at];
    program.refused(&cue, &["nobody is called \"lefd\"", "left"]);
    program.succeed(&["cue", "all", "--amplitude", "0.5", "--connect", &at]);
    std::thread::sleep(Duration::from_secs(3)); // roles are repeated every second
    follower.stop();
    leader.stop();
    let text = std::fs::read_to_string(program.path("f.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    let role = ["canon_beats", "mirror", "amplitude"].map(|key| report[key].clone());
    let wanted: [Value; 3] = [2.0.into(), true.into(), 0.5.into()];
    assert_eq!(role, wanted, "{report}");
    // Each answer came by both connections, and was taken once.
    assert_eq!(report["dropped"]["unasked"], 0, "{report}");
}
