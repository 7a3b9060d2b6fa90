//! Every way out ends in torque off. The judge is a simulated bus of the
//! test's own: the program opens it as a serial port, as it would real servos.

use crate::program::Program;
use servodance_runtime::robot::Robot;
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

/// These dances live in real time: one at a time, so that they do not starve
/// each other on a small machine.
static REAL_TIME: Mutex<()> = Mutex::new(());

pub fn alone() -> MutexGuard<'static, ()> {
    REAL_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The servos of the built-in humanoid, in real time.
fn servos() -> SimBus {
    let robot = Robot::load("op3").expect("the built-in robot");
    let specs: Vec<SimServoSpec> = robot.servos.iter().map(SimServoSpec::from).collect();
    let options = SimOptions::realtime(robot.buses[0].config.baud, robot.control_hz);
    SimBus::start(&specs, options).expect("a simulated bus")
}

fn torques(bus: &SimBus) -> usize {
    (0..20).filter(|i| bus.servo(*i).expect("a servo").torque_enabled).count()
}

/// Starts a dance on the bus and waits until every servo has torque.
fn dancing(program: &Program, bus: &SimBus) -> Child {
    dancing_with(program, bus, &[])
}

fn dancing_with(program: &Program, bus: &SimBus, more: &[&str]) -> Child {
    dancing_at(program, bus, more, Stdio::null())
}

fn dancing_at(program: &Program, bus: &SimBus, more: &[&str], input: Stdio) -> Child {
    let more = [&["--no-picture", "--quiet"], more].concat();
    let mut child = dance_command(program, bus, &more)
        .stdin(input)
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    wait_until("all torques on", || {
        if child.try_wait().expect("its state").is_some() {
            let mut error = String::new();
            let stderr = child.stderr.as_mut().expect("its errors");
            stderr.read_to_string(&mut error).expect("text");
            panic!("it ended early: {error}");
        }
        torques(bus) == 20
    });
    child
}

fn dance_command(program: &Program, bus: &SimBus, more: &[&str]) -> Command {
    let port = format!("serial:{}", bus.port_path());
    let robot = program.patient_robot("op3");
    program.command(&[&["dance", "--robot", &robot, "--bus", &port], more].concat())
}

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "waited too long for: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(status.expect("kill runs").success());
}

#[test]
fn ctrl_c_turns_torque_off() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let child = dancing(&program, &bus);
    signal(&child, "-INT");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(torques(&bus), 0);
    assert!(String::from_utf8_lossy(&output.stderr).contains("torque is off"));
}

#[test]
fn every_signal_that_ends_it_turns_torque_off() {
    let _alone = alone();
    // Ctrl-Z too: a suspended program would leave torque on.
    for name in ["-TERM", "-HUP", "-QUIT", "-TSTP"] {
        let (program, bus) = (Program::new(), servos());
        let child = dancing(&program, &bus);
        signal(&child, name);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!((output.status.code(), torques(&bus)), (Some(130), 0), "{name}");
    }
}

#[test]
fn a_measurement_that_is_stopped_says_so() {
    let _alone = alone();
    let program = Program::new();
    let mut command = program.command(&["latency", "--robot", "neck", "--clicks", "900"]);
    let mut child = command.stderr(Stdio::piped()).spawn().expect("it starts");
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(child.try_wait().expect("its state"), None);
    signal(&child, "-INT");
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!((output.status.code(), said.trim()), (Some(130), "stopped; torque is off"));
}

#[test]
fn each_emergency_stop_turns_torque_off_and_is_named() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let stopped = |child: Child, says: &str| {
        let output = child.wait_with_output().expect("it ends");
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("emergency stop") && error.contains(says), "{error}");
        assert_eq!(torques(&bus), 0);
    };
    let child = dancing(&program, &bus);
    signal(&child, "-USR1");
    stopped(child, "the signal SIGUSR1");

    let file = program.path("stop");
    let name = file.to_str().expect("text");
    std::fs::write(&file, "0\n").expect("a released button");
    let child = dancing_with(&program, &bus, &["--estop-file", name]);
    std::fs::write(&file, "1\n").expect("a pressed button");
    stopped(child, "the file ");

    // It is still down: no torque at all.
    let port = format!("serial:{}", bus.port_path());
    program.refused(
        &["dance", "--bus", &port, "--estop-file", name, "--no-picture"],
        &["emergency stop"],
    );
    assert_eq!(torques(&bus), 0);
}

#[test]
fn enter_on_the_terminal_is_an_emergency_stop() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let terminal = nix::pty::openpty(None, None).expect("a terminal");
    let mut keyboard = std::fs::File::from(terminal.master);
    let child = dancing_at(&program, &bus, &[], Stdio::from(terminal.slave));
    // Ctrl-D first: the end of the input takes no key away.
    keyboard.write_all(b"\x04").expect("typed");
    std::thread::sleep(Duration::from_millis(300));
    keyboard.write_all(b"\n").expect("typed");
    let output = child.wait_with_output().expect("it ends");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("emergency stop (the key)"), "{error}");
    assert_eq!(torques(&bus), 0);
}

