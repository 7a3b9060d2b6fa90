//! The safety layer around the driver, judged by the simulated servos.

mod common;

use common::*;
use servodance_drivers::{SafeBus, SafetyConfig, SafetyError, SerialBus, Servo, State};
use servodance_sim::{ServoFault, SimBus};
use servodance_types::JointState;

struct Rig {
    servos: Vec<Servo>,
    // Dropped before the servos, so that torque off reaches them.
    safe: SafeBus<SerialBus>,
    sim: SimBus,
    states: Vec<JointState>,
    now_s: f64,
}

fn rig(joints: u8) -> Rig {
    let servos = robot(joints);
    let sim = lockstep(&servos);
    let bus = driver(&sim, &hasty(), &servos);
    let mut safe = SafeBus::new(bus, SafetyConfig::at_hz(HZ)).unwrap();
    safe.arm(0.0).unwrap();
    Rig { states: vec![JointState::default(); servos.len()], servos, safe, sim, now_s: 0.0 }
}

impl Rig {
    /// One control period, with fresh targets if there are any.
    fn period(&mut self, targets_rad: Option<&[f64]>) -> Result<State, SafetyError> {
        if let Some(targets_rad) = targets_rad {
            self.safe.command(self.now_s, targets_rad);
        }
        let state = self.safe.tick(self.now_s, &mut self.states);
        self.now_s += PERIOD_S;
        self.sim.advance(PERIOD_S);
        state
    }

    fn any_torque(&self) -> bool {
        any_torque(&self.sim, &self.servos)
    }

    fn clean(&self) {
        assert_eq!(self.sim.violations().total(), 0, "{:?}", self.sim.violation_notes());
    }
}

#[test]
fn wild_targets_never_break_a_limit() {
    let mut rig = rig(4);
    let mut noise = 1u32;
    for k in 0..1500 {
        let targets: Vec<f64> = (0..4)
            .map(|_| {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if k % 7 == 0 { f64::from(noise >> 8) / 2e6 - 4.0 } else { 0.5 }
            })
            .collect();
        rig.period(Some(&targets)).unwrap();
    }
    rig.clean();
    let interventions = rig.safe.interventions();
    assert!(interventions.position > 0 && interventions.acceleration > 0, "{interventions:?}");
}

#[test]
fn motion_inside_the_limits_is_sent_unchanged_after_the_ramp() {
    let mut rig = rig(2);
    for k in 0..600 {
        let target = 0.5 * (1.0 - (0.03 * k as f64).cos());
        rig.period(Some(&[target, -0.5 * target])).unwrap();
        if !rig.safe.is_ramping(rig.now_s - PERIOD_S) {
            assert!((rig.safe.sent_rad()[0] - target).abs() < 1e-9, "period {k}");
        }
    }
    assert!(!rig.safe.is_ramping(rig.now_s));
    assert_eq!(rig.safe.interventions(), Default::default());
    rig.clean();
}

#[test]
fn the_ramp_in_is_slow_from_wherever_the_robot_stands() {
    let mut rig = rig(1);
    let mut fastest = 0.0f64;
    for _ in 0..300 {
        rig.period(Some(&[1.5])).unwrap();
        fastest = fastest.max(rig.states[0].velocity_rad_s.abs());
    }
    assert!((rig.states[0].position_rad - 1.5).abs() < 0.02);
    // A quintic over 2 s peaks at 1.875 / 2 of the distance a second.
    assert!(fastest < 1.5, "{fastest} rad/s");
    rig.clean();
}

#[test]
fn stale_motion_turns_torque_off() {
    let mut rig = rig(2);
    for k in 0..300 {
        let target = 0.5 * (1.0 - (0.04 * k as f64).cos());
        rig.period(Some(&[target; 2])).unwrap();
    }
    let mut seen = Vec::new();
    for _ in 0..100 {
        let state = rig.period(None).unwrap();
        if seen.last() != Some(&state) {
            seen.push(state);
        }
    }
    assert_eq!(seen, [State::Running, State::Holding, State::Disarmed]);
    assert!(!rig.any_torque());
    rig.clean();
    let causes: Vec<_> = rig.safe.transitions().iter().map(|t| (t.to, t.cause.as_str())).collect();
    assert_eq!(causes[2], (State::Holding, "targets are 0.260 s old"));
    assert_eq!(causes[4], (State::Disarmed, "torque is off"));
}

#[test]
fn targets_that_come_back_while_holding_resume_gently() {
    let mut rig = rig(1);
    for _ in 0..250 {
        rig.period(Some(&[0.5])).unwrap();
    }
    for _ in 0..50 {
        rig.period(None).unwrap();
    }
    assert_eq!(rig.safe.state(), State::Holding);
    for _ in 0..300 {
        rig.period(Some(&[-0.5])).unwrap();
    }
    assert_eq!(rig.safe.state(), State::Running);
    assert!((rig.states[0].position_rad + 0.5).abs() < 0.02);
    rig.clean();
}

