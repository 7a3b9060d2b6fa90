//! Joints behind a controller of their own, which listens on ROS 2: targets leave as
//! `sensor_msgs/JointState`, states come back as the same.
//!
//! The other end is rosbridge (`rosbridge_server`, a package of every ROS 2 distribution):
//! JSON over a WebSocket. Topics, names and what the controller must do: `docs/ros2.md`.
//!
//! Real-time promise: the socket never blocks; a cycle writes one message and takes those
//! that have come. Refused before the first target: a joint that no state names within two
//! seconds, one that stands outside its limits. While armed: states that stay away for half a
//! second, and a socket that takes no more.
//!
//! This side cannot turn torque off. It says `enabled = false` and is silent; the controller
//! is to release or hold the joints when it hears that, or nothing for 0.2 s.

mod address;
mod messages;
mod socket;

use std::time::{Duration, Instant};

use servodance_types::JointState;

pub use self::address::Ros2Address;
use self::messages::{JointMessage, Topics};
use self::socket::Socket;
use crate::bus::{Bus, BusStats, Notes};
use crate::error::{BusError, BusResult, ServoId};
use crate::servo::{Servo, check_cycle};

/// How long every joint's first state may take.
const FIRST_STATES: Duration = Duration::from_secs(2);
/// States older than this are no states.
const STALE: Duration = Duration::from_millis(500);
const WAIT: Duration = Duration::from_millis(5);

/// A bus of joints behind rosbridge.
pub struct Ros2Bus {
    socket: Socket,
    topics: Topics,
    servos: Vec<Servo>,
    states: Vec<JointState>,
    heard: Vec<Option<Instant>>,
    armed: bool,
    stats: BusStats,
}

impl Ros2Bus {
    /// Connects and subscribes to the joints' states. Nothing is commanded before
    /// [`Bus::engage`].
    pub fn open(address: &Ros2Address, servos: Vec<Servo>) -> BusResult<Self> {
        let topics = Topics::of(address);
        let mut socket = Socket::open(address)?;
        for line in topics.introduction() {
            socket.send(line)?;
        }
        Ok(Self {
            socket,
            topics,
            states: vec![JointState::default(); servos.len()],
            heard: vec![None; servos.len()],
            servos,
            armed: false,
            stats: BusStats::default(),
        })
    }

    /// Takes in every message that has come.
    fn listen(&mut self) -> BusResult<()> {
        while let Some(text) = self.socket.receive()? {
            let Some(message) = JointMessage::read(&text, &self.topics.states) else { continue };
            self.stats.packets += 1;
            self.stats.bytes += text.len() as u64;
            let now = Instant::now();
            for (index, servo) in self.servos.iter().enumerate() {
                if let Some(state) = message.state(&servo.name) {
                    self.states[index] = state;
                    self.heard[index] = Some(now);
                }
            }
        }
        Ok(())
    }

    fn unheard_for(&self, limit: Duration) -> Vec<ServoId> {
        let old = |heard: &Option<Instant>| heard.is_none_or(|at| at.elapsed() > limit);
        let pairs = self.servos.iter().zip(&self.heard);
        pairs.filter(|(_, heard)| old(heard)).map(|(servo, _)| ServoId::of(servo)).collect()
    }

    fn wait_for_all(&mut self, doing: &'static str) -> BusResult<()> {
        let until = Instant::now() + FIRST_STATES;
        loop {
            self.listen()?;
            let silent = self.unheard_for(STALE);
            if silent.is_empty() {
                return Ok(());
            }
            if Instant::now() >= until {
                let hint = format!("; is {} published?", self.topics.states);
                return Err(BusError::Silent { servos: silent, doing, tries: 1, hint });
            }
            std::thread::sleep(WAIT);
        }
    }

    fn enable(&mut self, enabled: bool) -> BusResult<()> {
        self.socket.send(self.topics.enabled(enabled))
    }
}

impl Bus for Ros2Bus {
    fn servos(&self) -> &[Servo] {
        &self.servos
    }

