//! The registers of single servos through the program: read, written, backed up, restored,
//! reset, watched, and what is refused.

use crate::program::Program;
use servodance_drivers::serial::Register;
use servodance_drivers::serial::dynamixel2::registers as at;
use servodance_drivers::{Framing, SerialScanner};
use servodance_runtime::robot::Robot;
use servodance_sim::{ServoFault, SimBus, SimOptions, SimServoSpec};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Simulated servos of a built-in robot, in real time.
fn servos_of(robot: &str) -> SimBus {
    let robot = Robot::load(robot).expect("the built-in robot");
    let specs: Vec<SimServoSpec> = robot.servos.iter().map(SimServoSpec::from).collect();
    let options = SimOptions::realtime(robot.buses[0].config.baud, robot.control_hz);
    SimBus::start(&specs, options).expect("a simulated bus")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The neck's servos, a port to them, and the program.
struct Bench {
    program: Program,
    bus: SimBus,
}

impl Bench {
    fn new(robot: &str) -> Self {
        Self { program: Program::new(), bus: servos_of(robot) }
    }

    /// The neck with servos of Protocol 1.
    fn of_protocol_1(model: &str) -> Self {
        let program = Program::new();
        let text = include_str!("../configs/neck.toml")
            .replace("\"dynamixel2\"", "\"dynamixel1\"\naccept_no_watchdog = true")
            .replace("XM430-W350", model)
            .replace("zero_deg = 180.0", "zero_deg = 150.0");
        std::fs::write(program.path("neck.toml"), text).expect("the robot file");
        let urdf = include_str!("../configs/neck.urdf");
        std::fs::write(program.path("neck.urdf"), urdf).expect("the URDF");
        let bus = servos_of(program.path("neck.toml").to_str().expect("a path"));
        Self { program, bus }
    }

    /// `servos ACTION PORT --baud 1000000` and more.
    fn on_port<'a>(&'a self, action: &'a str, more: &[&'a str]) -> Vec<&'a str> {
        [&["servos", action, self.bus.port_path(), "--baud", "1000000"], more].concat()
    }

    fn said(&self, arguments: &[&str]) -> String {
        text(&self.program.succeed(arguments).stdout)
    }

    /// What a command that fails says on both outputs, and its exit code.
    fn fails(&self, arguments: &[&str]) -> (String, String, Option<i32>) {
        let run = self.program.run(arguments);
        (text(&run.stdout), text(&run.stderr), run.status.code())
    }

    fn holds(&self, id: u8, register: Register) -> u64 {
        let wait = Duration::from_secs(1);
        let port = self.bus.port_path();
        let scanner = SerialScanner::open(port, 1_000_000, Framing::Protocol2, wait);
        let read = scanner.and_then(|mut scanner| scanner.read(id, register));
        read.expect("an answer").expect("a servo")
    }

    /// Another program turns torque on.
    fn torque_on(&self, id: u8) {
        let wait = Duration::from_secs(1);
        let port = self.bus.port_path();
        let scanner = SerialScanner::open(port, 1_000_000, Framing::Protocol2, wait);
        scanner.and_then(|mut scanner| scanner.set(id, at::TORQUE, 1)).expect("torque");
    }

    fn has_torque(&self, index: usize) -> bool {
        self.bus.servo(index).expect("a servo").torque_enabled
    }
}

#[test]
fn registers_are_read_by_name_with_their_units() {
    let bench = Bench::new("neck");
    assert!(bench.bus.set_servo_fault(1, ServoFault::Moved(12.3f64.to_radians())));
    let read = bench.on_port("read", &["--id", "2"]);
    let two = [&read[..], &["present_position", "operating_mode"]].concat();
    let said = bench.said(&two);
    assert_eq!(said, "present_position 12.3 deg (2188)\noperating_mode   position (3)\n");
    let all = bench.said(&read);
    for (name, value) in
        [("temperature_limit", "80 C (80)"), ("id", "2"), ("baud_rate", "1000000 baud (3)")]
    {
        let is_it = |line: &&str| line.split_once(' ').is_some_and(|(own, _)| own == name);
        let line = all.lines().find(is_it).expect(name);
        assert!(line.ends_with(&format!(" {value}")), "{line}");
    }
    assert!(all.lines().count() > 50, "{all}");

    let robot = bench.program.patient_robot("neck");
    let port = format!("serial:{}", bench.bus.port_path());
    let of_joint = ["servos", "read", &robot, "--bus", &port, "--id", "neck_tilt"];
    let one = [&of_joint[..], &["present_position"]].concat();
    assert_eq!(bench.said(&one), "present_position 12.3 deg (2188)\n");

    let program = &bench.program;
    let unknown = [&read[..], &["present_positon"]].concat();
    program.misused(&unknown, &["present_positon", "present_position", "XM430-W350"]);
    program.misused(&bench.on_port("read", &["--id", "neck_tilt"]), &["neck_tilt", "robot"]);
    program.misused(&["servos", "read", "neck", "--id", "1"], &["neck is a robot", "--bus"]);
    program.refused(&bench.on_port("read", &["--id", "9"]), &["id 9 does not answer"]);
    let nobody = ["servos", "read", &robot, "--bus", &port, "--id", "elbow"];
    program.refused(&nobody, &["elbow", "neck_pan, neck_tilt"]);
    assert!(!bench.has_torque(0) && !bench.has_torque(1));
}

