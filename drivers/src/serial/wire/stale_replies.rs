//! Stale replies: answers that may still come to requests that timed out.
//!
//! A status packet says who answers, and not what was asked. When a request
//! times out and is sent again, two answers may come, and the second one
//! would pass for that of the next request if it is as long: the value of
//! another register. So requests without an answer are remembered, and a request
//! that could be given a stale reply lets that come first.

const MOST: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoRequest<'a> {
    pub id: u8,
    pub instruction: u8,
    pub params: &'a [u8],
    pub reply: usize,
}

#[derive(Debug)]
struct Unanswered {
    id: u8,
    instruction: u8,
    params: Vec<u8>,
    reply: usize,
    times: usize,
}

impl Unanswered {
    fn is(&self, request: &ServoRequest) -> bool {
        (self.id, self.instruction, self.params.as_slice())
            == (request.id, request.instruction, request.params)
    }
}

#[derive(Debug, Default)]
pub struct StaleReplies {
    unanswered: Vec<Unanswered>,
}

impl StaleReplies {
    pub fn note(&mut self, request: &ServoRequest) {
        if let Some(same) = self.unanswered.iter_mut().find(|other| other.is(request)) {
            same.times += 1;
            return;
        }
        if self.unanswered.len() == MOST {
            self.unanswered.remove(0);
        }
        self.unanswered.push(Unanswered {
            id: request.id,
            instruction: request.instruction,
            params: request.params.to_vec(),
            reply: request.reply,
            times: 1,
        });
    }

    /// How many answers to other requests may come and would pass for that of this one.
    pub fn mistakable(&self, request: &ServoRequest) -> usize {
        let others = self.unanswered.iter().filter(|other| !other.is(request));
        others
            .filter(|other| (other.id, other.reply) == (request.id, request.reply))
            .map(|other| other.times)
            .sum()
    }

    /// Nothing that was asked of `id` before is answered any more.
    pub fn forget(&mut self, id: u8) {
        self.unanswered.retain(|other| other.id != id);
    }

    pub fn forget_all(&mut self) {
        self.unanswered.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(id: u8, address: &[u8], reply: usize) -> ServoRequest<'_> {
        ServoRequest { id, instruction: 2, params: address, reply }
    }

    #[test]
    fn only_answers_that_look_alike_are_waited_for() {
        let mut stale = StaleReplies::default();
        let limit = read(1, &[48], 4);
        assert_eq!(stale.mistakable(&limit), 0);
        stale.note(&limit);
        stale.note(&limit);
        stale.note(&read(2, &[48], 4));
        assert_eq!(stale.mistakable(&limit), 0, "the same answer");
        assert_eq!(stale.mistakable(&read(1, &[52], 4)), 2);
        assert_eq!(stale.mistakable(&read(1, &[52], 1)), 0, "another length");
        assert_eq!(stale.mistakable(&read(3, &[52], 4)), 0, "another servo");
        stale.forget(1);
        assert_eq!(stale.mistakable(&read(1, &[52], 4)), 0);
        assert_eq!(stale.mistakable(&read(2, &[52], 4)), 1);
    }

    #[test]
    fn a_servo_that_is_gone_takes_no_memory() {
        let mut stale = StaleReplies::default();
        let addresses: Vec<[u8; 1]> = (0..=255).map(|address| [address]).collect();
        for address in &addresses {
            stale.note(&read(1, address, 4));
        }
        assert_eq!(stale.mistakable(&read(1, &[0], 4)), MOST);
    }
}
