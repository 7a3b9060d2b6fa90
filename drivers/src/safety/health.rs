//! Watching the servos' own condition while they move.

use servodance_types::JointState;

use super::{Joint, SafeBus, SafetyError};
use crate::bus::Bus;

/// One servo is asked how it is this often, seconds.
const EXAMINE_S: f64 = 0.1;

impl<B: Bus> SafeBus<B> {
    pub(super) fn worst_supply(&self) -> f64 {
        let levels = self.joints.iter().map(|joint| joint.derate.supply().level);
        levels.fold(0.0, f64::max)
    }

    /// Heat, supply and current: one servo is asked now and then.
    pub(super) fn watch_health(
        &mut self,
        now_s: f64,
        states: &[JointState],
    ) -> Result<(), SafetyError> {
        let period_s = 1.0 / self.config.control_hz;
        for (joint, state) in self.joints.iter_mut().zip(states) {
            joint.derate.drew(state.current_a, period_s);
        }
        let before = self.derated();
        let (index, due_s) = self.examine;
        if now_s >= due_s {
            self.examine = ((index + 1) % self.joints.len().max(1), now_s + EXAMINE_S);
            let there = self.joints.get(index).is_some_and(|j| j.lost.is_none());
            // A servo that does not answer is met again, and named, by the cycle.
            if let Some(Ok(health)) = there.then(|| self.bus.examine(index)) {
                self.joints[index].derate.examined(health);
            }
        }
        let faulty = |(index, joint): (usize, &Joint)| Some((index, joint.derate.fault()?));
        if let Some((index, bad)) = self.joints.iter().enumerate().find_map(faulty) {
            let error = SafetyError::Condition {
                servo: self.id_of(index),
                what: bad.what,
                actual: bad.actual,
                limit: bad.limit,
                unit: bad.unit,
            };
            return Err(self.fault_of(now_s, error));
        }
        self.tell_derating(now_s, before);
        Ok(())
    }

    /// The joint with the worst condition, if that makes its motion smaller.
    fn derated(&self) -> Option<usize> {
        let level = |joint: &Joint| joint.derate.own().level.max(joint.derate.supply().level);
        let worst = self.joints.iter().enumerate();
        let worst = worst.max_by(|a, b| level(a.1).total_cmp(&level(b.1)));
        worst
            .filter(|(_, joint)| level(joint) > 0.0)
            .map(|(index, _)| index)
    }

    fn tell_derating(&mut self, now_s: f64, before: Option<usize>) {
        match (before, self.derated()) {
            (None, Some(index)) => {
                let derate = &self.joints[index].derate;
                let (own, supply) = (derate.own(), derate.supply());
                let worst = if own.level > supply.level {
                    own
                } else {
                    supply
                };
                let who = self.id_of(index);
                self.remark(
                    now_s,
                    &format!(
                        "smaller motion: {who}: {} is {:.1} {}, the limit is {:.1} {}",
                        worst.what, worst.actual, worst.unit, worst.limit, worst.unit
                    ),
                );
            }
            (Some(_), None) => self.remark(now_s, "full motion: every servo is well again"),
            _ => {}
        }
    }
}
