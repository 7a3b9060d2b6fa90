//! Heat, supply and current of the servos while they move.

use servodance_types::JointState;

use super::error::SafetyError;
use super::joint::SafeJoint;
use super::safe_bus::SafeBus;
use crate::bus::Bus;
use crate::error::BusError;

/// The health of one servo is read this often, seconds, and so much later where cycles leave
/// no time for it.
const EXAMINE_S: f64 = 0.1;
const LATEST_S: f64 = 0.4;

impl<B: Bus> SafeBus<B> {
    pub(super) fn worst_supply(&self) -> f64 {
        let levels = self.joints.iter().map(|joint| joint.derate.supply().level);
        levels.fold(0.0, f64::max)
    }

    pub(super) fn watch_health(
        &mut self,
        now_s: f64,
        states: &mut [JointState],
    ) -> Result<(), SafetyError> {
        let period_s = self.config.period_s();
        for (joint, state) in self.joints.iter_mut().zip(states.iter()) {
            joint.derate.add_current(state.current_a, period_s);
        }
        let before = self.derated();
        let (index, due_s) = self.examine;
        if now_s >= due_s && self.bus.has_time() || now_s >= due_s + LATEST_S {
            self.examine = ((index + 1) % self.joints.len().max(1), now_s + EXAMINE_S);
            let there = self.joints.get(index).is_some_and(|j| j.lost.is_none());
            match there.then(|| self.bus.examine(index)) {
                Some(Ok(health)) => self.joints[index].derate.set_health(health),
                Some(Err(error @ BusError::Tripped { .. })) => {
                    self.cycle_failed(now_s, error, states)?;
                }
                // The next cycle names a servo that does not answer.
                Some(Err(_)) | None => {}
            }
        }
        let faulty = |(index, joint): (usize, &SafeJoint)| Some((index, joint.derate.fault()?));
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
        self.remark_derating(now_s, before);
        Ok(())
    }

    fn derated(&self) -> Option<usize> {
        let level = |joint: &SafeJoint| joint.derate.worst().level;
        let joints = self.joints.iter().enumerate();
        let worst = joints.max_by(|a, b| level(a.1).total_cmp(&level(b.1)));
        worst.filter(|(_, joint)| level(joint) > 0.0).map(|(index, _)| index)
    }

    fn remark_derating(&mut self, now_s: f64, before: Option<usize>) {
        match (before, self.derated()) {
            (None, Some(index)) => {
                let worst = self.joints[index].derate.worst();
                let remark = format!(
                    "smaller motion: {}: {} is {:.1} {}, the limit is {:.1} {}",
                    self.id_of(index),
                    worst.what,
                    worst.actual,
                    worst.unit,
                    worst.limit,
                    worst.unit
                );
                self.remark(now_s, &remark);
            }
            (Some(_), None) => self.remark(now_s, "full motion: every servo is well again"),
            _ => {}
        }
    }
}