#[test]
fn registers_are_written_with_units_and_read_back() {
    let bench = Bench::new("neck");
    let write =
        |more: &[&str]| bench.said(&[&bench.on_port("write", &["--id", "2"])[..], more].concat());
    let said = write(&["minimum_position_limit=-90deg", "return_delay_time=20 us"]);
    let first = "minimum_position_limit changed from -180.0 deg (0) to -90.0 deg (1024), read back";
    assert!(said.contains(first), "{said}");
    assert_eq!(bench.holds(2, at::MIN_POSITION), 1024);
    assert_eq!(bench.holds(2, at::RETURN_DELAY), 10);
    assert!(write(&["return_delay_time=10"]).contains("is 20 us (10) already"));
    write(&["homing_offset=-17.6deg"]);
    assert_eq!(bench.holds(2, at::HOMING_OFFSET), 0xFFFF_FF38);
    assert_eq!(bench.holds(1, at::HOMING_OFFSET), 0, "the other servo");
}

#[test]
fn permanent_memory_is_not_written_with_torque_on() {
    let bench = Bench::new("neck");
    bench.torque_on(2);
    let write = bench.on_port("write", &["--id", "2"]);
    let both = [&write[..], &["position_p_gain=700", "temperature_limit=70"]].concat();
    bench.program.refused(&both, &["torque is on", "torque_enable=0"]);
    assert_eq!(bench.holds(2, at::POSITION_P), 800, "nothing is half written");
    let let_go = [&write[..], &["torque_enable=off", "temperature_limit=70"]].concat();
    bench.said(&let_go);
    assert!(!bench.has_torque(1));
    assert_eq!(bench.holds(2, at::TEMPERATURE_LIMIT), 70);
}

#[test]
fn what_would_move_a_servo_or_cannot_be_is_wrong_usage_and_writes_nothing() {
    let bench = Bench::new("neck");
    let write = bench.on_port("write", &["--id", "2", "return_delay_time=0"]);
    for (setting, words) in [
        ("torque_enable=1", &["torque_enable", "torque on"][..]),
        ("startup_configuration=1", &["startup_configuration", "torque on"]),
        ("drive_mode=8", &["drive_mode", "torque on"]),
        ("goal_position=2048", &["goal_position", "jog"]),
        ("present_position=1", &["present_position", "only be read"]),
        ("id=5", &["id", "set-id"]),
        ("temperature_limit=101", &["101", "0 to 100"]),
        ("temperature_limit=NaN C", &["NaN C", "0 to 100 C"]),
        ("maximum_position_limit=12V", &["12V", "-180.0 to 179.9 deg"]),
        ("temperatur_limit=70", &["temperatur_limit", "temperature_limit"]),
        ("temperature_limit", &["temperature_limit", "REGISTER=VALUE"]),
    ] {
        bench.program.misused(&[&write[..], &[setting]].concat(), words);
    }
    assert_eq!(bench.holds(2, at::RETURN_DELAY), 250);
    assert!(!bench.has_torque(1));
}

