//! Looking at a bus and setting it up, each tool as a program of its own
//! against simulated servos that judge what it did.

use crate::program::Program;
use crate::torque_off::signal;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::registers as at;
use servodance_drivers::{Framing, SerialScanner};
use servodance_runtime::robot::Robot;
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

#[test]
fn a_fault_that_makes_no_sense_is_refused_with_its_line() {
    let program = Program::new();
    for (fault, says) in [
        ("3s l_elbow dead", "there are wire, adapter, r_sho_pitch"),
        ("soon l_knee dead", "\"soon\" is no time"),
    ] {
        program.refused(&["sim-bus", "--robot", "op3", "--fault", fault], &[says]);
    }
}

#[test]
fn a_served_bus_is_found_by_scan_and_ends_on_sigterm() {
    let program = Program::new();
    for link in ["pty", "unix"] {
        let mut server = program
            .command(&["sim-bus", "--robot", "op3", "--link", link])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the server starts");
        let mut port = String::new();
        BufReader::new(server.stdout.take().expect("its output"))
            .read_line(&mut port)
            .expect("the first line");

        let scan = program.succeed(&["scan", port.trim(), "--baud", "2000000"]);
        let found = String::from_utf8_lossy(&scan.stdout).into_owned();
        assert_eq!(found.lines().count(), 21, "{link}: {found}");
        assert!(found.contains("id 200  OpenCR board (29696)"), "{link}: {found}");
        assert!(found.contains("XM430-W350 (1020)"), "{link}: {found}");

        let killed = Command::new("kill").arg(server.id().to_string()).status();
        assert!(killed.expect("kill runs").success());
        let ended = server.wait_with_output().expect("it ends");
        assert!(ended.status.success(), "{link}");
        assert!(String::from_utf8_lossy(&ended.stderr).contains("0 bad"));
        // A pseudo-terminal's number belongs to whoever asks for one next.
        let left = link == "unix" && std::path::Path::new(port.trim()).exists();
        assert!(!left, "{link}");
    }
}

/// Simulated servos of a built-in robot, in real time, as the judge.
fn servos_of(robot: &str, change: impl Fn(usize, &mut SimServoSpec)) -> SimBus {
    let robot = Robot::load(robot).expect("the built-in robot");
    let mut specs: Vec<SimServoSpec> = robot.servos.iter().map(SimServoSpec::from).collect();
    let indexed = specs.iter_mut().enumerate();
    indexed.for_each(|(index, spec)| change(index, spec));
    let options = SimOptions::realtime(robot.buses[0].config.baud, robot.control_hz);
    SimBus::start(&specs, options).expect("a simulated bus")
}

fn neck() -> SimBus {
    servos_of("neck", |_, _| {})
}

fn serial(bus: &SimBus) -> String {
    format!("serial:{}", bus.port_path())
}

fn degrees(bus: &SimBus, index: usize) -> f64 {
    let servo = bus.servo(index).expect("a servo");
    servo.position_rad.to_degrees()
}

