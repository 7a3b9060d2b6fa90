//! A bad network between a follower and its leader: a TCP relay that delays
//! what passes and, where packets cannot really be lost, models what a loss does
//! to TCP.
//!
//! A lost segment stops everything behind it until it was sent again: after
//! 200 ms (the shortest retransmission timeout of Linux) and the way there and
//! back; lost again, after twice as long. The order of bytes is kept, as TCP does.
//! Each connection has losses of its own.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Linux sends again after this at the earliest, seconds.
const RESEND_S: f64 = 0.2;
const RESEND_MAX_S: f64 = 4.0;
/// Share of the delay that is jitter on top.
const JITTER: f64 = 0.2;
/// Largest piece that is passed on at once, bytes.
const PIECE: usize = 16 * 1024;
/// A partitioned link looks this often whether it is whole again.
const LOOK: Duration = Duration::from_millis(5);

#[derive(Clone, Copy, Debug)]
pub struct LinkFault {
    /// Delay each way, seconds.
    pub delay_s: f64,
    /// Share of pieces that are lost, where that is modelled.
    pub loss: f64,
}

/// A relay. Its threads end with the connections they serve.
pub struct Relay {
    pub address: SocketAddr,
    cut: Arc<AtomicBool>,
}

impl Relay {
    /// Listens at a free port of `address` and passes on to `target`.
    pub fn start(
        address: Ipv4Addr,
        target: SocketAddr,
        fault: LinkFault,
        seed: u64,
    ) -> std::io::Result<Self> {
        let listener = TcpListener::bind((address, 0))?;
        let address = listener.local_addr()?;
        let cut = Arc::new(AtomicBool::new(false));
        let shared = Arc::clone(&cut);
        std::thread::Builder::new().name("relay".into()).spawn(move || {
            let mut seeds = ChaCha8Rng::seed_from_u64(seed);
            for near in listener.incoming().flatten() {
                // A leader that is away: the connection is refused there too.
                let Ok(far) = TcpStream::connect(target) else {
                    let _ = near.shutdown(Shutdown::Both);
                    continue;
                };
                let ways = [(near.try_clone(), far.try_clone()), (Ok(far), Ok(near))];
                for (from, to) in ways {
                    if let (Ok(from), Ok(to)) = (from, to) {
                        pass(from, to, fault, seeds.random(), &shared);
                    }
                }
            }
        })?;
        Ok(Self { address, cut })
    }

    /// Nothing passes from now on, or passes again.
    pub fn cut(&self, cut: bool) {
        self.cut.store(cut, Ordering::Release);
    }
}

/// One direction: a thread that reads, one that writes when it is time.
fn pass(from: TcpStream, to: TcpStream, fault: LinkFault, seed: u64, cut: &Arc<AtomicBool>) {
    let _ = to.set_nodelay(true);
    let (sender, pieces) = channel();
    let cut = Arc::clone(cut);
    std::thread::spawn(move || read(from, &sender, fault, seed));
    std::thread::spawn(move || write(to, &pieces, &cut));
}

fn read(mut from: TcpStream, pieces: &Sender<(Instant, Vec<u8>)>, fault: LinkFault, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut piece = vec![0; PIECE];
    let mut last = Instant::now();
    while let Ok(count @ 1..) = from.read(&mut piece) {
        let mut way_s = fault.delay_s * (1.0 + JITTER * rng.random::<f64>());
        let mut resend_s = RESEND_S + 2.0 * fault.delay_s;
        while rng.random::<f64>() < fault.loss {
            way_s += resend_s;
            resend_s = (2.0 * resend_s).min(RESEND_MAX_S);
        }
        last = last.max(Instant::now() + Duration::from_secs_f64(way_s));
        if pieces.send((last, piece[..count].to_vec())).is_err() {
            break;
        }
    }
    let _ = from.shutdown(Shutdown::Read);
}

fn write(mut to: TcpStream, pieces: &Receiver<(Instant, Vec<u8>)>, cut: &AtomicBool) {
    while let Ok((at, piece)) = pieces.recv() {
        std::thread::sleep(at.saturating_duration_since(Instant::now()));
        while cut.load(Ordering::Acquire) {
            std::thread::sleep(LOOK);
        }
        if to.write_all(&piece).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_whole_and_not_before_their_time() {
        let far = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let fault = LinkFault { delay_s: 0.02, loss: 0.1 };
        let target = far.local_addr().unwrap();
        let relay = Relay::start(Ipv4Addr::LOCALHOST, target, fault, 1).unwrap();
        let sent: Vec<u8> = (0..200_000).map(|i| i as u8).collect();
        let mut near = TcpStream::connect(relay.address).unwrap();
        let (mut other, began) = (far.accept().unwrap().0, Instant::now());
        let bytes = sent.clone();
        let writer = std::thread::spawn(move || near.write_all(&bytes));
        let mut got = Vec::new();
        other.read_to_end(&mut got).unwrap();
        writer.join().unwrap().unwrap();
        assert_eq!(got, sent);
        assert!(began.elapsed() >= Duration::from_millis(20));
    }
}
