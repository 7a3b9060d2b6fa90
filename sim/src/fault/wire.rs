//! Fault injection on a wire: replies and frames that are lost, late or damaged.

use crate::fault::WireFault;
use crate::fault::random::SplitMix64;

/// How a CAN frame of a motor reaches the host.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CanPassage {
    pub copies: u64,
    pub damaged: bool,
    /// How much later, seconds of wall time.
    pub late_s: f64,
    pub noise: Vec<u8>,
}

fn hits_replies(fault: WireFault) -> bool {
    !matches!(fault, WireFault::Echo | WireFault::CorruptInstruction | WireFault::Bytes)
}

#[derive(Clone, Debug)]
pub(crate) struct FaultyWire {
    random: SplitMix64,
    /// What hits this share of the replies.
    pub fault: Option<(WireFault, f64)>,
    pub hit_count: u64,
}

impl FaultyWire {
    pub fn new(seed: u64) -> Self {
        Self { random: SplitMix64(seed), fault: None, hit_count: 0 }
    }

    /// The fault, if it hits this time and `concerns` it.
    fn roll(&mut self, concerns: impl Fn(WireFault) -> bool) -> Option<WireFault> {
        let (fault, share) = self.fault.filter(|(fault, _)| concerns(*fault))?;
        let hit = self.random.share() < share;
        self.hit_count += u64::from(hit);
        hit.then_some(fault)
    }

    /// The host's bytes as they reach the servos.
    pub fn pass_instruction(&mut self, bytes: &mut [u8]) {
        if self.hits(WireFault::CorruptInstruction) && !bytes.is_empty() {
            self.flip(bytes);
        }
        self.damage_bytes(bytes);
    }

    fn damage_bytes(&mut self, bytes: &mut [u8]) {
        let Some((WireFault::Bytes, share)) = self.fault else { return };
        for byte in bytes {
            if self.random.share() < share {
                *byte ^= 1 << self.random.below(8);
                self.hit_count += 1;
            }
        }
    }

    /// Whether this fault is set, and hits this time.
    pub fn hits(&mut self, wanted: WireFault) -> bool {
        self.roll(|fault| fault == wanted).is_some()
    }

    /// The reply as it reaches the host, and how much later, seconds.
    pub fn pass_reply(&mut self, mut bytes: Vec<u8>) -> (Vec<u8>, f64) {
        let mut late_s = 0.0;
        self.damage_bytes(&mut bytes);
        match self.roll(hits_replies) {
            Some(WireFault::Drop | WireFault::Lose) => bytes.clear(),
            Some(WireFault::Late(seconds)) => late_s = seconds,
            Some(WireFault::Corrupt) => self.flip(&mut bytes),
            Some(WireFault::Truncate) => bytes.truncate(self.random.below(bytes.len())),
            Some(WireFault::Duplicate) => bytes.extend_from_within(..),
            Some(WireFault::Noise) => {
                let noise = self.noise();
                bytes.splice(..0, noise);
            }
            _ => {}
        }
        (bytes, late_s)
    }

    /// Passes a CAN frame of a motor to the host.
    pub fn pass_frame(&mut self) -> CanPassage {
        let mut passed = CanPassage { copies: 1, ..CanPassage::default() };
        match self.roll(hits_replies) {
            Some(WireFault::Drop | WireFault::Lose) => passed.copies = 0,
            // Half a line of the adapter: the rest of it is noise.
            Some(WireFault::Truncate) => {
                passed.copies = 0;
                passed.noise = b"t0018\r".to_vec();
            }
            Some(WireFault::Late(seconds)) => passed.late_s = seconds,
            Some(WireFault::Corrupt) => passed.damaged = true,
            Some(WireFault::Duplicate) => passed.copies = 2,
            Some(WireFault::Noise) => {
                passed.noise = self.noise();
                // A burst ends: the next line is whole.
                passed.noise.push(b'\r');
            }
            _ => {}
        }
        passed
    }

    fn noise(&mut self) -> Vec<u8> {
        let length = 1 + self.random.below(20);
        (0..length).map(|_| self.random.next_u64() as u8).collect()
    }

    fn flip(&mut self, bytes: &mut [u8]) {
        let at = self.random.below(bytes.len());
        let bit = self.random.below(8);
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
        wire.fault = Some((fault, share));
        wire
    }

    #[test]
    fn a_share_of_the_replies_is_hit_and_the_seed_repeats_it() {
        let run = || {
            let mut wire = wire(WireFault::Corrupt, 0.1);
            let replies: Vec<_> = (0..1000).map(|_| wire.pass_reply(vec![0; 20]).0).collect();
            (replies, wire.hit_count)
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
        assert!(wire(WireFault::Drop, 1.0).pass_reply(reply.clone()).0.is_empty());
        assert_eq!(wire(WireFault::Late(0.5), 1.0).pass_reply(reply.clone()), (reply.clone(), 0.5));
        assert!(wire(WireFault::Truncate, 1.0).pass_reply(reply.clone()).0.len() < 3);
        assert_eq!(wire(WireFault::Duplicate, 1.0).pass_reply(reply.clone()).0, [1, 2, 3, 1, 2, 3]);
        assert!(wire(WireFault::Noise, 1.0).pass_reply(reply.clone()).0.ends_with(&reply));
        assert!(wire(WireFault::Lose, 1.0).pass_reply(reply.clone()).0.is_empty());
        let (damaged, _) = wire(WireFault::Bytes, 0.5).pass_reply(vec![0; 1000]);
        let flipped = damaged.iter().filter(|byte| byte.count_ones() == 1).count();
        assert!((400..600).contains(&flipped), "{flipped}");
        let mut instruction = reply.clone();
        wire(WireFault::CorruptInstruction, 1.0).pass_instruction(&mut instruction);
        assert_ne!(instruction, reply);
        assert!(
            wire(WireFault::Echo, 1.0).hits(WireFault::Echo)
                && !wire(WireFault::Drop, 1.0).hits(WireFault::Echo)
        );
    }
}
