//! CAN motors and adapters that are lost and come back.

mod common;

use common::can::*;
use common::*;
use servodance_drivers::can::CanBus;
use servodance_drivers::{BusConfig, SafeBus, SafetyConfig, ServoLost, State};
use servodance_sim::{ServoFault, SimBus, SimOptions};
use servodance_types::JointState;

struct Rig {
    // Dropped before the motors, so that torque off reaches them.
    safe: SafeBus<CanBus>,
    sim: SimBus,
    states: Vec<JointState>,
    now_s: f64,
    _folder: tempfile::TempDir,
}

fn rig(kind: MotorKind, safety: SafetyConfig) -> Rig {
    let servos = can_robot(kind, 5);
    let folder = tempfile::tempdir().unwrap();
    let options =
        SimOptions { path: Some(folder.path().join("port")), ..SimOptions::lockstep(BITRATE, HZ) };
    let sim = SimBus::start(&specs(&servos), options).unwrap();
    let config = BusConfig { reply_clock: sim.reply_clock(), ..can_patient(kind) };
    let bus = CanBus::open(&sim.port().to_string(), &config, servos).unwrap();
    let mut safe = SafeBus::new(bus, safety).unwrap();
    safe.arm(0.0).unwrap();
    Rig { safe, sim, states: vec![JointState::default(); 5], now_s: 0.0, _folder: folder }
}

impl Rig {
    /// Dances for a while.
    fn dance(&mut self, seconds: f64) -> State {
        for _ in 0..(seconds * HZ).round() as usize {
            let target = 0.4 * (1.0 - (3.0 * self.now_s).cos());
            self.safe.command(self.now_s, &[target; 5]);
            let ticked = self.safe.tick(self.now_s, &mut self.states);
            ticked.unwrap_or_else(|error| panic!("{error}"));
            self.sim.advance(PERIOD_S);
            self.now_s += PERIOD_S;
        }
        self.safe.state()
    }
}

#[test]
fn the_others_dance_on_and_a_rebooted_motor_joins_in_again() {
    for kind in KINDS {
        let mut rig = rig(
            kind,
            SafetyConfig { on_servo_lost: ServoLost::DanceOn, ..SafetyConfig::at_hz(HZ) },
        );
        rig.dance(1.0);
        assert!(rig.sim.set_servo_fault(2, ServoFault::Reboot));
        rig.dance(0.2);
        let torque = |index| rig.sim.servo(index).unwrap().torque_enabled;
        assert!(torque(1) && !torque(2), "{kind:?}");
        assert_eq!(rig.dance(4.0), State::Running, "{kind:?}");
        let (motor, other) = (rig.sim.servo(2).unwrap(), rig.sim.servo(0).unwrap());
        assert!(motor.torque_enabled, "{kind:?}");
        let apart = (motor.position_rad - other.position_rad).abs();
        assert!(apart < 0.05, "{kind:?}: {apart} rad from its neighbour");
        assert_eq!(rig.sim.violations().total(), 0, "{kind:?}: {:?}", rig.sim.violation_notes());
    }
}

#[test]
fn an_adapter_that_comes_back_is_checked_and_armed_again_if_allowed() {
    for kind in KINDS {
        let mut rig = rig(kind, SafetyConfig { rearm: true, ..SafetyConfig::at_hz(HZ) });
        rig.dance(1.0);
        rig.sim.unplug();
        rig.dance(0.5);
        let torque = |sim: &SimBus, index| sim.servo(index).unwrap().torque_enabled;
        let torques = |sim: &SimBus| (0..5).filter(|index| torque(sim, *index)).count();
        // Those without a watchdog hold.
        let held = if kind.has_watchdog() { 0 } else { 5 };
        assert_eq!(torques(&rig.sim), held, "{kind:?}");
        rig.sim.replug().unwrap();
        assert_eq!(rig.dance(3.0), State::Running, "{kind:?}");
        assert_eq!(torques(&rig.sim), 5, "{kind:?}");
        assert_eq!(
            rig.sim.motion_violations().total(),
            0,
            "{kind:?}: {:?}",
            rig.sim.violation_notes()
        );
    }
}
