//! Answers that are still owed.
//!
//! A status packet says who answers, and not what was asked. When a question got
//! no answer in time and is asked again, two answers may come, and the second one
//! would pass for that of the next question if it is as long: the value of
//! another register. So what was asked in vain is remembered, and a question that
//! could be given its answer lets it come first.

/// Questions in vain that are remembered; a servo that is gone asks for no more.
const MOST: usize = 16;

/// One instruction to one servo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Question<'a> {
    /// Who is asked.
    pub id: u8,
    /// Of the protocol.
    pub instruction: u8,
    /// Of the instruction.
    pub params: &'a [u8],
    /// Parameters that the answer has.
    pub reply: usize,
}

/// A question in vain.
#[derive(Debug)]
struct InVain {
    id: u8,
    instruction: u8,
    params: Vec<u8>,
    reply: usize,
    times: usize,
}

impl InVain {
    fn is(&self, question: &Question) -> bool {
        (self.id, self.instruction, self.params.as_slice())
            == (question.id, question.instruction, question.params)
    }
}

/// What was asked in vain.
#[derive(Debug, Default)]
pub struct Owed {
    in_vain: Vec<InVain>,
}

impl Owed {
    /// No answer came in time.
    pub fn note(&mut self, question: &Question) {
        if let Some(same) = self.in_vain.iter_mut().find(|q| q.is(question)) {
            same.times += 1;
            return;
        }
        if self.in_vain.len() == MOST {
            self.in_vain.remove(0);
        }
        self.in_vain.push(InVain {
            id: question.id,
            instruction: question.instruction,
            params: question.params.to_vec(),
            reply: question.reply,
            times: 1,
        });
    }

    /// How many answers to other questions may come and would pass for that of
    /// this one.
    pub fn mistakable(&self, question: &Question) -> usize {
        let others = self.in_vain.iter().filter(|q| !q.is(question));
        others
            .filter(|q| (q.id, q.reply) == (question.id, question.reply))
            .map(|q| q.times)
            .sum()
    }

    /// Nothing that was asked of `id` before is answered any more.
    pub fn forget(&mut self, id: u8) {
        self.in_vain.retain(|q| q.id != id);
    }

    /// Nothing that was asked before is answered any more.
    pub fn forget_all(&mut self) {
        self.in_vain.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(id: u8, address: &[u8], reply: usize) -> Question<'_> {
        Question {
            id,
            instruction: 2,
            params: address,
            reply,
        }
    }

    #[test]
    fn only_answers_that_look_alike_are_waited_for() {
        let mut owed = Owed::default();
        let limit = read(1, &[48], 4);
        assert_eq!(owed.mistakable(&limit), 0);
        owed.note(&limit);
        owed.note(&limit);
        owed.note(&read(2, &[48], 4));
        assert_eq!(owed.mistakable(&limit), 0, "the same answer");
        assert_eq!(owed.mistakable(&read(1, &[52], 4)), 2);
        assert_eq!(owed.mistakable(&read(1, &[52], 1)), 0, "another length");
        assert_eq!(owed.mistakable(&read(3, &[52], 4)), 0, "another servo");
        owed.forget(1);
        assert_eq!(owed.mistakable(&read(1, &[52], 4)), 0);
        assert_eq!(owed.mistakable(&read(2, &[52], 4)), 1);
    }

    #[test]
    fn a_servo_that_is_gone_takes_no_memory() {
        let mut owed = Owed::default();
        let addresses: Vec<[u8; 1]> = (0..=255).map(|address| [address]).collect();
        for address in &addresses {
            owed.note(&read(1, address, 4));
        }
        assert_eq!(owed.mistakable(&read(1, &[0], 4)), MOST);
    }
}
