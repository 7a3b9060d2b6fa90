//! A bus of simulated servos behind a pseudo-terminal (or a Unix socket, or a
//! multicast group).
//!
//! A thread serves the pseudo-terminal: any program may open
//! [`SimBus::port_path`] and talk as to a serial adapter. The baud rate of a
//! pseudo-terminal means nothing, so the wire's time is imposed here: in real
//! time an instruction takes effect when its last byte has passed, and a reply
//! is handed over when its own last byte has. In lockstep wire time is only
//! counted and the motors move with [`SimBus::advance`] alone.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use servodance_drivers::{Port, ReplyClock, sleep_punctually};

use crate::body::SimServoState;
use crate::byte_servo::ByteServo;
use crate::can::{CanServer, build_net};
use crate::far_end::{FarEnd, Socket};
use crate::fault::{FaultyWire, ServoFault, WireFault};
use crate::host_port::{Heard, HostPort};
use crate::judge::{Judge, Violations};
use crate::line::{Burst, Line, XLine};
use crate::protocol1_line::Protocol1Line;
use crate::servo::SimServo;
use crate::spec::{SimClock, SimError, SimOptions, SimServoSpec, X_BAUDS};
use crate::urgency::answer_like_hardware;
use crate::world::World;

/// How often the thread looks whether it is to end.
const WAKE: Duration = Duration::from_millis(10);
/// How long the thread watches the port without sleeping after a reply, if the
/// host spoke again within [`PROMPT`] of the reply before.
const ATTENTIVE: Duration = Duration::from_micros(80);
/// Being woken up is in it.
const PROMPT: Duration = Duration::from_micros(400);
/// Precise waits sleep until so long before their end; the rest is spent
/// spinning, for the precision of a fast bus.
const SLEEP_SLACK: Duration = Duration::from_micros(70);

/// How long carrying out the host's frames may take in lockstep.
const LONGEST_SETTLE: Duration = Duration::from_secs(2);

/// What passed over the simulated wire.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireStats {
    /// Bytes from the host.
    pub bytes_in: u64,
    /// Bytes to the host.
    pub bytes_out: u64,
    /// Sound instructions from the host.
    pub packets_in: u64,
    /// Status packets (or pieces of a fast one) to the host.
    pub packets_out: u64,
    /// Damaged frames from the host.
    pub bad_packets: u64,
    /// Time that the line was busy: ten bits a byte, and return delays. Seconds.
    pub wire_s: f64,
}

impl std::ops::AddAssign for WireStats {
    fn add_assign(&mut self, other: Self) {
        self.bytes_in += other.bytes_in;
        self.bytes_out += other.bytes_out;
        self.packets_in += other.packets_in;
        self.packets_out += other.packets_out;
        self.bad_packets += other.bad_packets;
        self.wire_s += other.wire_s;
    }
}

/// What the thread counts. Sums that do not depend on how reads cut the stream.
#[derive(Debug, Default)]
pub(crate) struct Traffic {
    pub bytes_in: u64,
    pub bytes_out: u64,
    pub packets_out: u64,
    pub delays_s: f64,
}

/// What the thread and its owner share.
#[derive(Debug)]
pub(crate) struct Shared {
    world: Mutex<World>,
    wire: Mutex<Traffic>,
    faults: Mutex<FaultyWire>,
    pub stop: AtomicBool,
    pub bus_off: AtomicBool,
    /// The thread carries out what it has read.
    pub busy: AtomicBool,
    /// A second handle on what the thread reads, while it does.
    watched: Mutex<Option<OwnedFd>>,
    pub clock: SimClock,
    pub began: Instant,
    /// Seconds a byte; 0 on CAN, where frames are counted bit by bit.
    byte_s: f64,
    pub adapter_s: f64,
}

