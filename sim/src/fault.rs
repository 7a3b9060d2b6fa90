//! Things that go wrong: on the wire, in a servo, at the adapter.
//!
//! Wire faults hit a share of the replies, chosen by a seeded generator, so
//! that a run in lockstep can be repeated.

/// What can happen to a reply on its way to the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WireFault {
    /// The reply is lost.
    Drop,
    /// The reply comes late by this much wall time, seconds.
    Late(f64),
    /// One bit is flipped.
    Corrupt,
    /// The reply ends early.
    Truncate,
    /// The reply comes twice.
    Duplicate,
    /// Random bytes come first.
    Noise,
    /// The host hears its own instruction before the reply, as on adapters
    /// without direction control.
    Echo,
    /// One bit of the host's instruction is flipped on its way to the servos.
    CorruptInstruction,
}

/// What can happen to a servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoFault {
    /// Its cable is cut: it hears and says nothing, and goes on as it was.
    Dead,
    /// Its cable is mended: it hears and answers again.
    Revive,
    /// It restarts: deaf for 0.3 s, then without torque.
    Reboot,
    /// Its winding is this hot, Celsius.
    Overheat(f64),
    /// Its shaft is held; it will overload in time.
    Jam,
    /// Its shaft is free again.
    Free,
    /// It shuts down from overload now.
    Overload,
    /// Its supply changes, volts.
    Supply(f64),
    /// Somebody turns the limp joint by hand, to this many radians.
    Moved(f64),
    /// It is set to another rate than the bus: it hears garbage and stays silent.
    Baud(u32),
    /// It answers to another id; if that one is taken, both answer at once.
    Id(u8),
}

/// A small seeded generator (SplitMix64).
#[derive(Clone, Debug)]
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Below `bound`, which is above zero.
    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound.max(1) as u64) as usize
    }
}

/// What became of a CAN frame on its way to the host.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Passed {
    /// How often it arrives.
    pub copies: usize,
    /// Damaged and said again, as CAN does by itself.
    pub damaged: bool,
    /// How much later, seconds of wall time.
    pub late_s: f64,
    /// Bytes in front of it that mean nothing.
    pub noise: Vec<u8>,
}

/// The faults of one wire.
#[derive(Clone, Debug)]
pub(crate) struct FaultyWire {
    dice: Dice,
    fault: Option<(WireFault, f64)>,
    /// Replies or instructions hit so far.
    pub hits: u64,
}

impl FaultyWire {
    pub fn new(seed: u64) -> Self {
        Self {
            dice: Dice(seed),
            fault: None,
            hits: 0,
        }
    }

    /// From now on `fault` hits this share of the replies; `None` ends faults.
    pub fn set(&mut self, fault: Option<(WireFault, f64)>) {
        self.fault = fault;
    }

    /// The fault, if it hits this time.
    fn roll(&mut self, concerns: impl Fn(WireFault) -> bool) -> Option<WireFault> {
        let (fault, share) = self.fault.filter(|(fault, _)| concerns(*fault))?;
        let hit = self.dice.share() < share;
        self.hits += u64::from(hit);
        hit.then_some(fault)
    }

    /// What the servos hear of the host's `bytes`.
    pub fn pass_instruction(&mut self, bytes: &mut [u8]) {
        let hit = self.roll(|fault| fault == WireFault::CorruptInstruction);
        if hit.is_some() && !bytes.is_empty() {
            self.flip(bytes);
        }
    }

    /// Whether the host hears its own bytes.
    pub fn echoes(&mut self) -> bool {
        self.roll(|fault| fault == WireFault::Echo).is_some()
    }

