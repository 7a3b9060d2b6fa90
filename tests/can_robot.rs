//! A robot of CAN motors: it dances on simulated ones, and other programs reach
//! those over both kinds of link.

use crate::program::Program;
use servodance_runtime::robot::Robot;
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use std::io::{BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// The built-in neck, with other motors on `kind`'s bus.
fn robot(program: &Program, kind: &str, model: &str, more: &str) -> &'static str {
    let bus = format!("[bus]\n{more}");
    let text = include_str!("../configs/neck.toml")
        .replace("\"dynamixel2\"", &format!("\"{kind}\""))
        .replace("[bus]\n", &bus)
        .replace("XM430-W350", model)
        .replace("zero_deg = 180.0", "zero_deg = 0.0");
    std::fs::write(program.path("robot.toml"), text).expect("the robot file");
    let urdf = include_str!("../configs/neck.urdf");
    std::fs::write(program.path("neck.urdf"), urdf).expect("the URDF");
    "robot.toml"
}

const KINDS: [(&str, &str, &str); 6] = [
    ("mit", "DM-J4310", ""),
    ("robstride", "RS02", ""),
    ("odrive", "ODrive", "watchdog_endpoints = [153, 154]\n"),
    ("cia402", "CiA402", ""),
    ("myactuator", "RMD-V3", ""),
    ("moteus", "moteus", ""),
];

#[test]
fn every_kind_of_can_motor_dances_inside_its_limits() {
    let program = Program::new();
    program.click_track("clicks.wav", 8.0, 120.0);
    for (kind, model, more) in KINDS {
        let robot = robot(&program, kind, model, more);
        let arguments = ["dance", "clicks.wav", "--robot", robot, "--no-picture"];
        program.succeed(&[&arguments[..], &["--quiet", "--report", "report.json"]].concat());
        let report = std::fs::read(program.path("report.json")).expect("the report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        for limit in ["position", "velocity", "acceleration"] {
            assert_eq!(report["violations"][limit], 0, "{kind}: {report}");
        }
        assert!(report["bus_stats"]["cycles"].as_u64() > Some(500), "{kind}");
        assert_eq!(report["bus_stats"]["retries"], 0, "{kind}");
    }
}

/// `sim-bus`, and the port that its first line names.
fn serve(program: &Program, robot: &str, link: &str) -> (Child, BufReader<ChildStdout>, String) {
    let mut server = program
        .command(&["sim-bus", "--robot", robot, "--link", link])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the server starts");
    let mut lines = BufReader::new(server.stdout.take().expect("its output"));
    let mut port = String::new();
    lines.read_line(&mut port).expect("the first line");
    (server, lines, port.trim().to_owned())
}

#[test]
fn a_served_can_bus_is_danced_on_over_every_link() {
    let program = Program::new();
    program.click_track("clicks.wav", 3.0, 120.0);
    let patient = "watchdog_ms = 2000\nreply_timeout_ms = 500.0\n";
    let robot = robot(&program, "mit", "DM-J4310", patient);
    for (link, kind) in [("slcan", "slcan"), ("unix", "slcan"), ("udp", "udp")] {
        let (server, _lines, port) = serve(&program, robot, link);
        let port = format!("{kind}:{port}");
        let arguments = ["dance", "clicks.wav", "--robot", robot, "--bus", &port];
        program.succeed(&[&arguments[..], &["--no-picture", "--quiet"]].concat());
        let killed = Command::new("kill").arg(server.id().to_string()).status();
        assert!(killed.expect("kill runs").success());
        let ended = server.wait_with_output().expect("it ends");
        assert!(ended.status.success(), "{link}");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(said.contains("limits broken: position 0"), "{link}: {said}");
    }
}

#[test]
fn motors_of_a_killed_program_stop_by_themselves() {
    let program = Program::new();
    for (kind, model, more) in KINDS {
        let patient = format!("reply_timeout_ms = 500.0\n{more}");
        let robot = robot(&program, kind, model, &patient);
        let loaded = Robot::load(&program.path(robot).to_string_lossy()).expect("a robot");
        let specs: Vec<SimServoSpec> = loaded.servos.iter().map(SimServoSpec::from).collect();
        let options = SimOptions::realtime(1_000_000, loaded.control_hz);
        let sim = SimBus::start(&specs, options).expect("a simulated bus");
        let port = sim.port().to_string();
        let mut child = program
            .command(&["dance", "--robot", robot, "--bus", &port, "--no-picture", "--quiet"])
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        let torques = || (0..2).filter(|i| sim.servo(*i).expect("a motor").torque_enabled);
        wait_until(kind, || torques().count() == 2);
        // Let it dance for a while, then kill it.
        std::thread::sleep(Duration::from_millis(500));
        let killed_s = sim.time_s();
        child.kill().expect("it is there");
        child.wait().expect("it is dead");
        wait_until(kind, || torques().count() == 0);
        for index in 0..2 {
            let motor = sim.servo(index).expect("a motor");
            let after_s = motor.tripped_s.expect("its watchdog tripped") - killed_s;
            assert!(after_s < 0.2, "{kind}: torque for {after_s:.3} s more");
        }
    }
}

#[test]
fn scan_finds_can_motors_at_their_bitrate() {
    let program = Program::new();
    let robot = robot(&program, "mit", "DM-J4310", "");
    let robot = Robot::load(&program.path(robot).to_string_lossy()).expect("a robot");
    let specs: Vec<SimServoSpec> = robot.servos.iter().map(SimServoSpec::from).collect();
    let options = SimOptions::realtime(500_000, robot.control_hz);
    let sim = SimBus::start(&specs, options).expect("a simulated bus");
    assert!(sim.set_servo_fault(1, ServoFault::Overload));
    let port = format!("slcan:{}", sim.port_path());
    let found = program.succeed(&["scan", &port]).stdout;
    let found = String::from_utf8_lossy(&found).into_owned();
    let lines: Vec<&str> = found.lines().collect();
    assert_eq!(lines.len(), 2, "{found}");
    for (line, id, error) in
        [(lines[0], "id   1", "no error told"), (lines[1], "id   2", "overload (error E)")]
    {
        for word in ["500000 bit/s  Damiao", "DM-J4310", id, error] {
            assert!(line.contains(word), "no {word:?} in {line}");
        }
    }
    let wrong = program.run(&["scan", &port, "--baud", "250000"]);
    let error = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert_eq!(wrong.status.code(), Some(1), "{error}");
    assert!(error.contains(&port) && error.contains("bus-off"), "{error}");
    program.misused(&["scan", &port, "--protocol", "1"], &["--protocol is for serial"]);
    let group = "udp:239.74.163.2:43990";
    program.misused(&["scan", group, "--baud", "500000"], &["--baud is for slcan"]);
}

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed().as_secs() < 60, "waited too long: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_robot_file_that_asks_too_much_of_the_bus_is_refused_with_the_numbers() {
    let program = Program::new();
    let robot = robot(&program, "mit", "DM-J4310", "");
    let text = std::fs::read_to_string(program.path(robot)).expect("the robot file");
    let slow = text.replace("1_000_000", "20_000");
    std::fs::write(program.path("slow.toml"), slow).expect("the robot file");
    program.refused(
        &["dance", "--robot", "slow.toml"],
        &["2 motors on CAN at 20000 bit/s carry at most 45 cycles a second (444 bits"],
    );
    program.refused(
        &["sim-bus", "--robot", robot, "--link", "pty"],
        &["the robot's motors are on CAN", "slcan, unix or udp"],
    );
}
