//! Damaged input for every CAN parser: lines, datagrams, replies, commands.
//!
//! Replies come from simulated motors and are damaged on their way to the
//! driver, which arms, dances and disarms as well as they let it; nothing waits,
//! so that a run is as many inputs as frames were heard.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use servodance_drivers::can::transport::{slcan, udp};
use servodance_drivers::can::{CanBus, CanEvent, CanFault, CanFrame, CanLink, CanScanner, Sent};
use servodance_drivers::{Bus, BusConfig, BusKind, Servo, ServoConfig, servos};
use servodance_sim::can::{WATCHDOG_ENDPOINTS, build_net};
use servodance_sim::{Line, SimOptions, SimServoSpec};
use servodance_types::JointState;

/// Kind and model of every protocol.
pub const MODELS: [(BusKind, &str); 5] = [
    (BusKind::Mit, "AK80-9"),
    (BusKind::Mit, "DM-J4310"),
    (BusKind::Robstride, "RS02"),
    (BusKind::Odrive, "ODrive"),
    (BusKind::Cia402, "CiA402"),
];

/// SplitMix64.
#[derive(Clone, Debug)]
pub struct Dice(pub u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }

    fn damage(&mut self, bytes: &mut Vec<u8>) {
        for _ in 0..self.below(4) {
            let at = self.below(bytes.len());
            match self.below(3) {
                0 if at < bytes.len() => bytes[at] = self.next() as u8,
                1 => bytes.truncate(at),
                _ => bytes.insert(at.min(bytes.len()), self.next() as u8),
            }
        }
    }

    /// A frame as motors would get or send it, or nearly.
    fn frame(&mut self) -> CanFrame {
        const IDS: [u32; 16] = [
            0, 1, 2, 0x80, 0x101, 0x181, 0x201, 0x581, 0x601, 0x701, 0x77F, 0x7FF, 0x21, 0x24,
            0x29, 0x2C,
        ];
        const LIKELY: [u8; 12] = [0, 1, 2, 0xFF, 0xFC, 0xFD, 0x33, 0x55, 0x40, 0x2B, 0x60, 0x70];
        let data: Vec<u8> = (0..self.below(9))
            .map(|_| match self.below(2) {
                0 => self.next() as u8,
                _ => LIKELY[self.below(LIKELY.len())],
            })
            .collect();
        let frame = match self.below(3) {
            0 => {
                let kind = [0, 1, 2, 3, 4, 6, 17, 18, 21, 31][self.below(10)];
                let id = kind << 24 | (self.next() as u32 & 0xFF) << 16 | 0xFD01;
                CanFrame::extended(id, &data)
            }
            1 => CanFrame::standard(self.next() as u32, &data),
            _ => CanFrame::standard(IDS[self.below(IDS.len())], &data),
        };
        match self.below(12) {
            0 => frame.into_remote(self.below(9) as u8),
            _ => frame,
        }
    }
}

/// What was fed, and what came of it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    pub inputs: u64,
    pub sound: u64,
    pub refused: u64,
}

/// Lines of a serial adapter.
pub fn slcan_lines(dice: &mut Dice, inputs: u64) -> Tally {
    let mut tally = Tally::default();
    let mut lines = slcan::Lines::default();
    let mut bytes = Vec::new();
    for _ in 0..inputs {
        bytes.clear();
        slcan::encode(&dice.frame(), &mut bytes);
        dice.damage(&mut bytes);
        for byte in &bytes {
            match lines.push(*byte, |line, _| slcan::decode(line)) {
                Some(Some(_)) => tally.sound += 1,
                Some(None) => tally.refused += 1,
                None => {}
            }
        }
        tally.inputs += 1;
    }
    tally
}

/// Multicast datagrams.
pub fn datagrams(dice: &mut Dice, inputs: u64) -> Tally {
    let mut tally = Tally::default();
    let mut bytes = Vec::new();
    for _ in 0..inputs {
        udp::encode(&dice.frame(), &mut bytes);
        dice.damage(&mut bytes);
        match udp::decode(&bytes) {
            Some(_) => tally.sound += 1,
            None => tally.refused += 1,
        }
        tally.inputs += 1;
    }
    tally
}

fn robot(model: &str) -> Vec<Servo> {
    let joint = |k: u8| ServoConfig {
        name: format!("joint_{k}"),
        id: k,
        model: model.into(),
        direction: 1,
        lower_deg: -90.0,
        upper_deg: 90.0,
        velocity_deg_s: 230.0,
        acceleration_deg_s2: 2300.0,
        ..Default::default()
    };
    servos(&[joint(1), joint(2)]).unwrap()
}

fn net(servos: &[Servo]) -> Box<dyn Line> {
    let specs: Vec<SimServoSpec> = servos.iter().map(Into::into).collect();
    build_net(&specs, &SimOptions::lockstep(1_000_000, 100.0), 0.01).unwrap()
}