    fn observe(&mut self) -> BusResult<Vec<JointState>> {
        self.wait_for_all("state")?;
        Ok(self.states.clone())
    }

    fn prepare(&mut self) -> BusResult<Notes> {
        self.enable(false)?;
        self.wait_for_all("state")?;
        for (servo, state) in self.servos.iter().zip(&self.states) {
            servo.holding_rad(state.position_rad)?;
        }
        Ok(vec![format!(
            "torque is the controller's: it must let go when {} says false, or nothing comes",
            self.topics.enabled
        )])
    }

    fn engage(&mut self) -> BusResult<Vec<JointState>> {
        self.wait_for_all("state")?;
        let pairs = self.servos.iter().zip(&self.states);
        let holds: BusResult<Vec<f64>> =
            pairs.map(|(servo, state)| servo.holding_rad(state.position_rad)).collect();
        let holds = holds?;
        self.armed = true;
        self.enable(true)?;
        let mut states = self.states.clone();
        self.cycle(&holds, &mut states)?;
        Ok(states)
    }

    fn cycle(&mut self, targets_rad: &[f64], states: &mut [JointState]) -> BusResult<()> {
        check_cycle(&self.servos, targets_rad, states.len())?;
        if !self.armed {
            return Err(BusError::NotArmed);
        }
        self.stats.cycles += 1;
        let inside = self.servos.iter().zip(targets_rad);
        let inside = inside.map(|(servo, target)| servo.limits.clamp_rad(*target));
        let message = self.topics.command(self.servos.iter().map(|s| s.name.as_str()), inside);
        self.socket.send(message)?;
        self.listen()?;
        let silent = self.unheard_for(STALE);
        if !silent.is_empty() {
            self.stats.unheard += 1;
            let hint = format!("; {} stays away", self.topics.states);
            return Err(BusError::Silent { servos: silent, doing: "state", tries: 1, hint });
        }
        states.copy_from_slice(&self.states);
        Ok(())
    }

    fn disarm(&mut self) -> BusResult<()> {
        self.armed = false;
        self.enable(false).map_err(|error| BusError::TorqueUnverified {
            servos: self.servos.iter().map(ServoId::of).collect(),
            reason: error.to_string(),
        })
    }

    fn is_armed(&self) -> bool {
        self.armed
    }

    fn stats(&self) -> BusStats {
        self.stats
    }
}

