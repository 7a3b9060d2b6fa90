//! From a box of new servos to a dancing robot with the commands of this program alone: id 1,
//! the factory's rate, plugged in one by one.

use crate::program::Program;
use crate::torque_off::alone;
use servodance_drivers::BusLayout;
use servodance_runtime::robot::Robot;
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStderr, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

const CONTROL_PERIOD: Duration = Duration::from_millis(10);
const WATCH_PERIOD: Duration = Duration::from_millis(1);
const DANCES: usize = 5;

/// A box of servos: as new, and none plugged in.
struct NewServos {
    bus: SimBus,
    names: Vec<String>,
}

impl NewServos {
    fn of(robot: &str, change: impl Fn(usize, &mut SimServoSpec)) -> Self {
        let robot = Robot::load(robot).expect("the robot");
        Self::on(&robot.buses[0], change)
    }

    fn on(bus: &BusLayout, change: impl Fn(usize, &mut SimServoSpec)) -> Self {
        let mut specs: Vec<SimServoSpec> = bus.servos.iter().map(SimServoSpec::from).collect();
        let indexed = specs.iter_mut().enumerate();
        indexed.for_each(|(index, spec)| change(index, spec));
        let names: Vec<String> = bus.servos.iter().map(|servo| servo.name.clone()).collect();
        let options = SimOptions::realtime(bus.config.baud, 100.0);
        let bus = SimBus::start(&specs, options).expect("a simulated bus");
        for index in 0..names.len() {
            assert!(bus.set_servo_fault(index, ServoFault::New));
            assert!(bus.set_servo_fault(index, ServoFault::Unplug));
        }
        Self { bus, names }
    }

    fn port(&self) -> String {
        self.bus.port().to_string()
    }

    fn plug(&self, joint: &str) {
        let place = self.names.iter().position(|name| name == joint);
        assert!(self.bus.set_servo_fault(place.expect(joint), ServoFault::Plug));
    }

    fn none_has_torque(&self) -> bool {
        let on = |index: usize| self.bus.servo(index).expect("a servo").torque_enabled;
        !(0..self.names.len()).any(on)
    }
}

/// `robot setup` at work, and the lines that it asks with.
struct Setup {
    child: Child,
    asked: std::io::Lines<BufReader<ChildStderr>>,
}

impl Setup {
    fn start(program: &Program, robot: &str, port: &str, stdin: Stdio, more: &[&str]) -> Self {
        // Several ports stand behind each other, with a space between.
        let setup = ["robot", "setup", robot].into_iter();
        let ports = port.split(' ').flat_map(|port| ["--bus", port]);
        let setup: Vec<&str> = setup.chain(ports).collect();
        let mut child = program
            .command(&[&setup[..], more].concat())
            .stdin(stdin)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let asked = BufReader::new(child.stderr.take().expect("what it asks")).lines();
        Self { child, asked }
    }

    fn awaiting(program: &Program, robot: &str, port: &str) -> Self {
        Self::start(program, robot, port, Stdio::null(), &["--yes"])
    }

    /// The next line that it asks with; empty at the end.
    fn line(&mut self) -> String {
        self.asked.next().map(|line| line.expect("text")).unwrap_or_default()
    }

    /// The joint that it asks for next; none at the end, and what it said then.
    fn joint(&mut self) -> Result<String, String> {
        let line = self.line();
        let asks = line.split_once(", which will have id").map(|(asks, _)| asks);
        let joint = asks.and_then(|asks| asks.split(" for ").last()).map(str::to_owned);
        joint.ok_or(line)
    }

    /// What it printed, and its exit code.
    fn end(self) -> (String, Option<i32>) {
        // What it asks has been read, or is lost with this.
        let output = self.child.wait_with_output().expect("it ends");
        (String::from_utf8_lossy(&output.stdout).into_owned(), output.status.code())
    }
}