/// Frames for the simulated motors, which move meanwhile.
pub fn commands(dice: &mut Dice, inputs: u64, model: &str) -> Tally {
    let mut tally = Tally::default();
    let servos = robot(model);
    let mut line = net(&servos);
    for k in 0..inputs {
        match line.receive(&dice.frame()).len() {
            0 => tally.refused += 1,
            _ => tally.sound += 1,
        }
        if k % 64 == 0 {
            line.step(k as f64 * 1e-3, 0.5e-3, true);
            line.due();
        }
        if k % 4096 == 0 {
            line = net(&servos);
        }
        tally.inputs += 1;
    }
    tally
}

/// Motors whose replies are damaged.
struct DamagedLink {
    line: Box<dyn Line>,
    queue: VecDeque<CanFrame>,
    dice: Dice,
    time_s: f64,
    /// One reply in this many is damaged.
    rarity: usize,
    heard: Arc<AtomicU64>,
}

impl DamagedLink {
    fn damaged(&mut self, frame: CanFrame) -> CanFrame {
        if self.dice.below(self.rarity) != 0 {
            return frame;
        }
        let mut data = frame.data().to_vec();
        self.dice.damage(&mut data);
        match frame.is_extended() {
            true => CanFrame::extended(frame.id() ^ 1 << self.dice.below(40).min(30), &data),
            false => CanFrame::standard(frame.id() ^ 1 << self.dice.below(20).min(12), &data),
        }
    }
}

impl CanLink for DamagedLink {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sent> {
        self.time_s += 1e-4;
        self.line.step(self.time_s, 1e-4, false);
        let mut said = self.line.due();
        said.extend(self.line.receive(frame));
        for frame in said {
            let frame = self.damaged(frame);
            self.queue.push_back(frame);
        }
        Ok(Sent::Taken)
    }

    fn receive(&mut self, _deadline: Instant) -> io::Result<CanEvent> {
        let next = match self.dice.below(8 * self.rarity) {
            0 => Some(self.dice.frame()),
            1 => return Ok(CanEvent::Fault(CanFault::Error)),
            _ => self.queue.pop_front(),
        };
        let Some(frame) = next else {
            return Ok(CanEvent::Nothing);
        };
        self.heard.fetch_add(1, Ordering::Relaxed);
        Ok(CanEvent::Frame(frame))
    }
}

/// Replies to a scan: sound are the motors that it finds.
pub fn scans(dice: &mut Dice, inputs: u64, model: &str) -> Tally {
    let mut tally = Tally::default();
    let heard = Arc::new(AtomicU64::new(0));
    let servos = robot(model);
    while heard.load(Ordering::Relaxed) < inputs {
        let link = DamagedLink {
            line: net(&servos),
            queue: VecDeque::new(),
            dice: Dice(dice.next()),
            time_s: 0.0,
            rarity: [2, 20, 200][dice.below(3)],
            heard: heard.clone(),
        };
        let mut scanner = CanScanner::over(Box::new(link), Duration::ZERO, Duration::ZERO);
        match scanner.everyone() {
            Ok(found) => tally.sound += found.len() as u64,
            Err(_) => tally.refused += 1,
        }
    }
    tally.inputs = heard.load(Ordering::Relaxed);
    tally
}

/// Replies to the driver of one kind: sound are its good cycles, refused its errors.
pub fn replies(dice: &mut Dice, inputs: u64, kind: BusKind, model: &str) -> Tally {
    let mut tally = Tally::default();
    let heard = Arc::new(AtomicU64::new(0));
    let servos = robot(model);
    let mut states = vec![JointState::default(); servos.len()];
    while heard.load(Ordering::Relaxed) < inputs {
        let link = DamagedLink {
            line: net(&servos),
            queue: VecDeque::new(),
            dice: Dice(dice.next()),
            time_s: 0.0,
            rarity: [2, 20, 200][dice.below(3)],
            heard: heard.clone(),
        };
        let config = BusConfig {
            accept_no_watchdog: true,
            watchdog_endpoints: Some(WATCHDOG_ENDPOINTS),
            ..BusConfig::of_kind(kind, 1_000_000)
        };
        let mut bus = CanBus::over(Box::new(link), "fuzz", config, servos.clone()).unwrap();
        for _ in 0..20 {
            tally.refused += u64::from(bus.arm().is_err());
            for _ in 0..50 {
                match bus.cycle(&[0.1, -0.1], &mut states) {
                    Ok(()) => tally.sound += 1,
                    Err(_) => {
                        tally.refused += 1;
                        break;
                    }
                }
            }
            // A bus that cannot be verified off says so when it is dropped: not here.
            let off = (0..200).any(|_| bus.disarm().is_ok());
            assert!(off, "never off");
        }
        assert!(states.iter().all(|state| state.position_rad.is_finite()));
    }
    tally.inputs = heard.load(Ordering::Relaxed);
    tally
}