#[test]
fn a_terminal_that_takes_no_text_holds_nothing_up() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let terminal = nix::pty::openpty(None, None).expect("a terminal");
    let (screen, line) = (std::fs::File::from(terminal.master), terminal.slave);
    let mut command = dance_command(&program, &bus, &["--no-picture"]);
    let own = line.try_clone().expect("the line");
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::from(own));
    let mut child = command.spawn().expect("the program starts");
    wait_until("all torques on", || torques(&bus) == 20);
    // As Ctrl-S does; what is written waits from now on.
    nix::sys::termios::tcflow(&line, nix::sys::termios::FlowArg::TCOOFF).expect("it holds");
    std::thread::sleep(Duration::from_secs(3));
    signal(&child, "-USR1");
    wait_until("all torques off", || torques(&bus) == 0);
    nix::sys::termios::tcflow(&line, nix::sys::termios::FlowArg::TCOON).expect("it goes on");
    assert_eq!(child.wait().expect("it ends").code(), Some(1));
    drop(screen);
}

#[test]
fn a_file_that_may_not_grow_ends_no_dance_with_torque_on() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let recording = program.path("dance.mcap");
    let args = ["--quiet", "--no-picture", "--record", recording.to_str().expect("text")];
    let dance = dance_command(&program, &bus, &args);
    let mut limited = Command::new("sh");
    limited.args(["-c", "ulimit -f 100; exec \"$@\"", "sh"]).arg(dance.get_program());
    limited.args(dance.get_args()).stderr(Stdio::piped()).stdout(Stdio::null());
    if let Some(folder) = dance.get_current_dir() {
        limited.current_dir(folder);
    }
    let child = limited.spawn().expect("it starts");
    let output = child.wait_with_output().expect("it ends");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), torques(&bus)), (Some(1), 0), "{error}");
    assert!(error.contains("File too large"), "{error}");
}

#[test]
fn a_killed_program_leaves_servos_that_stop_by_themselves() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let mut child = dancing(&program, &bus);
    signal(&child, "-KILL");
    child.wait().expect("it is dead");
    let still = || (0..20).all(|i| bus.servo(i).expect("a servo").velocity_rad_s.abs() < 0.01);
    wait_until("every servo stands still", still);
    std::thread::sleep(Duration::from_millis(300));
    let before: Vec<f64> = (0..20).map(|i| bus.servo(i).expect("a servo").position_rad).collect();
    std::thread::sleep(Duration::from_millis(300));
    for (i, before) in before.iter().enumerate() {
        let after = bus.servo(i).expect("a servo").position_rad;
        assert!((after - before).abs() < 0.01, "servo {i} moves on its own");
    }
}

#[test]
fn a_servo_that_dies_is_named_and_the_others_lose_torque() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let child = dancing_with(&program, &bus, &["--record", "x.mcap", "--report", "x.json"]);
    // Torque comes on before arming is over, and what cannot be armed is no dance.
    let knee = || bus.servo(12).expect("a servo").position_rad;
    let at_first = knee();
    wait_until("movement", || (knee() - at_first).abs() > 0.02);
    assert!(bus.set_servo_fault(12, ServoFault::Dead));
    let output = child.wait_with_output().expect("it ends");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("r_knee") && error.contains("13"), "{error}");
    let powered: Vec<usize> =
        (0..20).filter(|i| *i != 12 && bus.servo(*i).expect("a servo").torque_enabled).collect();
    assert!(powered.is_empty(), "still powered: {powered:?}");
    // What went wrong can be looked at.
    let report = std::fs::read_to_string(program.path("x.json")).expect("a report");
    assert!(report.contains("r_knee"), "{report}");
    let recording = std::fs::metadata(program.path("x.mcap")).expect("a recording");
    assert!(recording.len() > 1000);
}

#[test]
fn a_servo_that_is_waited_for_in_vain_ends_the_dance() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    let waits = ["--set", "safety.on_servo_lost=hold", "--set", "safety.rejoin_s=1.15"];
    let child = dancing_with(&program, &bus, &waits);
    std::thread::sleep(Duration::from_secs(1));
    // So hot that it shuts down again whenever it is rebooted.
    assert!(bus.set_servo_fault(3, ServoFault::Overheat(150.0)));
    let output = child.wait_with_output().expect("it ends");
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), torques(&bus)), (Some(1), 0), "{error}");
    // The other: torque off was asked for while that servo rebooted.
    assert!(error.contains("did not come back") || error.contains("may still be ON"), "{error}");
}

#[test]
fn a_servo_that_does_not_answer_is_named_before_any_torque() {
    let _alone = alone();
    let (program, bus) = (Program::new(), servos());
    assert!(bus.set_servo_fault(4, ServoFault::Dead));
    let port = format!("serial:{}", bus.port_path());
    program.refused(&["dance", "--bus", &port, "--picture", "out.png"], &["r_el", "5"]);
    assert_eq!(torques(&bus), 0);
}