/// Dances to clicks in real time, and gives the limits broken at the servos. A machine that
/// keeps the control loop from running for a control period stops the robot short: then once
/// more.
fn violations_of_a_dance(program: &Program, robot: &str, servos: &NewServos) -> u64 {
    let port = servos.port();
    let dance = ["dance", "clicks.wav", "--robot", robot, "--bus", &port, "--no-picture"];
    let _alone = alone();
    for _ in 0..DANCES {
        let before = servos.bus.violations().total();
        let stall = longest_stall(|| {
            program.succeed(&[&dance[..], &["--quiet", "--report", "report.json"]].concat());
        });
        let report = std::fs::read(program.path("report.json")).expect("the report");
        let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
        let share = report["following"]["share"].as_f64().expect("a share");
        assert!(share > 0.9, "{report}");
        let broken = servos.bus.violations().total() - before;
        if broken == 0 || stall < CONTROL_PERIOD {
            return broken;
        }
        eprintln!("a stall of {stall:?}: {:?}", servos.bus.violation_notes());
    }
    panic!("the machine stalled in every one of {DANCES} dances");
}

/// For how long the machine kept a thread from running, at most, during some work.
fn longest_stall(work: impl FnOnce()) -> Duration {
    let (end, ended) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        let watch = scope.spawn(move || {
            let mut longest = Duration::ZERO;
            let mut began = Instant::now();
            while ended.recv_timeout(WATCH_PERIOD) == Err(RecvTimeoutError::Timeout) {
                longest = longest.max(began.elapsed().saturating_sub(WATCH_PERIOD));
                began = Instant::now();
            }
            longest
        });
        work();
        drop(end);
        watch.join().expect("the watch ends")
    })
}

#[test]
fn new_servos_one_by_one_become_a_torso_that_dances() {
    let (program, servos) = (Program::new(), NewServos::of("torso13", |_, _| {}));
    let (robot, port) = (program.unhurried_robot("torso13"), servos.port());
    let mut setup = Setup::awaiting(&program, &robot, &port);
    let mut asked = Vec::new();
    while let Ok(joint) = setup.joint() {
        servos.plug(&joint);
        asked.push(joint);
    }
    let (said, code) = setup.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(asked, servos.names, "each joint once, in order");
    for line in [
        "abs_z: MX-28, id 31, 1000000 baud, read back",
        "return delay time changed from 250 to 0",
        "all 13 servos are set up",
    ] {
        assert!(said.contains(line), "no {line:?} in {said}");
    }
    assert!(servos.none_has_torque());

    let check = ["servos", "check", "--robot", &robot, "--bus", &port];
    let well = String::from_utf8_lossy(&program.succeed(&check).stdout).into_owned();
    assert!(well.contains("13 servos, as they should be"), "{well}");

    program.click_track("clicks.wav", 4.0, 120.0);
    let broken = violations_of_a_dance(&program, &robot, &servos);
    assert_eq!(broken, 0, "{:?}", servos.bus.violation_notes());
    assert!(servos.none_has_torque());
}

#[test]
fn a_set_up_that_was_interrupted_goes_on_where_it_was() {
    let (program, servos) = (Program::new(), NewServos::of("neck", |_, _| {}));
    let (robot, port) = (program.patient_robot("neck"), servos.port());
    let mut setup = Setup::awaiting(&program, &robot, &port);
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    servos.plug("neck_pan");
    assert_eq!(setup.joint().as_deref(), Ok("neck_tilt"));
    setup.child.kill().expect("killed");
    setup.end();

    // This one was killed between its id and its rate.
    servos.plug("neck_tilt");
    std::thread::sleep(Duration::from_millis(500));
    let path = servos.bus.port_path();
    program.succeed(&["set-id", path, "1", "2", "--baud", "57600", "--yes"]);
    let setup = Setup::awaiting(&program, &robot, &port);
    let (said, code) = setup.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("neck_pan: set up already (XM430-W350, id 1, 1000000 baud)"), "{said}");
    assert!(said.contains("neck_tilt: XM430-W350, id 2, 1000000 baud, read back"), "{said}");

    let again = program.succeed(&["robot", "setup", &robot, "--bus", &port, "--yes"]);
    let said = String::from_utf8_lossy(&again.stdout).into_owned();
    assert_eq!(said.matches("set up already").count(), 2, "{said}");
}

