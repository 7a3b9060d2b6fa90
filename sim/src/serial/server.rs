//! The thread behind the host's serial port: wire time (see [`crate::SimBus`]), faults,
//! bytes to and from the host.

use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crate::bus::line::Burst;
use crate::bus::options::SimClock;
use crate::bus::shared::{BEAT, BusShared};
use crate::fault::WireFault;
use crate::serial::host_port::{HostInput, HostPort};

/// How long the thread watches the port without sleeping after a reply, if the
/// host spoke again within [`PROMPT`] of the reply before.
const ATTENTIVE: Duration = Duration::from_micros(80);
const PROMPT: Duration = Duration::from_micros(400);

pub(crate) struct SerialServer {
    shared: Arc<BusShared>,
    port: HostPort,
    /// When the line is free again, seconds since the start. Real time only.
    line_free_s: f64,
    /// When the last reply was handed over. Real time only.
    handed_over: Option<Instant>,
    /// Whether the host spoke at once when it was answered last.
    prompt: bool,
    /// The last read took all that fits: what comes next was waiting with it, and follows on
    /// the line without a pause, however late this thread comes to it.
    more_waits: bool,
}

impl SerialServer {
    /// Its host is taken to be quick until it is known.
    pub fn new(shared: Arc<BusShared>, port: HostPort) -> Self {
        Self { shared, port, line_free_s: 0.0, handed_over: None, prompt: true, more_waits: false }
    }

    /// Until it is told to stop, or the port fails.
    pub fn run(mut self) {
        let mut chunk = [0; 4096];
        while !self.shared.stop.load(Ordering::Acquire) {
            match self.receive(&mut chunk) {
                Ok(HostInput::Nothing) => self.more_waits = false,
                Ok(HostInput::Bytes(count)) => {
                    if let Some(at) = self.handed_over.take() {
                        self.prompt = at.elapsed() < PROMPT;
                    }
                    let waited = std::mem::replace(&mut self.more_waits, count == chunk.len());
                    self.serve(&mut chunk[..count], waited);
                }
                Ok(HostInput::Nobody) => {
                    self.shared.busy.store(false, Ordering::SeqCst);
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(_) => return,
            }
            self.shared.busy.store(false, Ordering::SeqCst);
            self.shared.beat();
        }
    }

    fn receive(&mut self, chunk: &mut [u8]) -> io::Result<HostInput> {
        // A host at the limit of its wire speaks again at once: being woken up
        // would take longer than its pause. One that rests until its next cycle
        // is not watched for.
        let watched = self.handed_over.filter(|_| self.prompt);
        while watched.is_some_and(|at| at.elapsed() < ATTENTIVE) {
            match self.port.read(chunk)? {
                HostInput::Nothing => std::hint::spin_loop(),
                HostInput::Nobody => break,
                heard => return Ok(heard),
            }
        }
        if !self.port.wait(BEAT)? {
            return Ok(HostInput::Nothing);
        }
        self.shared.busy.store(true, Ordering::SeqCst);
        let heard = self.port.read(chunk)?;
        if self.port.moved() {
            self.shared.watch(self.port.watched()?);
        }
        Ok(heard)
    }

    /// Bytes of the host; whether they `waited` behind those of the last read.
    fn serve(&mut self, bytes: &mut [u8], waited: bool) {
        let shared = self.shared.clone();
        if shared.faults().hits(WireFault::Echo) {
            self.port.write(bytes);
        }
        if shared.faults().fault.is_some() {
            shared.stepped_as_it_is().line.witness(bytes);
        }
        shared.faults().pass_instruction(bytes);
        let now_s = shared.began.elapsed().as_secs_f64();
        if !waited {
            self.line_free_s = self.line_free_s.max(now_s);
        }
        shared.stepped().line.set_host_baud(self.port.baud());
        shared.wire().bytes_in += bytes.len() as u64;
        for &byte in &*bytes {
            self.line_free_s += shared.byte_s;
            // The line is not advanced for single bytes, only for what they complete.
            let complete = shared.stepped_as_it_is().line.push(byte);
            if !complete {
                continue;
            }
            self.wait_until(self.line_free_s);
            if shared.faults().hits(WireFault::Lose) {
                shared.stepped().line.lose();
                continue;
            }
            let bursts = shared.stepped().line.execute(shared.late_s(self.line_free_s));
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
                wire.wire_s += burst.delay_s;
                wire.bytes_out += burst.bytes.len() as u64;
                wire.packets_out += 1;
            }
            let (bytes, late_s) = self.shared.faults().pass_reply(burst.bytes);
            if late_s > 0.0 {
                self.hand_over(&mut passed);
                self.shared.sleep_for(late_s);
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