    /// What the host hears of a reply, and how much later, seconds.
    pub fn pass_reply(&mut self, mut bytes: Vec<u8>) -> (Vec<u8>, f64) {
        let to_replies = |fault| !matches!(fault, WireFault::Echo | WireFault::CorruptInstruction);
        let mut late_s = 0.0;
        match self.roll(to_replies) {
            Some(WireFault::Drop) => bytes.clear(),
            Some(WireFault::Late(seconds)) => late_s = seconds,
            Some(WireFault::Corrupt) => self.flip(&mut bytes),
            Some(WireFault::Truncate) => bytes.truncate(self.dice.below(bytes.len())),
            Some(WireFault::Duplicate) => bytes.extend_from_within(..),
            Some(WireFault::Noise) => {
                let noise = (0..1 + self.dice.below(20)).map(|_| self.dice.next() as u8);
                bytes = noise.collect::<Vec<_>>().into_iter().chain(bytes).collect();
            }
            _ => {}
        }
        (bytes, late_s)
    }

    /// Whether the motors miss a frame of the host. What damages a serial
    /// instruction makes an adapter lose a frame: CAN repeats damaged ones.
    pub fn loses_instruction(&mut self) -> bool {
        let lost = |fault| fault == WireFault::CorruptInstruction;
        self.roll(lost).is_some()
    }

    /// What becomes of a motor's CAN frame.
    pub fn pass_frame(&mut self) -> Passed {
        let mut passed = Passed {
            copies: 1,
            ..Passed::default()
        };
        let to_replies = |fault| !matches!(fault, WireFault::Echo | WireFault::CorruptInstruction);
        match self.roll(to_replies) {
            Some(WireFault::Drop) => passed.copies = 0,
            // Half a line of the adapter: the rest of it is noise.
            Some(WireFault::Truncate) => {
                passed.copies = 0;
                passed.noise = b"t0018\r".to_vec();
            }
            Some(WireFault::Late(seconds)) => passed.late_s = seconds,
            Some(WireFault::Corrupt) => passed.damaged = true,
            Some(WireFault::Duplicate) => passed.copies = 2,
            Some(WireFault::Noise) => {
                let length = 1 + self.dice.below(20);
                passed.noise = (0..length).map(|_| self.dice.next() as u8).collect();
                // A burst ends: the next line is whole.
                passed.noise.push(b'\r');
            }
            _ => {}
        }
        passed
    }

    fn flip(&mut self, bytes: &mut [u8]) {
        let at = self.dice.below(bytes.len());
        let bit = self.dice.below(8);
        if let Some(byte) = bytes.get_mut(at) {
            *byte ^= 1 << bit;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire(fault: WireFault, share: f64) -> FaultyWire {
        let mut wire = FaultyWire::new(7);
        wire.set(Some((fault, share)));
        wire
    }

    #[test]
    fn a_share_of_the_replies_is_hit_and_the_seed_repeats_it() {
        let run = || {
            let mut wire = wire(WireFault::Corrupt, 0.1);
            let replies: Vec<_> = (0..1000).map(|_| wire.pass_reply(vec![0; 20]).0).collect();
            (replies, wire.hits)
        };
        let (replies, hits) = run();
        assert!((70..130).contains(&hits), "{hits}");
        let damaged = replies.iter().filter(|reply| **reply != vec![0; 20]);
        assert_eq!(damaged.count() as u64, hits);
        assert_eq!(run(), (replies, hits));
    }

    #[test]
    fn each_fault_does_what_it_says() {
        let reply = vec![1, 2, 3];
        assert!(
            wire(WireFault::Drop, 1.0)
                .pass_reply(reply.clone())
                .0
                .is_empty()
        );
        assert_eq!(
            wire(WireFault::Late(0.5), 1.0).pass_reply(reply.clone()),
            (reply.clone(), 0.5)
        );
        assert!(
            wire(WireFault::Truncate, 1.0)
                .pass_reply(reply.clone())
                .0
                .len()
                < 3
        );
        assert_eq!(
            wire(WireFault::Duplicate, 1.0).pass_reply(reply.clone()).0,
            [1, 2, 3, 1, 2, 3]
        );
        assert!(
            wire(WireFault::Noise, 1.0)
                .pass_reply(reply.clone())
                .0
                .ends_with(&reply)
        );
        let mut instruction = reply.clone();
        wire(WireFault::CorruptInstruction, 1.0).pass_instruction(&mut instruction);
        assert_ne!(instruction, reply);
        assert!(wire(WireFault::Echo, 1.0).echoes() && !wire(WireFault::Drop, 1.0).echoes());
    }
}