#[test]
fn two_new_servos_at_once_are_refused_and_nothing_is_changed() {
    let (program, servos) = (Program::new(), NewServos::of("neck", |_, _| {}));
    let (robot, port) = (program.patient_robot("neck"), servos.port());
    servos.plug("neck_pan");
    servos.plug("neck_tilt");
    let mut setup = Setup::awaiting(&program, &robot, &port);
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    let refused = setup.joint().expect_err("no other joint is asked for");
    assert!(refused.contains("two servos answer to id 1 at 57600 baud"), "{refused}");
    assert!(refused.contains("one at a time"), "{refused}");
    assert_eq!(setup.end().1, Some(1));
    // Both are as they were; and a servo that is not alone may have another id.
    assert!(servos.bus.set_servo_fault(1, ServoFault::Id(7)));
    let mut setup = Setup::awaiting(&program, &robot, &port);
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    let refused = setup.line();
    assert!(refused.contains("several new servos answer"), "{refused}");
    assert!(refused.contains("id 1 at 57600") && refused.contains("id 7 at 57600"), "{refused}");
    assert_eq!(setup.end().1, Some(1));
}

#[test]
fn a_servo_of_another_model_is_refused_and_stays_as_it_is() {
    let program = Program::new();
    let servos = NewServos::of("neck", |index, spec| {
        if index == 0 {
            spec.model_number = 1060; // an XL430-W250
        }
    });
    let (robot, port) = (program.patient_robot("neck"), servos.port());
    servos.plug("neck_pan");
    let mut setup = Setup::awaiting(&program, &robot, &port);
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    let refused = setup.joint().expect_err("no other joint is asked for");
    assert!(refused.contains("XL430-W250 with id 1 at 57600 baud"), "{refused}");
    assert!(refused.contains("neck_pan needs XM430-W350"), "{refused}");
    assert_eq!(setup.end().1, Some(1));
    let path = servos.bus.port_path();
    program.succeed(&["ping", path, "1", "--baud", "57600", "--protocol", "2"]);
    assert!(servos.none_has_torque());
}

#[test]
fn somebody_is_asked_for_each_servo_and_again_for_what_does_not_fit() {
    let (program, servos) = (Program::new(), NewServos::of("neck", |_, _| {}));
    let (robot, port) = (program.patient_robot("neck"), servos.port());
    let unasked = ["robot", "setup", &robot, "--bus", &port];
    program.refused(&unasked, &["no terminal", "--yes"]);

    let terminal = nix::pty::openpty(None, None).expect("a terminal");
    let mut keyboard = std::fs::File::from(terminal.master);
    let mut enter = || keyboard.write_all(b"\n").expect("typed");
    let mut setup = Setup::start(&program, &robot, &port, terminal.slave.into(), &[]);
    let line = setup.line();
    assert!(line.contains("1 of 2: connect one new XM430-W350 for neck_pan"), "{line}");
    assert!(line.contains("press Enter"), "{line}");
    enter();
    assert!(setup.line().contains("no new servo answers at any usual rate"));
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    servos.plug("neck_pan");
    std::thread::sleep(Duration::from_millis(500));
    enter();
    assert_eq!(setup.joint().as_deref(), Ok("neck_tilt"));
    servos.plug("neck_tilt");
    std::thread::sleep(Duration::from_millis(500));
    enter();
    let (said, code) = setup.end();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("neck: all 2 servos are set up"), "{said}");
}

/// The neck on two buses: a servo on a serial line, and this motor on CAN.
fn neck_on_two_buses(program: &Program, kind: &str, motor: &str) -> String {
    let (file, urdf) = ("two-buses.toml", "neck.urdf");
    let configs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let text = std::fs::read_to_string(configs.join("neck.toml")).expect("the neck");
    let serial = "[[bus]]\nname = \"neck\"\nkind = \"dynamixel2\"\nbaud = 1_000_000\n";
    let can = format!("[[bus]]\nname = \"tilt\"\nkind = \"{kind}\"\nbitrate = 1_000_000\n");
    let text = text
        .replace("[bus]\nkind = \"dynamixel2\"\nbaud = 1_000_000\n", &(serial.to_owned() + &can))
        .replace("id = 1\n", "id = 1\nbus = \"neck\"\n");
    let (pan, tilt) = text.split_at(text.rfind("[[joint]]").expect("two joints"));
    let tilt = tilt
        .replace("id = 2\n", "id = 2\nbus = \"tilt\"\n")
        .replace("model = \"XM430-W350\"\n", motor)
        .replace("zero_deg = 180.0", "zero_deg = 0.0");
    std::fs::write(program.path(file), pan.to_owned() + &tilt).expect("the robot file");
    std::fs::copy(configs.join(urdf), program.path(urdf)).expect("the URDF");
    file.into()
}