#[test]
fn a_backup_is_restored_where_it_differs_and_nowhere_else() {
    let bench = Bench::new("neck");
    let program = &bench.program;
    let robot = program.patient_robot("neck");
    let port = format!("serial:{}", bench.bus.port_path());
    let servos = |action: &'static str, more: &[&'static str]| {
        let mut words = vec!["servos", action];
        words.extend(more);
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        [words, vec![robot.clone(), "--bus".into(), port.clone()]].concat()
    };
    let run = |words: &[String]| {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        bench.fails(&words)
    };
    let (said, error, code) = run(&servos("backup", &["--out", "neck-servos.toml"]));
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("neck_tilt: XM430-W350 with id 2 at 1000000 baud"), "{said}");
    let file = std::fs::read_to_string(program.path("neck-servos.toml")).expect("the backup");
    assert!(file.contains("temperature_limit = 80  # 80 C\n"), "{file}");
    // An older backup may be all that is left of a servo.
    let (_, error, code) = run(&servos("backup", &["--out", "neck-servos.toml"]));
    assert!(error.contains("--force") && code == Some(1), "{error}");
    let (_, error, code) = run(&servos("backup", &["--out", "neck-servos.toml", "--force"]));
    assert_eq!(code, Some(0), "{error}");

    let restore = servos("restore", &["neck-servos.toml"]);
    let (said, error, code) = run(&restore);
    assert_eq!((said.as_str(), code), ("2 servos hold what the file says\n", Some(0)), "{error}");

    let changed = ["--id", "2", "temperature_limit=70", "homing_offset=100"];
    bench.said(&bench.on_port("write", &changed));
    let (said, error, code) = run(&restore);
    let differs = "neck_tilt: temperature_limit is 70 C (70), the file says 80 C (80)";
    assert!(said.contains(differs) && !said.contains("neck_pan"), "{said}");
    assert!(error.contains("2 registers of neck_tilt") && error.contains("--yes"), "{error}");
    assert_eq!(code, Some(1));
    assert_eq!(bench.holds(2, at::TEMPERATURE_LIMIT), 70);

    bench.torque_on(2);
    let agreed = [restore.clone(), vec!["--yes".into()]].concat();
    let (_, error, code) = run(&agreed);
    assert!(error.contains("torque is on") && code == Some(1), "{error}");
    bench.said(&bench.on_port("write", &["--id", "2", "torque_enable=0"]));
    let (said, error, code) = run(&agreed);
    assert_eq!(code, Some(0), "{error}");
    assert!(said.contains("changed from 70 C (70) to 80 C (80), read back"), "{said}");
    assert_eq!(bench.holds(2, at::TEMPERATURE_LIMIT), 80);
    assert_eq!(bench.holds(2, at::HOMING_OFFSET), 0);
    assert!(!bench.has_torque(0) && !bench.has_torque(1));
}

#[test]
fn a_backup_that_does_not_fit_writes_nothing() {
    let bench = Bench::new("neck");
    let program = &bench.program;
    bench.said(&bench.on_port("backup", &["--out", "good.toml"]));
    let file = std::fs::read_to_string(program.path("good.toml")).expect("the backup");
    assert!(file.contains("return_delay_time = 250"), "{file}");
    for (from, to, words) in [
        ("model_number = 1020", "model_number = 1060", &["XM430-W350", "nothing was written"][..]),
        ("temperature_limit = 80", "temperature_limit = 900", &["temperature_limit", "0 to 100"]),
        ("temperature_limit = 80", "temperature = 80", &["no register", "temperature_limit"]),
        ("startup_configuration = 0", "startup_configuration = 1", &["torque on"]),
        ("version = 1", "version = 2", &["version 2"]),
        ("version = 1", "versions = 1", &["no backup"]),
    ] {
        // What would be written first is right, and differs.
        let bad = file.replace("return_delay_time = 250", "return_delay_time = 7");
        std::fs::write(program.path("bad.toml"), bad.replace(from, to)).expect("a file");
        let port = bench.bus.port_path();
        let restore = ["servos", "restore", "bad.toml", port, "--baud", "1000000", "--yes"];
        program.refused(&restore, words);
    }
    assert_eq!(bench.holds(1, at::RETURN_DELAY), 250);
    assert_eq!(bench.holds(2, at::RETURN_DELAY), 250);

    let robot = program.patient_robot("neck");
    let port = format!("serial:{}", bench.bus.port_path());
    assert!(bench.bus.set_servo_fault(1, ServoFault::Dead));
    let backup = ["servos", "backup", &robot, "--bus", &port, "--out", "half.toml"];
    program.refused(&backup, &["neck_tilt (id 2)", "1000000 baud", "servodance scan"]);
}

#[test]
fn a_factory_reset_says_what_is_lost_and_needs_consent() {
    let bench = Bench::new("neck");
    bench.said(&bench.on_port("write", &["--id", "2", "temperature_limit=70"]));
    let reset = bench.on_port("factory-reset", &["--id", "2"]);
    let (said, error, code) = bench.fails(&reset);
    assert!(said.contains("temperature_limit = 70 C (70)"), "{said}");
    assert!(error.contains("nothing was changed") && error.contains("--yes"), "{error}");
    assert_eq!((error.lines().count(), code), (1, Some(1)));
    assert_eq!(bench.holds(2, at::TEMPERATURE_LIMIT), 70);

    bench.torque_on(2);
    let agreed = [&reset[..], &["--yes"]].concat();
    bench.program.refused(&agreed, &["torque is on"]);
    bench.said(&bench.on_port("write", &["--id", "2", "torque_enable=0"]));
    let said = bench.said(&agreed);
    assert!(said.contains("as it left the factory: id 2, 1000000 baud"), "{said}");
    assert_eq!(bench.holds(2, at::TEMPERATURE_LIMIT), 80);

    let said = bench.said(&[&agreed[..], &["--all"]].concat());
    assert!(said.contains("as it left the factory: id 1, 57600 baud"), "{said}");
    let port = bench.bus.port_path();
    bench.said(&["servos", "read", port, "--baud", "57600", "--id", "1", "model_number"]);
    assert_eq!(bench.holds(1, at::TEMPERATURE_LIMIT), 80, "the other servo");
}

