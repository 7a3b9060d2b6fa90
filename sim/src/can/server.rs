//! The thread behind a simulated CAN bus: wire time, faults, frames to and from
//! the host.
//!
//! In real time a frame takes effect when its last bit has passed (no stuff
//! bits), and an answer is handed over when its own has. In lockstep wire time
//! is only counted, and what motors send unasked goes out in front of the
//! next answer, so that a run can be repeated.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use servodance_drivers::can::CanFrame;

use crate::bus::options::SimClock;
use crate::bus::shared::BusShared;
use crate::can::Adapter;
use crate::fault::WireFault;

/// How often the thread looks whether it is to end, or a motor sends unasked.
const WAKE: Duration = Duration::from_millis(5);
/// An error frame, and the pause after it: bits.
const ERROR_BITS: f64 = 23.0;

pub(crate) struct CanServer {
    shared: Arc<BusShared>,
    adapter: Box<dyn Adapter>,
    bit_s: f64,
    /// When the wire is free again, seconds since the start. Real time only.
    wire_free_s: f64,
}

impl CanServer {
    pub fn new(shared: Arc<BusShared>, adapter: Box<dyn Adapter>, bitrate: u32) -> Self {
        Self { shared, adapter, bit_s: 1.0 / f64::from(bitrate), wire_free_s: 0.0 }
    }

    pub fn run(mut self) {
        let mut frames = Vec::new();
        while !self.shared.stop.load(Ordering::Acquire) {
            let Ok(waiting) = self.adapter.wait(WAKE) else {
                return;
            };
            self.shared.busy.store(waiting, Ordering::SeqCst);
            let bus_off = self.shared.bus_off.load(Ordering::Acquire);
            if waiting && self.adapter.fetch(bus_off, &mut frames).is_err() {
                return;
            }
            if self.adapter.moved() {
                let Ok(watched) = self.adapter.watched() else {
                    return;
                };
                self.shared.watch(watched);
            }
            let now_s = self.shared.began.elapsed().as_secs_f64();
            self.wire_free_s = self.wire_free_s.max(now_s);
            for frame in frames.drain(..) {
                self.serve(&frame);
            }
            self.shared.busy.store(false, Ordering::SeqCst);
            if self.shared.clock == SimClock::Realtime {
                let due = self.shared.stepped().line.due();
                self.answer(due);
            }
        }
    }

    /// A frame from the host takes its time, then the motors receive it.
    fn serve(&mut self, frame: &CanFrame) {
        self.occupy(f64::from(frame.nominal_bits()));
        if self.shared.faults().hits(WireFault::Echo) {
            self.adapter.deliver(frame);
        }
        self.shared.wire().bytes_in += frame.data().len() as u64;
        // What damages a serial instruction makes an adapter lose a frame: CAN repeats damaged ones.
        if self.shared.faults().hits(WireFault::CorruptInstruction) {
            return;
        }
        self.shared.wait_until(self.wire_free_s);
        let answers = {
            let mut stepped = self.shared.stepped();
            let mut frames = match self.shared.clock {
                SimClock::Lockstep => stepped.line.due(),
                SimClock::Realtime => Vec::new(),
            };
            frames.extend(stepped.line.receive(frame));
            frames
        };
        self.answer(answers);
    }

    fn occupy(&mut self, bits: f64) {
        self.wire_free_s += bits * self.bit_s;
        self.shared.wire().wire_s += bits * self.bit_s;
    }

    /// Frames to the host, each when it has passed; faults happen to them here.
    fn answer(&mut self, frames: Vec<CanFrame>) {
        if self.shared.bus_off.load(Ordering::Acquire) {
            return;
        }
        for frame in frames {
            let bits = f64::from(frame.nominal_bits());
            self.occupy(bits);
            let passage = self.shared.faults().pass_frame();
            if passage.damaged {
                // The sender sees the error and repeats the frame.
                self.occupy(ERROR_BITS);
                self.occupy(bits);
            }
            {
                let mut wire = self.shared.wire();
                wire.bytes_out += passage.copies * frame.data().len() as u64;
                wire.packets_out += passage.copies;
            }
            self.shared.wait_until(self.wire_free_s + self.shared.adapter_s);
            if passage.late_s > 0.0 {
                self.shared.sleep_for(passage.late_s);
            }
            if !passage.noise.is_empty() {
                self.adapter.garble(&passage.noise);
            }
            for _ in 0..passage.copies {
                self.adapter.deliver(&frame);
            }
        }
    }
}