#[test]
fn a_robot_with_two_buses_is_set_up_bus_by_bus_on_can_too() {
    let program = Program::new();
    let motor = "model = \"DM-J4310\"\nreply_id = 18\n";
    let robot = neck_on_two_buses(&program, "mit", motor);
    let layouts = Robot::load(&program.path(&robot).to_string_lossy()).expect("the robot").buses;
    let [neck, tilt] = [0, 1].map(|place| NewServos::on(&layouts[place], |_, _| {}));
    let ports = format!("neck={} tilt={}", neck.port(), tilt.port());
    let mut setup = Setup::awaiting(&program, &robot, &ports);
    assert_eq!(setup.joint().as_deref(), Ok("neck_pan"));
    neck.plug("neck_pan");
    assert_eq!(setup.joint().as_deref(), Ok("neck_tilt"));
    tilt.plug("neck_tilt");
    let (said, code) = setup.end();
    assert_eq!(code, Some(0), "{said}");
    for line in [
        "bus neck:",
        "bus tilt:",
        "neck_tilt: DM-J4310, id 2, read back",
        "all 2 servos are set up",
    ] {
        assert!(said.contains(line), "no {line:?} in {said}");
    }
    assert!(neck.none_has_torque() && tilt.none_has_torque());

    // Ids of moteus controllers are set by their vendor's program: said before anything is sent.
    let robot = neck_on_two_buses(&program, "moteus", "model = \"moteus\"\n");
    let setup = ["robot", "setup", &robot, "--yes", "--bus", "neck=serial:/dev/null", "--bus"];
    program
        .refused(&[&setup[..], &["tilt=fdcanusb:/dev/null"]].concat(), &["vendor's own program"]);
}

#[test]
fn a_servo_that_is_to_answer_as_new_ones_do_comes_last() {
    let (program, servos) = (Program::new(), NewServos::of("so101", |_, _| {}));
    let (robot, port) = (program.patient_robot("so101"), servos.port());
    let mut setup = Setup::awaiting(&program, &robot, &port);
    let mut asked = Vec::new();
    while let Ok(joint) = setup.joint() {
        servos.plug(&joint);
        asked.push(joint);
    }
    let (said, code) = setup.end();
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(asked.last().map(String::as_str), Some("shoulder_pan"), "{asked:?}");
    assert_eq!(asked.len(), 6, "{asked:?}");
    program.succeed(&["ping", servos.bus.port_path(), "6", "--baud", "1000000"]);
}

#[test]
fn new_servos_are_served_to_any_program_and_plugged_by_what_is_typed() {
    let program = Program::new();
    program.misused(
        &["sim-bus", "--robot", "neck", "--new-servos", "--link", "unix"],
        &["--link pty", "rate"],
    );
    let mut server = program
        .command(&["sim-bus", "--robot", "neck", "--new-servos"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the server starts");
    let mut keyboard = server.stdin.take().expect("its input");
    let mut port = String::new();
    let mut said = BufReader::new(server.stdout.take().expect("its output"));
    said.read_line(&mut port).expect("the first line");
    let ping = ["ping", port.trim(), "1", "--baud", "57600"];
    program.refused(&ping, &["id 1 does not answer"]);
    keyboard.write_all(b"plug neck_pan\nplug elbow\n").expect("typed");
    let mut told = BufReader::new(server.stderr.take().expect("its errors"));
    let mut wrong = String::new();
    told.read_line(&mut wrong).expect("a line");
    assert!(wrong.contains("elbow") && wrong.contains("neck_pan, neck_tilt"), "{wrong}");
    std::thread::sleep(Duration::from_millis(500));
    program.succeed(&ping);
    keyboard.write_all(b"unplug neck_pan\nplug elbow\n").expect("typed");
    told.read_line(&mut wrong).expect("a line");
    program.refused(&ping, &["id 1 does not answer"]);
    server.kill().expect("killed");
    server.wait().expect("it ends");
}
