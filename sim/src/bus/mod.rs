//! A bus of simulated servos behind a pseudo-terminal (or a Unix socket, or a
//! multicast group).
//!
//! A thread serves the pseudo-terminal: any program may open
//! [`SimBus::port_path`] and talk as to a serial adapter. The baud rate of a
//! pseudo-terminal means nothing, so the wire's time is imposed here: in real
//! time an instruction takes effect when its last byte has passed, and a reply
//! is handed over when its own last byte has. In lockstep wire time is only
//! counted and the motors move with [`SimBus::advance`] alone.

pub(crate) mod host_end;
pub(crate) mod line;
pub(crate) mod options;
pub(crate) mod shared;
pub(crate) mod stepped_line;
mod thread_priority;

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use servodance_drivers::{BusKind, Port, ReplyClock, sleep_precisely};

use crate::bus::host_end::{HostEnd, HostLink};
use crate::bus::line::Line;
use crate::bus::options::{SimClock, SimOptions};
use crate::bus::shared::{BusShared, Gone, WireStats};
use crate::bus::stepped_line::SteppedLine;
use crate::bus::thread_priority::raise_priority;
use crate::can::{CanServer, build_net};
use crate::error::SimError;
use crate::fault::wire::FaultyWire;
use crate::fault::{ServoFault, WireFault};
use crate::judge::{Judge, Violations};
use crate::serial::build::build_line;
use crate::serial::server::SerialServer;
use crate::servo::body::SimServoState;
use crate::servo::spec::SimServoSpec;
use crate::world::{SharedWorld, WorldSeat};

/// How long carrying out the host's frames may take in lockstep.
const LONGEST_SETTLE: Duration = Duration::from_secs(2);

/// A running simulated bus. Dropping it ends its thread and closes the port.
#[derive(Debug)]
pub struct SimBus {
    shared: Arc<BusShared>,
    port_path: String,
    port: Port,
    host_link: HostLink,
    world: Option<SharedWorld>,
    thread: Option<JoinHandle<()>>,
}

fn start_thread(
    host_end: HostEnd,
    shared: Arc<BusShared>,
    bitrate: u32,
) -> Result<JoinHandle<()>, SimError> {
    shared.watch(host_end.watched()?);
    let thread = std::thread::Builder::new().name("simulated servos".into());
    let gone = Gone(shared.clone());
    let prepare = match shared.clock {
        SimClock::Realtime => raise_priority,
        SimClock::Lockstep => sleep_precisely,
    };
    let serve: Box<dyn FnOnce() + Send> = match host_end {
        HostEnd::Can(adapter) => {
            let server = CanServer::new(shared, adapter, bitrate);
            Box::new(move || server.run())
        }
        HostEnd::Serial(port) => {
            let server = SerialServer::new(shared, port);
            Box::new(move || server.run())
        }
    };
    let started = thread.spawn(move || {
        let _gone = gone;
        prepare();
        serve();
    });
    started.map_err(SimError::system("starting a thread"))
}

impl SimBus {
    /// Starts a bus with these servos, as they leave the factory but for the bus's rate.
    pub fn start(specs: &[SimServoSpec], options: SimOptions) -> Result<Self, SimError> {
        let period_s = period_s(&options)?;
        let is_can = specs.iter().any(|spec| spec.motor.is_some());
        let is_flexible = specs.iter().any(|spec| spec.kind == BusKind::Moteus);
        let line: Box<dyn Line> = match is_can {
            true => build_net(specs, &options, period_s)?,
            false => build_line(specs, &options, period_s)?,
        };
        Self::start_with(line, is_can, is_flexible, options)
    }

    /// Starts a bus with a line of serial servos, also of a family that no driver knows.
    pub fn start_line(line: Box<dyn Line>, options: SimOptions) -> Result<Self, SimError> {
        Self::start_with(line, false, false, options)
    }

    fn start_with(
        line: Box<dyn Line>,
        is_can: bool,
        is_flexible: bool,
        options: SimOptions,
    ) -> Result<Self, SimError> {
        let period_s = period_s(&options)?;
        let byte_s = match is_can {
            true => 0.0,
            false => 10.0 / f64::from(options.baud),
        };
        let adapter_s = SimError::checked("adapter_s", options.adapter_s, 0.0..=1.0, "0 to 1")?;
        let world = options.seat.as_ref().map(WorldSeat::world);
        let shared = Arc::new(BusShared::new(
            SteppedLine::new(line, period_s, options.seat),
            FaultyWire::new(options.seed),
            options.clock,
            byte_s,
            adapter_s,
        ));
        let host_link = HostLink {
            is_can,
            is_flexible,
            bitrate: options.baud,
            link: options.link,
            path: options.path,
        };
        let (host_end, port_path, port) = host_link.open()?;
        let thread = start_thread(host_end, shared.clone(), options.baud)?;
        Ok(Self { shared, port_path, port, host_link, world, thread: Some(thread) })
    }

    /// The serial port to open, e.g. `/dev/pts/3`, or the multicast group.
    pub fn port_path(&self) -> &str {
        &self.port_path
    }

    /// The same for a driver's `open_bus`.
    pub fn port(&self) -> Port {
        self.port.clone()
    }

    /// Moves simulated time on, in lockstep. Does nothing in real time.
    pub fn advance(&self, dt_s: f64) {
        if self.shared.clock == SimClock::Lockstep {
            self.settle();
            self.shared.stepped().advance(dt_s);
        }
    }

    /// By whose clock a driver of this bus knows that no reply will come.
    pub fn reply_clock(&self) -> ReplyClock {
        match self.shared.clock {
            SimClock::Lockstep => ReplyClock::FarEnd(self.shared.clone()),
            SimClock::Realtime => ReplyClock::Wall,
        }
    }