#[test]
fn feetech_servos_keep_what_is_written_over_a_power_cycle() {
    let bench = Bench::new("so101");
    let limits = bench.on_port("write", &["--id", "3", "maximum_angle_limit=90deg"]);
    assert!(bench.said(&limits).contains("to 90.0 deg (3072), read back"));
    bench.said(&bench.on_port("write", &["--id", "3", "position_offset=-100"]));
    bench.said(&bench.on_port("backup", &["--out", "arm.toml"]));
    let file = std::fs::read_to_string(bench.program.path("arm.toml")).expect("the backup");
    assert!(file.contains("position_offset = -100  # -8.8 deg\n"), "{file}");
    assert!(bench.bus.set_servo_fault(2, ServoFault::Unplug));
    let read = bench.on_port("read", &["--id", "3", "maximum_angle_limit", "position_offset"]);
    bench.program.refused(&read, &["id 3 does not answer"]);
    assert!(bench.bus.set_servo_fault(2, ServoFault::Plug));
    // It starts for 0.8 s.
    std::thread::sleep(Duration::from_millis(1200));
    let said = bench.said(&read);
    assert!(said.contains("90.0 deg (3072)") && said.contains("-8.8 deg (-100)"), "{said}");
    let reset = bench.on_port("factory-reset", &["--id", "3", "--yes"]);
    bench.program.refused(&reset, &["STS3215", "no factory reset", "restore"]);
}

#[test]
fn servos_of_protocol_1_are_read_written_and_reset() {
    for (model, middle, registers, factory_baud) in
        [("AX-12A", 512, 32, 1_000_000), ("MX-28(1.0)", 1707, 33, 57_600)]
    {
        let bench = Bench::of_protocol_1(model);
        let all = bench.said(&bench.on_port("read", &["--id", "2"]));
        assert_eq!(all.lines().count(), registers, "{all}");
        assert!(all.contains(&format!("({middle})")), "{model}: {all}");
        let write = bench.on_port("write", &["--id", "2", "temperature_limit=60"]);
        assert!(bench.said(&write).contains("to 60 C (60), read back"));
        let goal = bench.on_port("write", &["--id", "2", "goal_position=300"]);
        bench.program.misused(&goal, &["goal_position", "jog"]);
        let watch = bench.said(&bench.on_port("watch", &["--id", "2", "--count", "1"]));
        assert!(watch.contains("not told"), "{watch}");

        let reset = bench.on_port("factory-reset", &["--id", "2", "--yes"]);
        bench.program.refused(&reset, &["can only forget everything", "--all"]);
        // The other servo has the id that a new one has.
        assert!(bench.bus.set_servo_fault(0, ServoFault::Dead));
        let said = bench.said(&[&reset[..], &["--all"]].concat());
        assert!(said.contains(&format!("id 1, {factory_baud} baud")), "{said}");
        assert!(!bench.has_torque(0) && !bench.has_torque(1));
    }
}

#[test]
fn a_watch_shows_every_servo_until_ctrl_c() {
    let bench = Bench::new("neck");
    let robot = bench.program.patient_robot("neck");
    let port = format!("serial:{}", bench.bus.port_path());
    assert!(bench.bus.set_servo_fault(1, ServoFault::Moved(12.3f64.to_radians())));
    let watch = ["servos", "watch", &robot, "--bus", &port];
    let said = bench.said(&[&watch[..], &["--count", "2"]].concat());
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 6, "{said}");
    for word in ["neck_tilt", "12.3 deg", "0.0 deg/s", "0.000 A", "12.0 V", "25 C", "none"] {
        assert!(lines[2].contains(word), "no {word:?} in {:?}", lines[2]);
    }
    assert!(bench.bus.set_servo_fault(0, ServoFault::Dead));
    let said = bench.said(&[&watch[..], &["--count", "1"]].concat());
    assert!(said.contains("neck_pan") && said.contains("no answer"), "{said}");
    let by_port = bench.on_port("watch", &["--count", "1", "--id", "2"]);
    assert!(bench.said(&by_port).contains("12.3 deg"));

    let mut child =
        bench.program.command(&watch).stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut shown = BufReader::new(child.stdout.take().expect("its output")).lines();
    shown.next().expect("a table").expect("text");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill runs").success());
    let asked = Instant::now();
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed());
}
