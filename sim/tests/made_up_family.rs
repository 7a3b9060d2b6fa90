//! A servo family of two registers that neither driver nor simulator knows, brought
//! by this file through the public trait, as `docs/guides/add-a-servo-family.md`
//! leads through it.

use std::f64::consts::{PI, TAU};

use servodance_drivers::serial::{
    ByteMemory, CycleBytes, Firmware, PresentState, Register, Registers, ServoFamily,
};
use servodance_drivers::{
    BusConfig, BusKind, DataSheet, Framing, SafeBus, SafetyConfig, SerialBus, Servo, ServoModel,
};
use servodance_sim::{ByteServo, Protocol1Line, SimBus, SimOptions, SimServoSpec};
use servodance_types::{JointLimits, JointState};

const TORQUE: Register = Register::new(0, 1, "torque");
const POSITION: Register = Register::new(1, 2, "position"); // written: the goal, read: the present

static REGISTERS: Registers =
    Registers { torque: TORQUE, goal: POSITION, present: POSITION, service: None };
static MEMORY: ByteMemory = ByteMemory::bare(&REGISTERS, 3);
static BAUDS: [u32; 1] = [1_000_000];
static MODELS: [ServoModel; 1] = [ServoModel {
    name: "Two-1",
    number: 9001,
    current_a_per_unit: None,
    velocity_rad_s_per_unit: 1.0,
    fast_read_firmware: u8::MAX,
    rad_per_tick: TAU / 4096.0,
    last_tick: 4095,
    bulk_read: false,
    kind: BusKind::Custom,
    sheet: DataSheet::new(2.5, 55.0, 1.4, 12.0),
    motor: None,
}];

struct TwoRegisters;

impl ServoFamily for TwoRegisters {
    fn name(&self) -> &'static str {
        "two registers"
    }

    fn framing(&self) -> Framing {
        Framing::Protocol1
    }

    fn models(&self) -> &'static [ServoModel] {
        &MODELS
    }

    fn bauds(&self, _model: &ServoModel) -> &'static [u32] {
        &BAUDS
    }

    fn registers(&self) -> &'static Registers {
        &REGISTERS
    }

    fn firmware(&self, _model: &ServoModel) -> Firmware {
        Firmware::Bytes(&MEMORY)
    }

    fn cycle_bytes(&self, servos: &[Servo]) -> CycleBytes {
        let bytes = 8 + servos.len() * (3 + 8 + 8); // goals out; a read and its reply each
        CycleBytes { fast: bytes, plain: bytes }
    }

    fn parse(&self, bytes: &[u8]) -> PresentState {
        PresentState { ticks: self.ticks(POSITION.value(bytes)), ..PresentState::default() }
    }

    fn lacks_watchdog(&self) -> Option<&'static str> {
        Some("has two registers and no watchdog")
    }
}

const HZ: f64 = 100.0;

fn servo(id: u8) -> Servo {
    Servo {
        name: format!("joint_{id}"),
        id,
        model: &MODELS[0],
        firmware: None,
        direction: 1.0,
        zero_rad: PI,
        limits: JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.5,
            velocity_rad_s: 4.0,
            acceleration_rad_s2: 40.0,
        },
        motor: None,
        settings: Default::default(),
    }
}

#[test]
fn its_servos_dance_in_the_simulator_inside_their_limits() {
    let servos = [servo(1), servo(2)];
    let options = SimOptions::lockstep(BAUDS[0], HZ);
    let simulated = servos.iter().map(|servo| {
        let spec = SimServoSpec::from(servo);
        ByteServo::new(&spec, servo.model, &MEMORY, BAUDS[0], 12.0, 1.0 / HZ)
    });
    let line = Protocol1Line::new(simulated.collect(), BAUDS[0], 0.0);
    let sim = SimBus::start_line(Box::new(line), options).unwrap();
    let config = BusConfig {
        reply_timeout_ms: 2000.0,
        accept_no_watchdog: true,
        ..BusConfig::of_kind(BusKind::Custom, BAUDS[0])
    };
    let bus = SerialBus::open_family(&TwoRegisters, sim.port_path(), &config, servos.to_vec());

    let mut safe = SafeBus::new(bus.unwrap(), SafetyConfig::at_hz(HZ)).unwrap();
    safe.arm(0.0).unwrap();
    let mut states = [JointState::default(); 2];
    let mut furthest = 0.0f64;
    for cycle in 0..600 {
        let now_s = f64::from(cycle) / HZ;
        safe.command(now_s, &[0.5 * (1.0 - (3.0 * now_s).cos()); 2]);
        safe.tick(now_s, &mut states).unwrap();
        sim.advance(1.0 / HZ);
        furthest = furthest.max(states[1].position_rad);
    }
    assert!((0.9..1.1).contains(&furthest), "{furthest}");
    assert_eq!(sim.violations().total(), 0, "{:?}", sim.violation_notes());
    safe.disarm(6.0, "end").unwrap();
    assert!((0..2).all(|index| !sim.servo(index).unwrap().torque_enabled));
}

#[test]
fn a_robot_file_cannot_name_it() {
    let error = SerialBus::open(
        "/dev/null",
        &BusConfig::of_kind(BusKind::Custom, BAUDS[0]),
        vec![servo(1)],
    );
    let error = error.err().unwrap().to_string();
    assert!(error.contains("open_family"), "{error}");
}

#[test]
fn the_guide_shows_this_file() {
    let guide = include_str!("../../docs/guides/add-a-servo-family.md");
    let own: String = include_str!("made_up_family.rs").split_whitespace().collect();
    let mut shown = 0;
    for block in guide.split("```rust\n").skip(1) {
        let code = block.split("```").next().unwrap_or_default();
        for part in code.split("// ...\n") {
            let part: String = part.split_whitespace().collect();
            assert!(own.contains(&part), "not in the test: {part}");
            shown += part.len();
        }
    }
    assert!(shown > 1000, "only {shown} characters of code");
}