    /// Waits until what the host has sent is carried out, unless the thread is stuck.
    fn settle(&self) {
        use servodance_drivers::FarEnd;
        let began = Instant::now();
        while !self.shared.is_idle() && began.elapsed() < LONGEST_SETTLE {
            std::thread::sleep(Duration::from_micros(20));
        }
    }

    /// The simulated time in seconds.
    pub fn time_s(&self) -> f64 {
        self.shared.stepped().time_s()
    }

    /// Limits broken so far by all servos: see `judge.rs`.
    pub fn violations(&self) -> Violations {
        self.shared.stepped().sum(Judge::violations)
    }

    /// Limits that the true motion broke, whatever the goals were.
    pub fn motion_violations(&self) -> Violations {
        self.shared.stepped().sum(|judge| judge.motion.violations)
    }

    /// The first eight violations of each servo in words.
    pub fn violation_notes(&self) -> Vec<String> {
        let stepped = self.shared.stepped();
        let judges = stepped.line.judges().into_iter();
        judges.flat_map(|judge| judge.notes.clone()).collect()
    }

    /// What the servo at `index` (in the order of the specs) really does.
    pub fn servo(&self, index: usize) -> Option<SimServoState> {
        self.shared.stepped().line.state(index)
    }

    /// The world that moves the servos' shafts.
    pub fn world(&self) -> Option<SharedWorld> {
        self.world.clone()
    }

    /// The motion sensor on the bus falls silent, or answers again.
    pub fn silence_imu(&self, silent: bool) {
        self.shared.stepped().line.silence_board(silent);
    }

    /// From now on `fault` hits this share (0 to 1) of the replies; `None` ends it.
    pub fn set_wire_fault(&self, fault: Option<(WireFault, f64)>) {
        self.shared.faults().fault = fault;
    }

    /// How many replies or instructions a wire fault has hit.
    pub fn wire_fault_hits(&self) -> u64 {
        self.shared.faults().hit_count
    }

    /// Something happens to one servo: false if there is none at `index`.
    pub fn set_servo_fault(&self, index: usize, fault: ServoFault) -> bool {
        self.shared.stepped().line.suffer(index, fault)
    }

    /// The CAN controller of the adapter leaves the bus, or comes back.
    pub fn set_bus_off(&self, bus_off: bool) {
        self.shared.bus_off.store(bus_off, Ordering::Release);
    }

    /// The adapter is put back, at the same path if the options have one.
    pub fn replug(&mut self) -> Result<(), SimError> {
        if self.thread.is_none() {
            let (host_end, port_path, port) = self.host_link.open()?;
            (self.port_path, self.port) = (port_path, port);
            // Up to here there was no thread to be late.
            self.shared.beat();
            self.shared.stop.store(false, Ordering::Release);
            self.thread =
                Some(start_thread(host_end, self.shared.clone(), self.host_link.bitrate)?);
        }
        Ok(())
    }

    /// The adapter is pulled out: the port fails, the servos go on as they were.
    pub fn unplug(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        self.host_link.close(&self.port_path);
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has already been printed.
            let _ = thread.join();
        }
    }

    /// Bytes, packets and busy time since the start.
    pub fn wire_stats(&self) -> WireStats {
        let (packets_in, bad_packets) = self.shared.stepped().line.packets();
        let traffic = *self.shared.wire();
        let bytes = (traffic.bytes_in + traffic.bytes_out) as f64;
        WireStats {
            packets_in,
            bad_packets,
            wire_s: bytes * self.shared.byte_s + traffic.wire_s,
            ..traffic
        }
    }
}

impl Drop for SimBus {
    fn drop(&mut self) {
        self.unplug();
    }
}

fn period_s(options: &SimOptions) -> Result<f64, SimError> {
    let range = 1.0..=10_000.0;
    let hz = SimError::checked("control_hz", options.control_hz, range, "1 to 10000")?;
    Ok(1.0 / hz)
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_drivers::{ServoConfig, servos};

    /// Limits broken by a shaft that jumps while torque is on, after such a stall.
    fn broken_after(stall: Duration, is_plugged: bool) -> u64 {
        let elbow = ServoConfig {
            name: "elbow".into(),
            id: 1,
            model: "XM430-W350".into(),
            direction: 1,
            zero_deg: 180.0,
            lower_deg: -60.0,
            upper_deg: 90.0,
            velocity_deg_s: 230.0,
            acceleration_deg_s2: 2300.0,
            ..ServoConfig::default()
        };
        let spec = SimServoSpec::from(&servos(&[elbow]).unwrap()[0]);
        let mut bus = SimBus::start(&[spec], SimOptions::realtime(1_000_000, 100.0)).unwrap();
        if !is_plugged {
            bus.unplug();
        }
        {
            let mut stepped = bus.shared.stepped();
            stepped.line.each_body(&mut |_, body| body.judge.begin(0.0, 0.0));
            std::thread::sleep(stall);
        }
        bus.set_servo_fault(0, ServoFault::Moved(0.5));
        std::thread::sleep(Duration::from_millis(50));
        bus.motion_violations().total()
    }

    #[test]
    fn motion_is_not_judged_after_the_machine_kept_the_simulation_from_running() {
        let stall = Duration::from_millis(100);
        assert_eq!(broken_after(stall, true), 0);
        // A busy machine may stall without being asked.
        assert!((0..100).any(|_| broken_after(Duration::ZERO, true) > 0));
        // Without a thread nothing is late.
        assert!(broken_after(stall, false) > 0);
    }
}
