//! Everyone on a port at one rate, quickly, whatever else is on the line.
//!
//! Every id is pinged in turn, and the next one is not held up by an adapter that passes
//! answers on late: each ping leaves just enough room on the wire for its answer. Whoever
//! seems to answer is asked again alone. Garbage costs a bounded time and nobody is found
//! in it: an id counts only if it answers by itself.

use std::time::{Duration, Instant};

use dynamixel2::instructions::instruction_id as instruction;
use dynamixel2::instructions::packet_id::BROADCAST;

use crate::error::{BusError, BusResult};
use crate::serial::scan::{FoundServo, SerialScanner, TRIES, families};
use crate::serial::timeout::LONGEST_RETURN_DELAY;
use crate::serial::wire::framing::Framing;
use crate::serial::wire::port::Received;

/// Between an answer and the next ping.
const ROOM: Duration = Duration::from_micros(400);
/// So much damage in one sweep is garbage from somewhere else, not two servos with one id.
const GARBAGE: u64 = 40;
const STRAY_BYTES: usize = 400;
/// How long those who seem to answer on a sound line may take to say more.
const SURE_WAIT: Duration = Duration::from_millis(100);
/// Answers to the last pings may be so late.
const LAST_WAIT: Duration = Duration::from_millis(30);
/// Those who seem to answer are asked alone for so long at most, if nobody does.
const LONGEST_DOUBT: Duration = Duration::from_millis(400);
/// An adapter that echoes makes every id of Protocol 1 seem to answer.
const ECHOED: usize = 200;

/// What one sweep heard.
#[derive(Debug, Default)]
struct Heard {
    /// Who seems to have answered, by id.
    answered: Vec<u8>,
    /// Ids that were being asked when damaged answers came.
    damaged: Vec<u8>,
    /// Damaged packets.
    damage: u64,
    /// Bytes beyond those of the answers.
    stray_bytes: usize,
}

impl SerialScanner {
    /// Everyone who answers, by id.
    pub fn everyone(&mut self) -> BusResult<Vec<FoundServo>> {
        let heard = self.ping_in_turn()?;
        let is_garbage = heard.damage >= GARBAGE || heard.stray_bytes > STRAY_BYTES;
        let mut found = match heard.answered.len() {
            ECHOED.. => self.ask_each((0..BROADCAST).collect(), None)?,
            _ if is_garbage => self.ask_each(heard.answered, Some(LONGEST_DOUBT))?,
            _ => {
                // They are there: a busy machine gets more time.
                let usual = self.wait;
                self.wait = usual.max(SURE_WAIT);
                let found = self.ask_each(heard.answered, None);
                self.wait = usual;
                found?
            }
        };
        if is_garbage {
            // Damaged answers are the garbage's.
            found.retain(|servo| servo.model_number != 0);
        } else if heard.damage > 0 {
            let known: Vec<u8> = found.iter().map(|servo| servo.id).collect();
            let doubtful = heard.damaged.into_iter().filter(|id| !known.contains(id));
            found.extend(self.ask_each(doubtful.collect(), Some(LONGEST_DOUBT))?);
        }
        found.sort_by_key(|servo| servo.id);
        Ok(found)
    }

    /// Pings every id in turn.
    fn ping_in_turn(&mut self) -> BusResult<Heard> {
        const DOING: &str = "ping of every id";
        let framing = self.port.framing();
        let params = framing.ping_params();
        let bytes = 2 * framing.status_bytes() + params;
        let slot = self.port.time(bytes) + LONGEST_RETURN_DELAY + ROOM;
        let mut heard = Heard::default();
        let received = self.port.received();
        self.port.begin_sweep(framing.status_length() + params + 1)?;
        for id in 0..BROADCAST {
            self.port.send_along(id, instruction::PING, DOING)?;
            self.hear(id, Instant::now() + slot, &mut heard)?;
        }
        self.hear(BROADCAST - 1, Instant::now() + self.wait.max(LAST_WAIT), &mut heard)?;
        let answers = heard.answered.len() * (framing.status_bytes() + params);
        heard.stray_bytes = (self.port.received() - received).saturating_sub(answers);
        heard.answered.sort_unstable();
        heard.answered.dedup();
        heard.damaged.sort_unstable();
        heard.damaged.dedup();
        Ok(heard)
    }

    /// Collects what comes until `deadline`, while `asked` was asked last.
    fn hear(&mut self, asked: u8, deadline: Instant, heard: &mut Heard) -> BusResult<()> {
        while Instant::now() < deadline {
            match self.port.receive(deadline, "ping of every id")? {
                Received::Nothing => {}
                Received::Packet => heard.answered.push(self.port.packet().id),
                Received::Corrupt => {
                    heard.damage += 1;
                    if heard.damage < GARBAGE {
                        heard.damaged.push(asked);
                        heard.damaged.extend(asked.checked_sub(1));
                    }
                }
            }
        }
        Ok(())
    }

    /// Asks ids alone, where nobody answers for `doubt` at most.
    fn ask_each(&mut self, ids: Vec<u8>, doubt: Option<Duration>) -> BusResult<Vec<FoundServo>> {
        let mut found = Vec::new();
        let began = Instant::now();
        for id in ids {
            if found.is_empty() && doubt.is_some_and(|doubt| began.elapsed() > doubt) {
                break;
            }
            match self.ping_tries(id, TRIES) {
                Ok(servo) => found.extend(servo),
                Err(BusError::Corrupt { .. }) => found.extend(self.unreadable(id)),
                Err(error) => return Err(error),
            }
        }
        Ok(found)
    }

    fn unreadable(&self, id: u8) -> Option<FoundServo> {
        let (family, service) = families(self.port.framing()).next()?;
        Some(FoundServo {
            baud: self.baud,
            id,
            model_number: 0,
            model: None,
            firmware: 0,
            hardware_error: Some("only damaged answers: is this id given twice?".into()),
            family,
            service,
        })
    }

    /// The rates of a scan that tries them all: so many bits a second and more. Slower ones
    /// take as long as all others together.
    pub fn usual_bauds(framing: Framing) -> impl Iterator<Item = u32> {
        const SLOWEST: u32 = 38_400;
        Self::bauds(framing).iter().copied().filter(|baud| *baud >= SLOWEST)
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::os::unix::net::UnixListener;

    /// Everything that looks like a packet and is none, without end.
    fn flood(mut line: impl Write) {
        let mut noise = 1u32;
        loop {
            let bytes: Vec<u8> = (0..512)
                .map(|_| {
                    noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    match noise >> 30 {
                        0 => 0xFF,
                        1 => 0xFD,
                        _ => (noise >> 16) as u8,
                    }
                })
                .collect();
            if line.write_all(&bytes).is_err() {
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn nobody_is_found_in_garbage_without_end() {
        for framing in SerialScanner::FRAMINGS {
            let name = format!("sweep-{framing:?}-{}", std::process::id());
            let path = std::env::temp_dir().join(name);
            let listener = UnixListener::bind(&path).unwrap();
            let wait = Duration::from_millis(5);
            let port = path.to_str().unwrap();
            let mut scanner = SerialScanner::open(port, 1_000_000, framing, wait).unwrap();
            std::fs::remove_file(&path).unwrap();
            let line = listener.accept().unwrap().0;
            let mut asked = line.try_clone().unwrap();
            std::thread::spawn(move || std::io::copy(&mut asked, &mut std::io::sink()));
            std::thread::spawn(move || flood(line));
            assert_eq!(scanner.everyone().unwrap(), []);
        }
    }
}
