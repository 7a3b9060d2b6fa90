//! A loudspeaker in software: it takes samples by a clock that is not the computer's, late and
//! unevenly, as devices do, and keeps what would be heard and when. For tests and benches.

use super::song_player::SongPlayer;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How a simulated device differs from an ideal one.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedDevice {
    /// The rate that it is asked for, hertz.
    pub rate_hz: f64,
    /// By which share its clock is fast.
    pub drift: f64,
    /// From a callback until its first sample is heard, seconds; the device says so.
    pub latency_s: f64,
    /// Samples a callback.
    pub block: usize,
}

impl Default for SimulatedDevice {
    fn default() -> Self {
        Self { rate_hz: 48_000.0, drift: 2e-4, latency_s: 0.12, block: 960 }
    }
}

/// What was heard: samples, each at its moment.
#[derive(Clone, Debug)]
pub struct Heard {
    /// When the first sample was heard.
    pub from: Instant,
    /// Samples a second of the computer's clock.
    pub rate_hz: f64,
    /// All samples.
    pub samples: Vec<f32>,
}

/// A device that plays; dropped, it stops.
#[derive(Debug)]
pub struct SimulatedSpeaker {
    heard: Arc<Mutex<Heard>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl SimulatedSpeaker {
    /// Begins to play.
    /// Errors: no thread can be started.
    pub fn start(device: SimulatedDevice, mut player: SongPlayer) -> std::io::Result<Self> {
        let began = Instant::now();
        let true_hz = device.rate_hz * (1.0 + device.drift);
        let from = began + Duration::from_secs_f64(device.latency_s);
        let heard = Arc::new(Mutex::new(Heard { from, rate_hz: true_hz, samples: Vec::new() }));
        let stop = Arc::new(AtomicBool::new(false));
        let (kept, stopped) = (Arc::clone(&heard), Arc::clone(&stop));
        let thread = std::thread::Builder::new().name("loudspeaker".into()).spawn(move || {
            let mut block = vec![0.0; device.block];
            let mut taken = 0_usize;
            while !stopped.load(Ordering::Relaxed) {
                // By the device's own clock; late where the computer is busy, and then the
                // device has its buffer to go on with.
                let due = Duration::from_secs_f64(taken as f64 / true_hz);
                std::thread::sleep(due.saturating_sub(began.elapsed()));
                let heard_at = from + due;
                player.fill(&mut block, 1, device.rate_hz, heard_at, |value| value);
                taken += block.len();
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.samples.extend_from_slice(&block);
            }
        })?;
        Ok(Self { heard, stop, thread: Some(thread) })
    }

    /// What was heard so far.
    pub fn heard(&self) -> Heard {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for SimulatedSpeaker {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic there has already been printed.
            let _ = thread.join();
        }
    }
}
