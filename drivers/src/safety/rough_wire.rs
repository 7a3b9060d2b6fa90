//! A wire that loses or damages packets: told when it begins, when it grows, and when it
//! is over. The bus rides single losses out by itself; what it cannot ride out is a lost
//! servo.

use super::safe_bus::SafeBus;
use crate::bus::Bus;

fn slow_link(delay_ms: f64, period_ms: f64) -> String {
    match delay_ms > 0.0 {
        true => format!(
            "answers take {delay_ms:.1} ms longer than the wire, of {period_ms:.1} ms for a cycle: \
             look at the adapter's latency timer, or for what keeps this machine busy"
        ),
        false => "answers are prompt again".into(),
    }
}

impl<B: Bus> SafeBus<B> {
    /// After several cycles without any answer the motion is blended in again from the last
    /// goals that were sent.
    pub(super) fn watch_unheard(&mut self, now_s: f64) {
        let Some(cycles) = self.unheard.look(self.bus.stats().unheard) else { return };
        self.begin_ramp(now_s);
        self.remark(now_s, &format!("nobody answered for {cycles} cycles; going on gently"));
    }

    pub(super) fn watch_wire(&mut self, now_s: f64) {
        if !self.rough_wire.is_due(now_s) {
            return;
        }
        let (stats, servos) = (self.bus.stats(), self.bus.error_counters());
        if let Some((delay_s, period_s)) = self.link_delay.look(now_s, stats) {
            self.remark(now_s, &slow_link(delay_s * 1e3, period_s * 1e3));
        }
        let Some(rough) = self.rough_wire.look(now_s, stats, &servos) else { return };
        if rough.share == 0.0 {
            self.remark(now_s, "the wire is sound again");
            return;
        }
        let whom = match rough.worst {
            Some(index) => format!(", most of them with {}", self.id_of(index)),
            None => String::new(),
        };
        let per_cent = rough.share * 100.0;
        self.remark(
            now_s,
            &format!(
                "{per_cent:.0} answers late, lost or damaged in 100 cycles{whom}: ridden out; \
                 look after contacts and cables, or for what keeps this machine busy"
            ),
        );
    }
}