#[test]
fn a_hold_on_request_lasts_as_long_as_targets_are_fresh() {
    let mut rig = rig(2);
    let swing = |now_s: f64| [0.4 * (2.0 * now_s).sin(), -0.4 * (3.0 * now_s).sin()];
    let held = |rig: &Rig| rig.safe.sent_rad().to_vec();
    for _ in 0..400 {
        let targets = swing(rig.now_s);
        rig.period(Some(&targets)).unwrap();
    }
    rig.safe.hold(true);
    let mut pose = Vec::new();
    for k in 0..300 {
        let targets = swing(rig.now_s);
        let state = rig.period(Some(&targets)).unwrap();
        assert_eq!(state, State::Holding);
        if k == 60 {
            pose = held(&rig);
        }
    }
    assert_eq!(held(&rig), pose, "it stands still, far longer than stale targets may");
    assert_eq!(rig.safe.interventions().stale, 0);
    rig.safe.hold(false);
    for _ in 0..400 {
        let targets = swing(rig.now_s);
        assert_eq!(rig.period(Some(&targets)).unwrap(), State::Running);
    }
    let targets = swing(rig.now_s - PERIOD_S);
    assert!((rig.safe.sent_rad()[0] - targets[0]).abs() < 0.01);
    rig.safe.hold(true);
    for _ in 0..200 {
        rig.period(None).unwrap();
    }
    assert_eq!(rig.safe.state(), State::Disarmed, "nobody is there any more");
    rig.clean();
}

#[test]
fn nan_is_held_and_then_stale() {
    let mut rig = rig(1);
    for _ in 0..250 {
        rig.period(Some(&[0.5])).unwrap();
    }
    for _ in 0..20 {
        rig.period(Some(&[f64::NAN])).unwrap();
        assert!((rig.safe.sent_rad()[0] - 0.5).abs() < 1e-9);
    }
    for _ in 0..80 {
        rig.period(Some(&[f64::NAN])).unwrap();
    }
    assert_eq!(rig.safe.interventions().nan, 100);
    assert_eq!(rig.safe.state(), State::Disarmed);
    assert!(!rig.any_torque());
}

#[test]
fn a_blocked_joint_faults_by_name_with_torque_off() {
    let mut rig = rig(3);
    rig.sim.set_servo_fault(1, ServoFault::Jam);
    let error = loop {
        match rig.period(Some(&[1.2; 3])) {
            Ok(_) => assert!(rig.now_s < 5.0, "never noticed"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(error.starts_with("joint_2 (id 2) is "), "{error}");
    assert!(error.ends_with("torque is off"), "{error}");
    assert_eq!(rig.safe.state(), State::Fault);
    assert!(!rig.any_torque());
}

#[test]
fn a_dead_servo_faults_and_the_others_lose_torque() {
    let mut rig = rig(3);
    rig.period(Some(&[0.1; 3])).unwrap();
    rig.sim.set_servo_fault(1, ServoFault::Dead);
    // One lost answer is none; a tenth of a second of them is.
    let error = (0..20).find_map(|_| rig.period(Some(&[0.1; 3])).err()).unwrap().to_string();
    assert!(error.contains("no answer from joint_2 (id 2)"), "{error}");
    assert!(error.contains("torque may still be ON at joint_2 (id 2)"), "{error}");
    assert!(!rig.sim.servo(0).unwrap().torque_enabled);
    // The servo that cannot be reached is stopped by its own watchdog.
    rig.sim.advance(0.3);
    assert!(rig.sim.servo(1).unwrap().watchdog_tripped);
    assert!(matches!(rig.period(None), Err(SafetyError::State { .. })));
}

#[test]
fn disarm_and_drop_end_in_torque_off() {
    let mut rig = rig(2);
    rig.period(Some(&[0.1; 2])).unwrap();
    rig.safe.disarm(rig.now_s, "asked to stop").unwrap();
    assert!(!rig.any_torque());
    rig.safe.arm(rig.now_s).unwrap();
    assert!(rig.any_torque());
    let Rig { servos, safe, sim, .. } = rig;
    drop(safe);
    assert!(!any_torque(&sim, &servos));
}

#[test]
fn a_loop_that_catches_up_does_not_speed_the_motion_up() {
    let mut rig = rig(2);
    let target = |k: usize| 0.7 * (1.0 - (0.05 * k as f64).cos());
    for k in 0..900 {
        // Every 100 periods the loop sleeps for 8 of them and then hurries.
        let hurried = k > 300 && k % 100 < 8;
        let step_s = match k % 100 {
            _ if k <= 300 => PERIOD_S,
            8 => 9.0 * PERIOD_S - 8.0e-3,
            _ if hurried => 1.0e-3,
            _ => PERIOD_S,
        };
        rig.safe.command(rig.now_s, &[target(k); 2]);
        rig.safe.tick(rig.now_s, &mut rig.states).unwrap();
        rig.now_s += step_s;
        rig.sim.advance(step_s);
    }
    assert!(rig.safe.interventions().early > 30, "{:?}", rig.safe.interventions());
    rig.clean();
}

#[test]
fn an_emergency_stop_is_latched_until_it_is_cleared() {
    let mut rig = rig(2);
    rig.period(Some(&[0.1; 2])).unwrap();
    rig.safe.estop().press("the key");
    assert!(matches!(rig.period(Some(&[0.1; 2])), Err(SafetyError::EStop { .. })));
    assert!(!rig.any_torque());
    let refused = rig.safe.arm(rig.now_s).unwrap_err().to_string();
    assert!(refused.starts_with("emergency stop (the key)"), "{refused}");
    rig.safe.estop().clear();
    assert!(!rig.any_torque());
    rig.safe.arm(rig.now_s).unwrap();
    assert!(rig.any_torque());
}