impl Shared {
    /// The world, brought up to the present in real time.
    pub fn world(&self) -> MutexGuard<'_, World> {
        let mut world = self.world.lock().unwrap_or_else(PoisonError::into_inner);
        if self.clock == SimClock::Realtime {
            world.advance_to(self.began.elapsed().as_secs_f64());
        }
        world
    }

    pub fn wire(&self) -> MutexGuard<'_, Traffic> {
        self.wire.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watched(&self) -> MutexGuard<'_, Option<OwnedFd>> {
        self.watched.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on this is what the thread reads from. `busy` is set meanwhile.
    pub fn watch(&self, fd: OwnedFd) {
        *self.watched() = Some(fd);
    }

    pub fn faults(&self) -> MutexGuard<'_, FaultyWire> {
        self.faults.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a time since the start, in real time, as long as a sleep takes.
    pub fn sleep_until(&self, time_s: f64) {
        self.sleep_early(time_s, Duration::ZERO);
    }

    /// The same to the microsecond: the processor is kept for the last of it.
    pub fn wait_until(&self, time_s: f64) {
        let due = self.sleep_early(time_s, SLEEP_SLACK);
        while due.is_some_and(|due| Instant::now() < due) {
            std::hint::spin_loop();
        }
    }

    /// Sleeps until `slack` before a time since the start; the time, if there
    /// is anything to wait for.
    fn sleep_early(&self, time_s: f64, slack: Duration) -> Option<Instant> {
        if self.clock == SimClock::Lockstep {
            return None;
        }
        let due = self.began + Duration::from_secs_f64(time_s);
        let early = due.saturating_duration_since(Instant::now() + slack);
        if !early.is_zero() {
            std::thread::sleep(early);
        }
        Some(due)
    }
}

impl servodance_drivers::FarEnd for Shared {
    fn is_idle(&self) -> bool {
        let watched = self.watched();
        // In this order: what has been read is carried out while `busy` is set.
        let unread = watched.as_ref().is_some_and(has_unread);
        !unread && !self.busy.load(Ordering::SeqCst)
    }
}

/// Whether there is something to read; that the other end is closed is not.
fn has_unread(fd: &OwnedFd) -> bool {
    let mut fds = [PollFd::new(fd.as_fd(), PollFlags::POLLIN)];
    let polled = poll(&mut fds, PollTimeout::ZERO);
    let found = fds[0].revents().unwrap_or(PollFlags::empty());
    polled.is_ok() && found.contains(PollFlags::POLLIN)
}

/// The thread reads no more, even if it panicked: nothing is waited for.
struct Gone(Arc<Shared>);

impl Drop for Gone {
    fn drop(&mut self) {
        *self.0.watched() = None;
        self.0.busy.store(false, Ordering::SeqCst);
    }
}

/// A running simulated bus. Dropping it ends its thread and closes the port.
#[derive(Debug)]
pub struct SimBus {
    shared: Arc<Shared>,
    port_path: String,
    port: Port,
    socket: Socket,
    baud: u32,
    thread: Option<JoinHandle<()>>,
}

fn start_thread(
    far_end: FarEnd,
    shared: Arc<Shared>,
    baud: u32,
) -> Result<JoinHandle<()>, SimError> {
    shared.watch(far_end.watched()?);
    let thread = std::thread::Builder::new().name("simulated servos".into());
    let gone = Gone(shared.clone());
    let in_real_time = shared.clock == SimClock::Realtime;
    let prepare = move || match in_real_time {
        true => answer_like_hardware(),
        false => sleep_punctually(),
    };
    let started = match far_end {
        FarEnd::Can(adapter) => {
            let server = CanServer::new(shared, adapter, baud);
            thread.spawn(move || {
                let _gone = gone;
                prepare();
                server.run();
            })
        }
        FarEnd::Serial(port) => {
            let server = Server {
                shared,
                port,
                line_free_s: 0.0,
                handed_over: None,
                prompt: true,
            };
            thread.spawn(move || {
                let _gone = gone;
                prepare();
                server.run();
            })
        }
    };
    started.map_err(|reason| SimError::System {
        what: "starting a thread",
        reason,
    })
}