fn torques(bus: &SimBus, count: usize) -> usize {
    let on = |index: &usize| bus.servo(*index).expect("a servo").torque_enabled;
    (0..count).filter(on).count()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn ping_tells_who_a_servo_is_and_how() {
    let (program, bus) = (Program::new(), neck());
    let port = bus.port_path();
    let line = text(&program.succeed(&["ping", port, "2", "--baud", "1000000"]).stdout);
    for word in ["id   2", "XM430-W350 (1020)", "firmware 48", "12.0 V", "torque off", "no error"] {
        assert!(line.contains(word), "no {word:?} in {line}");
    }
    let robot = program.patient_robot("neck");
    assert!(bus.set_servo_fault(1, ServoFault::Moved(0.5)));
    let lines = text(&program.succeed(&["ping", port, "--robot", &robot]).stdout);
    assert_eq!(lines.lines().count(), 2, "{lines}");
    assert!(lines.contains("neck_tilt") && lines.contains("28.7 degrees"), "{lines}");

    let silent = ["ping", port, "9", "--baud", "1000000"];
    program.refused(&silent, &["id 9 does not answer", "servodance scan"]);
    program.misused(&["ping", port], &["--robot"]);
    program.misused(&["ping", port, "neck_pan"], &["neck_pan", "needs --robot"]);
    program.misused(&["ping", port, "254"], &["254", "0 to 253"]);
    let unknown = ["ping", port, "l_knee", "--robot", &robot];
    program.refused(&unknown, &["l_knee", "neck_pan, neck_tilt"]);
    program.refused(&["ping", "/dev/nowhere", "1"], &["/dev/nowhere"]);
    assert!(bus.set_servo_fault(0, ServoFault::Dead));
    program.refused(&["ping", port, "--robot", &robot], &["neck_pan (id 1)"]);
}

#[test]
fn set_id_changes_one_servo_and_refuses_what_cannot_be() {
    let (program, bus) = (Program::new(), neck());
    let port = bus.port_path();
    let set = |old: &'static str, new: &'static str| {
        vec!["set-id", port, old, new, "--baud", "1000000", "--protocol", "2", "--yes"]
    };
    program.refused(&set("1", "2"), &["id 2 is in use by XM430-W350"]);
    program.refused(&set("1", "253"), &["253", "0 to 252"]);
    program.misused(&set("1", "700"), &["700", "0 to 252"]);
    program.misused(&set("1", "1"), &["has id 1 already"]);
    program.refused(&set("8", "9"), &["id 8 does not answer"]);
    let unasked = &set("1", "9")[..8];
    program.refused(unasked, &["XM430-W350 with id 1", "will have id 9", "--yes"]);
    let done = text(&program.succeed(&set("1", "9")).stdout);
    assert_eq!(done, "id 1 is now id 9 (XM430-W350), read back\n");
    program.succeed(&["ping", port, "9", "--baud", "1000000"]);
}

/// Runs the program on a terminal and types `answer`; what it asked and its exit code.
fn typed(program: &Program, arguments: &[&str], answer: &str) -> (String, Option<i32>) {
    let terminal = nix::pty::openpty(None, None).expect("a terminal");
    let mut keyboard = std::fs::File::from(terminal.master);
    let child = program
        .command(arguments)
        .stdin(terminal.slave)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    keyboard.write_all(answer.as_bytes()).expect("typed");
    let output = child.wait_with_output().expect("it ends");
    (text(&output.stderr), output.status.code())
}

#[test]
fn a_change_to_a_live_robot_is_asked_for_first() {
    let (program, bus) = (Program::new(), neck());
    let port = bus.port_path();
    let set = ["set-id", port, "1", "9", "--baud", "1000000"];
    let (asked, code) = typed(&program, &set, "\n");
    assert!(asked.contains("will have id 9 from now on") && asked.contains("[y/N]"), "{asked}");
    assert!(asked.contains("nothing was changed"), "{asked}");
    assert_eq!(code, Some(1));
    program.succeed(&["ping", port, "1", "--baud", "1000000"]);
    let (_, code) = typed(&program, &set, "y\n");
    assert_eq!(code, Some(0));
    program.succeed(&["ping", port, "9", "--baud", "1000000"]);
}

#[test]
fn the_emergency_stop_reaches_a_joint_that_is_jogged() {
    let (program, bus) = (Program::new(), neck());
    let (robot, port) = (program.patient_robot("neck"), serial(&bus));
    let jog = ["jog", "neck_tilt", "--robot", &robot, "--bus", &port, "--yes"];
    let mut command = program.command(&jog);
    let streams = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = streams.spawn().expect("the program starts");
    let start = Instant::now();
    while torques(&bus, 2) == 0 {
        assert!(start.elapsed() < Duration::from_secs(60), "no torque");
        std::thread::sleep(Duration::from_millis(5));
    }
    signal(&child, "-USR1");
    let output = child.wait_with_output().expect("it ends");
    let said = text(&output.stderr);
    assert_eq!((output.status.code(), torques(&bus, 2)), (Some(1), 0), "{said}");
    assert!(said.contains("the signal SIGUSR1"), "{said}");
}

#[test]
fn jog_moves_one_joint_inside_its_limits_and_lets_go() {
    let (program, bus) = (Program::new(), neck());
    let robot = program.patient_robot("neck");
    let port = serial(&bus);
    let jog = |joint: &'static str, step: &'static str| {
        let bus = ["--robot", &robot, "--bus", &port, "--speed", "90", "--yes"];
        [&["jog", joint, step][..], &bus].concat().iter().map(|s| s.to_string()).collect::<Vec<_>>()
    };
    let run = |arguments: &[String]| {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        text(&program.succeed(&arguments).stdout)
    };
    let said = run(&jog("neck_tilt", "--by=12"));
    assert!(said.contains("from 0.0 to 1") && said.contains("torque is off"), "{said}");
    assert!((degrees(&bus, 1) - 12.0).abs() < 1.0, "{}", degrees(&bus, 1));
    assert!(degrees(&bus, 0).abs() < 0.1);
    run(&jog("neck_tilt", "--to=-5"));
    assert!((degrees(&bus, 1) + 5.0).abs() < 1.0, "{}", degrees(&bus, 1));
    assert_eq!(torques(&bus, 2), 0);
    assert_eq!(bus.violations().total(), 0, "{:?}", bus.violation_notes());

    let refused = |arguments: &[String], words: &[&str]| {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        program.refused(&arguments, words);
    };
    refused(&jog("neck_tilt", "--to=60"), &["neck_tilt", "-50.0 to 40.0", "60.0"]);
    program.misused(
        &["jog", "neck_tilt", "--by=inf", "--robot", &robot, "--bus", &port, "--yes"],
        &["no step"],
    );
    refused(&jog("elbow", "--by=1"), &["elbow", "neck_pan, neck_tilt"]);
    let unasked = jog("neck_pan", "--by=1");
    refused(&unasked[..unasked.len() - 1], &["neck_pan (id 1)", "gets torque", "--yes"]);
    let mut fast = jog("neck_pan", "--by=1");
    fast[8] = "5000".into();
    refused(&fast, &["--speed 5000", "230"]);
    assert!(bus.set_servo_fault(0, ServoFault::Dead));
    refused(&jog("neck_pan", "--by=1"), &["neck_pan (id 1)"]);
    assert_eq!(torques(&bus, 2), 0);
}

#[test]
fn jog_takes_steps_from_its_input_until_ctrl_c_lets_go() {
    let (program, bus) = (Program::new(), neck());
    let robot = program.patient_robot("neck");
    let mut child = program
        .command(&["jog", "neck_pan", "--robot", &robot, "--bus", &serial(&bus), "--yes"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut keyboard = child.stdin.take().expect("its input");
    keyboard.write_all(b"4\nwhat\n=900\n=-6\n").expect("typed");
    wait_until("the joint is there", || (degrees(&bus, 0) + 6.0).abs() < 1.0);
    assert_eq!(torques(&bus, 2), 1);
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill runs").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(torques(&bus, 2), 0);
    let errors = text(&output.stderr);
    assert!(errors.contains("\"what\" is no step"), "{errors}");
    assert!(errors.contains("not to 900.0"), "{errors}");
}

fn wait_until(what: &str, done: impl Fn() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited too long for: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn calibrate_makes_the_rest_pose_read_zero_and_keeps_the_rest_of_the_file() {
    let program = Program::new();
    let rests_at_deg = |index: usize| index as f64 * 0.8 - 7.0;
    let bus = servos_of("op3", |index, spec| {
        spec.initial_rad = rests_at_deg(index).to_radians();
    });
    let robot = program.patient_robot("op3");
    let before = std::fs::read_to_string(program.path(&robot)).expect("the file");
    let port = serial(&bus);
    let calibrate = ["calibrate", "--robot", &robot, "--bus", &port];
    program.refused(&calibrate, &["all 20 servos of op3", "--yes"]);
    let same = std::fs::read_to_string(program.path(&robot)).expect("the file");
    assert_eq!(before, same);

    let said = text(&program.succeed(&[&calibrate[..], &["--yes"]].concat()).stdout);
    assert!(said.contains("l_knee") && said.contains("wrote patient-op3.toml"), "{said}");
    let after = std::fs::read_to_string(program.path(&robot)).expect("the file");
    let changed = |(old, new): &(&str, &str)| old != new;
    let changes: Vec<_> = before.lines().zip(after.lines()).filter(changed).collect();
    assert_eq!(before.lines().count(), after.lines().count());
    assert!(changes.iter().all(|(old, _)| old.starts_with("zero_deg")), "{changes:?}");
    assert!(changes.len() >= 19, "{changes:?}");

    let now = text(&program.succeed(&["ping", bus.port_path(), "--robot", &robot]).stdout);
    let zero = |line: &&str| line.contains(" 0.0 degrees") || line.contains(" -0.0 degrees");
    assert_eq!(now.lines().filter(zero).count(), 20, "{now}");
    assert_eq!(torques(&bus, 20), 0);
}

/// What another program left in a servo.
fn left_behind(bus: &SimBus, id: u8, register: Register, value: u64) {
    let wait = Duration::from_secs(1);
    let port = SerialScanner::open(bus.port_path(), 1_000_000, Framing::Protocol2, wait);
    port.and_then(|mut port| port.set(id, register, value)).expect("a register is written");
}

#[test]
fn an_id_that_two_servos_have_is_not_changed() {
    let (program, bus) = (Program::new(), neck());
    assert!(bus.set_servo_fault(1, ServoFault::Id(1)));
    let port = bus.port_path();
    let set = ["set-id", port, "1", "9", "--baud", "1000000", "--protocol", "2", "--yes"];
    let run = program.run(&set);
    let error = text(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{error}");
    assert!(error.contains("id 1") && error.contains("one at a time"), "{error}");
    assert!(program.run(&["ping", port, "9", "--baud", "1000000"]).status.code() == Some(1));
}

#[test]
fn set_baud_changes_rates_and_finds_every_servo_there() {
    let (program, bus) = (Program::new(), neck());
    let port = bus.port_path();
    let set = |who: &str, to: &str| {
        let arguments = ["set-baud", port, who, to, "--protocol", "2", "--yes"];
        text(&program.succeed(&arguments).stdout)
    };
    assert_eq!(set("2", "57600"), "XM430-W350 with id 2: 57600 baud, read back\n");
    program.succeed(&["ping", port, "2", "--baud", "57600"]);
    program.refused(&["ping", port, "2", "--baud", "1000000"], &["id 2 does not answer"]);
    let all = set("all", "1000000");
    assert!(all.contains("id 1 speaks at 1000000 baud already"), "{all}");
    assert!(all.contains("id 2: 1000000 baud, read back"), "{all}");
    let unknown = ["set-baud", port, "2", "250000", "--from", "1000000", "--protocol", "2"];
    program.refused(&unknown, &["knows no 250000 baud", "57600", "4500000"]);
    let unasked = ["set-baud", port, "2", "57600", "--from", "1000000", "--protocol", "2"];
    program.refused(&unasked, &["will speak at 57600 baud", "--yes"]);
    let robot = program.patient_robot("neck");
    set("2", "57600");
    let dance = ["jog", "neck_tilt", "--by=1", "--robot", &robot, "--bus", port, "--yes"];
    program.refused(&dance, &["neck_tilt (id 2)", "at 1000000 baud", "servodance scan"]);
}

#[test]
fn the_doctor_asks_the_servos() {
    let (program, bus) = (Program::new(), neck());
    let port = serial(&bus);
    let ask = ["doctor", "--robot", "neck", "--json", "--bus", &port];
    let found = text(&program.run(&ask).stdout);
    assert!(found.contains("all 2 answer, and are as they should be"), "{found}");
    left_behind(&bus, 2, at::SHUTDOWN, 0);
    let found = text(&program.run(&ask).stdout);
    assert!(found.contains("shutdown is 0, 52 is expected"), "{found}");
    assert!(bus.set_servo_fault(0, ServoFault::Dead));
    let run = program.run(&ask);
    let found = text(&run.stdout);
    assert!(found.contains("no answer from neck_pan (id 1)"), "{found}");
    assert_eq!(run.status.code(), Some(1));
}

#[test]
fn a_servo_in_reverse_or_over_turns_does_not_move_unasked_after_calibration() {
    for (register, value, rests_at_rad) in
        [(at::DRIVE_MODE, 1, 0.3), (at::OPERATING_MODE, 4, 0.3 + std::f64::consts::TAU)]
    {
        let (program, bus) = (Program::new(), neck());
        let robot = program.patient_robot("neck");
        let port = serial(&bus);
        left_behind(&bus, 2, register, value);
        assert!(bus.set_servo_fault(1, ServoFault::Moved(rests_at_rad)));
        let calibrate = ["calibrate", "--robot", &robot, "--bus", &port, "--yes"];
        let said = text(&program.succeed(&calibrate).stdout);
        assert!(said.contains(&format!("{} changed from {value}", register.name)), "{said}");
        let before = degrees(&bus, 1);
        let jog = ["jog", "neck_tilt", "--to=0", "--robot", &robot, "--bus", &port, "--yes"];
        program.succeed(&jog);
        let turned = degrees(&bus, 1) - before;
        assert!(turned.abs() < 0.2, "{}: {turned} degrees", register.name);
    }
}

#[test]
fn servos_check_tells_what_another_program_left_and_puts_it_right() {
    let (program, bus) = (Program::new(), neck());
    let robot = program.patient_robot("neck");
    let port = serial(&bus);
    let check = ["servos", "check", "--robot", &robot, "--bus", &port];
    let well = text(&program.succeed(&check).stdout);
    assert!(well.contains("2 servos, as they should be"), "{well}");
    left_behind(&bus, 2, at::SHUTDOWN, 0);
    let run = program.run(&check);
    let found = text(&run.stdout);
    assert_eq!(run.status.code(), Some(1), "{found}");
    assert!(found.contains("neck_tilt (id 2): shutdown is 0, 52 is expected"), "{found}");
    let fixed = text(&program.succeed(&[&check[..], &["--fix", "--yes"]].concat()).stdout);
    assert!(fixed.contains("shutdown changed from 0 to 52"), "{fixed}");
    program.succeed(&check);
    // What arming would refuse.
    left_behind(&bus, 1, at::MAX_POSITION, 90);
    let run = program.run(&check);
    let found = text(&run.stdout);
    assert_eq!(run.status.code(), Some(1), "{found}");
    assert!(found.contains("neck_pan (id 1): position limits in the servo"), "{found}");
}

#[test]
fn calibrate_turns_round_joints_that_count_the_wrong_way() {
    let (program, bus) = (Program::new(), neck());
    let robot = program.patient_robot("neck");
    let mut child = program
        .command(&["calibrate", "--robot", &robot, "--bus", &serial(&bus), "--directions", "--yes"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut keyboard = child.stdin.take().expect("its input");
    let mut said = BufReader::new(child.stderr.take().expect("what it says")).lines();
    let mut heard = |word: &str| {
        let line = said.next().expect("a line").expect("text");
        assert!(line.contains(word), "{line}");
    };
    heard("zero pose");
    assert!(bus.set_servo_fault(0, ServoFault::Moved(0.05)));
    keyboard.write_all(b"\n").expect("typed");
    heard("positive end");
    // Pan is mounted mirrored: its positive end is where the servo counts down.
    assert!(bus.set_servo_fault(0, ServoFault::Moved(-0.3)));
    assert!(bus.set_servo_fault(1, ServoFault::Moved(0.2)));
    keyboard.write_all(b"\n").expect("typed");
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success());
    let table = text(&output.stdout);
    assert!(table.contains("turned round"), "{table}");
    let robot = Robot::load(program.path(&robot).to_str().expect("a path")).expect("the file");
    assert_eq!(robot.servos[0].direction, -1.0);
    assert_eq!(robot.servos[1].direction, 1.0);
    assert!((robot.servos[0].zero_rad - std::f64::consts::PI - 0.05).abs() < 2e-3);
}

#[test]
fn calibrate_refuses_what_it_cannot_write_or_reach() {
    let (program, bus) = (Program::new(), neck());
    let robot = program.patient_robot("neck");
    let port = serial(&bus);
    program.refused(
        &["calibrate", "--robot", "neck", "--bus", &port, "--yes"],
        &["built in", "servodance robots neck --out"],
    );
    assert!(bus.set_servo_fault(0, ServoFault::Moved(2.5)));
    let before = std::fs::read_to_string(program.path(&robot)).expect("the file");
    let run = program.run(&["calibrate", "--robot", &robot, "--bus", &port, "--yes"]);
    let error = text(&run.stderr);
    assert_eq!(run.status.code(), Some(1));
    assert!(error.contains("horn") && error.contains("neck_pan"), "{error}");
    let same = std::fs::read_to_string(program.path(&robot)).expect("the file");
    assert_eq!(before, same);
}

#[test]
fn scan_finds_feetech_servos_by_their_protocol() {
    let program = Program::new();
    let servos = Robot::load("neck").expect("the robot").servos;
    let specs: Vec<SimServoSpec> = servos
        .iter()
        .map(|servo| SimServoSpec { model_number: 777, ..SimServoSpec::from(servo) })
        .collect();
    let options = SimOptions::realtime(1_000_000, 100.0);
    let bus = SimBus::start(&specs, options).expect("a simulated bus");
    let arguments = ["scan", bus.port_path(), "--baud", "1000000", "--protocol", "1"];
    let found = text(&program.succeed(&arguments).stdout);
    assert_eq!(found.lines().count(), 2, "{found}");
    assert!(found.contains("STS3215 (777)"), "{found}");
    program.refused(&["scan", "/dev/nowhere"], &["/dev/nowhere"]);
    program.refused(&["scan", "can:can0"], &["CAN"]);
    program.misused(&["scan", bus.port_path(), "--baud", "3"], &["--baud 3"]);
}

#[test]
fn bench_bus_tells_its_figures_as_json() {
    let program = Program::new();
    let said = program.succeed(&["bench", "bus", "--robot", "neck", "--json"]);
    let figures: serde_json::Value = serde_json::from_slice(&said.stdout).expect("JSON");
    assert_eq!(figures["link"], "unix", "{figures}");
    let number = |key: &str| figures[key].as_f64().unwrap_or_else(|| panic!("no {key}"));
    // 76 bytes a cycle at 1 Mbps.
    assert!((number("wire_limit_hz") - 1e6 / 760.0).abs() < 1.0, "{figures}");
    assert!(number("hz") > 0.0 && number("hz") <= 1.02 * number("wire_limit_hz"), "{figures}");
    assert!(number("cpu_us_per_cycle") > 0.0 && number("jitter_us_p99") >= 0.0, "{figures}");
    for hz in ["100", "250", "500"] {
        assert!(figures["jitter_us_p99_at_hz"][hz].is_number(), "{figures}");
    }
    program.refused(&["bench", "bus", "--robot", "neck", "--baud", "3"], &["baud is 3"]);
}