impl Drop for Ros2Bus {
    fn drop(&mut self) {
        if self.armed {
            // Nobody is left to hear of an error; silence says the same to the controller.
            let _ = self.enable(false);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Mutex};
    use std::thread::JoinHandle;

    use servodance_types::JointLimits;
    use tungstenite::{Message, accept};

    use super::*;
    use crate::servo::SerialSettings;
    use crate::servo::model::ServoModel;

    /// A controller behind rosbridge: its joints are where they were told to be, and it says so
    /// until it is hushed.
    struct Controller {
        address: Ros2Address,
        enabled: Arc<Mutex<Vec<bool>>>,
        hushed: Arc<AtomicBool>,
        thread: Option<JoinHandle<()>>,
    }

    fn run(listener: TcpListener, enabled: &Mutex<Vec<bool>>, hushed: &AtomicBool) {
        let (stream, _) = listener.accept().unwrap();
        let mut socket = accept(stream).unwrap();
        socket.get_ref().set_read_timeout(Some(Duration::from_millis(2))).unwrap();
        let mut at = vec![0.25, -0.5];
        loop {
            match socket.read() {
                Ok(Message::Text(text)) => {
                    let said: serde_json::Value = serde_json::from_str(text.as_str()).unwrap();
                    match (said["op"].as_str().unwrap(), said["topic"].as_str().unwrap()) {
                        ("publish", "/test/joint_commands") => {
                            assert_eq!(said["msg"]["name"], serde_json::json!(["hip", "knee"]));
                            let told = said["msg"]["position"].as_array().unwrap();
                            at = told.iter().map(|value| value.as_f64().unwrap()).collect();
                        }
                        ("publish", "/test/enabled") => {
                            enabled.lock().unwrap().push(said["msg"]["data"].as_bool().unwrap());
                        }
                        ("advertise" | "subscribe", _) => {}
                        other => panic!("{other:?}"),
                    }
                }
                Err(tungstenite::Error::Io(error))
                    if error.kind() == std::io::ErrorKind::WouldBlock => {}
                Ok(_) => {}
                Err(_) => return,
            }
            if !hushed.load(Ordering::Relaxed) {
                let state = serde_json::json!({
                    "op": "publish", "topic": "/test/joint_states",
                    "msg": {"name": ["knee", "hip"], "position": [at[1], at[0]], "velocity": []},
                });
                let _ = socket.send(Message::text(state.to_string()));
            }
        }
    }

    impl Controller {
        fn start() -> Self {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let place = listener.local_addr().unwrap();
            let (enabled, hushed) = (Arc::default(), Arc::new(AtomicBool::new(false)));
            let shared = (Arc::clone(&enabled), Arc::clone(&hushed));
            let thread = std::thread::spawn(move || run(listener, &shared.0, &shared.1));
            let address = Ros2Address::parse(&format!("{place}/test")).unwrap();
            Self { address, enabled, hushed, thread: Some(thread) }
        }

        fn said(&mut self) -> Vec<bool> {
            self.thread.take().unwrap().join().unwrap();
            self.enabled.lock().unwrap().clone()
        }
    }

    fn servo(name: &str, id: u8) -> Servo {
        let limits = JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.0,
            velocity_rad_s: 4.0,
            acceleration_rad_s2: 40.0,
        };
        Servo {
            name: name.into(),
            id,
            model: ServoModel::from_name("XM430-W350").unwrap(),
            firmware: None,
            direction: 1.0,
            zero_rad: 0.0,
            limits,
            motor: None,
            settings: SerialSettings::default(),
        }
    }

    fn servos() -> Vec<Servo> {
        vec![servo("hip", 1), servo("knee", 2)]
    }

    #[test]
    fn targets_reach_the_controller_and_states_come_back() {
        let mut controller = Controller::start();
        let mut bus = Ros2Bus::open(&controller.address, servos()).unwrap();
        let armed = bus.arm().unwrap();
        assert_eq!(armed.states[0].position_rad, 0.25);
        assert!(armed.notes[0].contains("/test/enabled"), "{:?}", armed.notes);
        let mut states = armed.states;
        for _ in 0..100 {
            bus.cycle(&[0.4, -9.0], &mut states).unwrap();
            std::thread::sleep(Duration::from_millis(2));
        }
        // Never beyond a limit, whatever is asked.
        assert_eq!([states[0].position_rad, states[1].position_rad], [0.4, -1.0]);
        bus.disarm().unwrap();
        drop(bus);
        assert_eq!(controller.said(), [false, true, false]);
    }

    #[test]
    fn states_that_stay_away_end_it_with_the_joints_named() {
        let mut controller = Controller::start();
        let mut bus = Ros2Bus::open(&controller.address, servos()).unwrap();
        let mut states = bus.arm().unwrap().states;
        controller.hushed.store(true, Ordering::Relaxed);
        let begun = Instant::now();
        let error = loop {
            match bus.cycle(&[0.0, 0.0], &mut states) {
                Ok(()) => std::thread::sleep(Duration::from_millis(5)),
                Err(error) => break error.to_string(),
            }
            assert!(begun.elapsed() < Duration::from_secs(5));
        };
        assert!(error.contains("hip (id 1), knee (id 2)"), "{error}");
        assert!(error.contains("/test/joint_states"), "{error}");
        drop(bus);
        assert_eq!(controller.said(), [false, true, false]);
    }

    #[test]
    fn a_controller_that_is_not_there_is_told() {
        let address = Ros2Address::parse("127.0.0.1:9").unwrap();
        let Err(error) = Ros2Bus::open(&address, servos()) else { panic!("opened") };
        assert!(error.to_string().contains("is rosbridge_server running there?"), "{error}");
    }
}