impl SimBus {
    /// Starts a bus with these servos. Every servo has the bus's baud rate;
    /// all else is as it leaves the factory (return delay 500 us, torque off).
    pub fn start(specs: &[SimServoSpec], options: SimOptions) -> Result<Self, SimError> {
        let period_s = 1.0 / checked_hz(options.control_hz)?;
        let is_can = specs.iter().any(|spec| spec.motor.is_some());
        let line: Box<dyn Line> = match is_can {
            true => Box::new(build_net(specs, options.supply_v, period_s)?),
            false => build_line(specs, &options, period_s)?,
        };
        let shared = Arc::new(Shared {
            world: Mutex::new(World::new(line, period_s)),
            wire: Mutex::new(Traffic::default()),
            faults: Mutex::new(FaultyWire::new(options.seed)),
            stop: AtomicBool::new(false),
            bus_off: AtomicBool::new(false),
            busy: AtomicBool::new(false),
            watched: Mutex::new(None),
            clock: options.clock,
            began: Instant::now(),
            byte_s: if is_can {
                0.0
            } else {
                10.0 / f64::from(options.baud)
            },
            adapter_s: checked_adapter_s(options.adapter_s)?,
        });
        let socket = Socket {
            is_can,
            bitrate: options.baud,
            link: options.link,
            path: options.path,
        };
        let (far_end, port_path, port) = socket.open()?;
        let thread = start_thread(far_end, shared.clone(), options.baud)?;
        Ok(Self {
            shared,
            port_path,
            port,
            socket,
            baud: options.baud,
            thread: Some(thread),
        })
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
            self.shared.world().advance(dt_s);
        }
    }

    /// By whose clock a driver of this bus knows that no reply will come.
    pub fn reply_clock(&self) -> ReplyClock {
        match self.shared.clock {
            SimClock::Lockstep => ReplyClock::FarEnd(self.shared.clone()),
            SimClock::Realtime => ReplyClock::Wall,
        }
    }

    /// What the host has sent belongs to the time before: waits until it is
    /// carried out (a thread that does not get on is not waited for).
    fn settle(&self) {
        use servodance_drivers::FarEnd;
        let began = Instant::now();
        while !self.shared.is_idle() && began.elapsed() < LONGEST_SETTLE {
            std::thread::sleep(Duration::from_micros(20));
        }
    }

    /// Simulated time, seconds.
    pub fn time_s(&self) -> f64 {
        self.shared.world().time_s()
    }

    /// Limits broken so far by all servos: see [`crate::Judge`].
    pub fn violations(&self) -> Violations {
        self.shared.world().sum(Judge::violations)
    }

    /// Those of them that the true motion broke.
    pub fn motion_violations(&self) -> Violations {
        self.shared.world().sum(Judge::motion_violations)
    }

    /// The first violations of each servo in words.
    pub fn violation_notes(&self) -> Vec<String> {
        let world = self.shared.world();
        let judges = world.line.judges().into_iter();
        judges
            .flat_map(|judge| judge.notes().iter().cloned())
            .collect()
    }

    /// What the servo at `index` (in the order of the specs) really does.
    pub fn servo(&self, index: usize) -> Option<SimServoState> {
        self.shared.world().line.state(index)
    }

    /// From now on `fault` hits this share (0 to 1) of the replies; `None` ends it.
    pub fn set_wire_fault(&self, fault: Option<(WireFault, f64)>) {
        self.shared.faults().set(fault);
    }

    /// How many replies or instructions a wire fault has hit.
    pub fn wire_fault_hits(&self) -> u64 {
        self.shared.faults().hits
    }

    /// Something happens to one servo: false if there is none at `index`.
    pub fn set_servo_fault(&self, index: usize, fault: ServoFault) -> bool {
        self.shared.world().line.suffer(index, fault)
    }

    /// The CAN controller of the adapter leaves the bus, or comes back.
    pub fn set_bus_off(&self, bus_off: bool) {
        self.shared.bus_off.store(bus_off, Ordering::Release);
    }

    /// The adapter is put back: the port can be opened again, at the same path
    /// if the options have one. Does nothing while it is plugged in.
    pub fn replug(&mut self) -> Result<(), SimError> {
        if self.thread.is_none() {
            let (far_end, port_path, port) = self.socket.open()?;
            (self.port_path, self.port) = (port_path, port);
            self.shared.stop.store(false, Ordering::Release);
            self.thread = Some(start_thread(far_end, self.shared.clone(), self.baud)?);
        }
        Ok(())
    }

    /// The adapter is pulled out: the port fails for whoever has it open.
    /// The servos go on as they were, and time can still be advanced.
    pub fn unplug(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        self.socket.close(&self.port_path);
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has already been printed.
            let _ = thread.join();
        }
    }

    /// What passed over the wire.
    pub fn wire_stats(&self) -> WireStats {
        let (packets_in, bad_packets) = self.shared.world().line.packets();
        let traffic = self.shared.wire();
        let bytes = (traffic.bytes_in + traffic.bytes_out) as f64;
        WireStats {
            bytes_in: traffic.bytes_in,
            bytes_out: traffic.bytes_out,
            packets_in,
            packets_out: traffic.packets_out,
            bad_packets,
            wire_s: bytes * self.shared.byte_s + traffic.delays_s,
        }
    }
}

impl Drop for SimBus {
    fn drop(&mut self) {
        self.unplug();
    }
}

fn checked_hz(control_hz: f64) -> Result<f64, SimError> {
    if (1.0..=10_000.0).contains(&control_hz) {
        return Ok(control_hz);
    }
    Err(SimError::Option {
        key: "control_hz",
        actual: control_hz.to_string(),
        wanted: "1 to 10000",
    })
}

fn checked_adapter_s(adapter_s: f64) -> Result<f64, SimError> {
    if (0.0..=1.0).contains(&adapter_s) {
        return Ok(adapter_s);
    }
    Err(SimError::Option {
        key: "adapter_s",
        actual: adapter_s.to_string(),
        wanted: "0 to 1",
    })
}

fn baud_code(baud: u32, bauds: &[u32; 8]) -> Result<u8, SimError> {
    match bauds.iter().position(|known| *known == baud) {
        Some(code) => Ok(code as u8),
        None => Err(bad_baud(baud)),
    }
}

fn bad_baud(baud: u32) -> SimError {
    SimError::Option {
        key: "baud",
        actual: baud.to_string(),
        wanted: "a rate of the servos' baud register",
    }
}

fn checked_supply_ohm(supply_ohm: f64) -> Result<f64, SimError> {
    if (0.0..=10.0).contains(&supply_ohm) {
        return Ok(supply_ohm);
    }
    Err(SimError::Option {
        key: "supply_ohm",
        actual: supply_ohm.to_string(),
        wanted: "0 to 10",
    })
}

fn build_line(
    specs: &[SimServoSpec],
    options: &SimOptions,
    period_s: f64,
) -> Result<Box<dyn Line>, SimError> {
    let mut x_servos = Vec::new();
    let mut byte_servos = Vec::new();
    for spec in specs {
        let model = spec.checked()?;
        let supply_v = options.supply_v.unwrap_or(model.voltage_v);
        if model.is_protocol1() {
            if !model.takes_baud(options.baud) {
                return Err(bad_baud(options.baud));
            }
            let servo = ByteServo::new(spec, model, options.baud, supply_v, period_s);
            byte_servos.push(servo);
        } else {
            let code = baud_code(options.baud, &X_BAUDS)?;
            x_servos.push(SimServo::new(spec, model, code, supply_v, period_s));
        }
    }
    let supply_ohm = checked_supply_ohm(options.supply_ohm)?;
    let baud = options.baud;
    match (x_servos.is_empty(), byte_servos.is_empty()) {
        (_, true) => Ok(Box::new(XLine::new(x_servos, baud, supply_ohm))),
        (true, false) => Ok(Box::new(Protocol1Line::new(byte_servos, baud, supply_ohm))),
        (false, false) => Err(SimError::Option {
            key: "servos",
            actual: "of two protocols".into(),
            wanted: "of one protocol on one line",
        }),
    }
}

/// The thread behind the host's port.
struct Server {
    shared: Arc<Shared>,
    port: HostPort,
    /// When the line is free again, seconds since the start. Real time only.
    line_free_s: f64,
    /// When the last reply was handed over. Real time only.
    handed_over: Option<Instant>,
    /// Whether the host spoke at once when it was answered last.
    prompt: bool,
}

impl Server {
    fn run(mut self) {
        let mut chunk = [0; 4096];
        while !self.shared.stop.load(Ordering::Acquire) {
            match self.receive(&mut chunk) {
                Ok(Heard::Nothing) => {}
                Ok(Heard::Bytes(count)) => {
                    if let Some(at) = self.handed_over.take() {
                        self.prompt = at.elapsed() < PROMPT;
                    }
                    self.serve(&mut chunk[..count]);
                }
                Ok(Heard::Nobody) => {
                    self.shared.busy.store(false, Ordering::SeqCst);
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(_) => return,
            }
            self.shared.busy.store(false, Ordering::SeqCst);
        }
    }

    /// Bytes from the host, or none after a while.
    fn receive(&mut self, chunk: &mut [u8]) -> io::Result<Heard> {
        // A host at the limit of its wire speaks again at once: being woken up
        // would take longer than its pause. One that rests until its next cycle
        // is not watched for.
        let watched = self.handed_over.filter(|_| self.prompt);
        while watched.is_some_and(|at| at.elapsed() < ATTENTIVE) {
            match self.port.read(chunk)? {
                Heard::Nothing => std::hint::spin_loop(),
                Heard::Nobody => break,
                heard => return Ok(heard),
            }
        }
        if !self.port.wait(WAKE)? {
            return Ok(Heard::Nothing);
        }
        self.shared.busy.store(true, Ordering::SeqCst);
        let heard = self.port.read(chunk)?;
        if self.port.moved() {
            self.shared.watch(self.port.watched()?);
        }
        Ok(heard)
    }

    fn serve(&mut self, bytes: &mut [u8]) {
        let shared = self.shared.clone();
        if shared.faults().echoes() {
            self.port.write(bytes);
        }
        shared.faults().pass_instruction(bytes);
        let now_s = shared.began.elapsed().as_secs_f64();
        self.line_free_s = self.line_free_s.max(now_s);
        shared.world().line.set_host_baud(self.port.baud());
        shared.wire().bytes_in += bytes.len() as u64;
        for &byte in &*bytes {
            self.line_free_s += shared.byte_s;
            // The world is not advanced for single bytes, only for what they complete.
            let complete = {
                let mut world = shared.world.lock().unwrap_or_else(PoisonError::into_inner);
                world.line.push(byte)
            };
            if !complete {
                continue;
            }
            self.wait_until(self.line_free_s);
            let bursts = shared.world().line.execute();
            self.send(bursts);
        }
    }

    /// Sends replies. What follows without a pause is handed over together when
    /// its last byte has passed, as adapters do.
    fn send(&mut self, bursts: Vec<Burst>) {
        let mut passed = Vec::new();
        for burst in bursts {
            if burst.delay_s > 0.0 {
                self.hand_over(&mut passed);
            }
            self.line_free_s += burst.delay_s + burst.bytes.len() as f64 * self.shared.byte_s;
            {
                let mut wire = self.shared.wire();
                wire.delays_s += burst.delay_s;
                wire.bytes_out += burst.bytes.len() as u64;
                wire.packets_out += 1;
            }
            let (bytes, late_s) = self.shared.faults().pass_reply(burst.bytes);
            if late_s > 0.0 {
                self.hand_over(&mut passed);
                std::thread::sleep(Duration::from_secs_f64(late_s));
            }
            passed.extend(bytes);
        }
        self.hand_over(&mut passed);
    }

    /// Precisely for a host at the limit of its wire, at little cost for one that
    /// rests between its cycles.
    fn wait_until(&self, time_s: f64) {
        match self.prompt {
            true => self.shared.wait_until(time_s),
            false => self.shared.sleep_until(time_s),
        }
    }

    fn hand_over(&mut self, passed: &mut Vec<u8>) {
        if !passed.is_empty() {
            self.wait_until(self.line_free_s + self.shared.adapter_s);
            self.port.write(passed);
            passed.clear();
            let realtime = self.shared.clock == SimClock::Realtime;
            self.handed_over = realtime.then(Instant::now);
        }
    }
}
