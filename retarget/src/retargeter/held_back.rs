//! Which joints do not go where the dance would have them, and why.

use servodance_types::HeldBack;

use super::Retargeter;

/// A share of the movement below this is less than all of it.
const ALL: f64 = 0.98;
/// A joint this near the end of its range is at its end, radians (metres, if it slides).
const AT_END_RAD: f64 = 2e-3;
/// Nearer to rest than this a joint at its end is not held back: rest itself may be there.
const AT_REST_RAD: f64 = 0.03;
/// A command changed by more than this is a changed one, radians.
const CHANGED_RAD: f64 = 1e-5;

impl Retargeter {
    /// What holds each joint back in the last cycle, in the order of all position slices.
    pub fn held_back(&self) -> &[HeldBack] {
        &self.held
    }

    /// What holds a joint back before its own limits are asked: its limb's motors, the feet
    /// that would have to carry it, the end of its range.
    pub(super) fn held_by_the_body(&self, joint: usize) -> HeldBack {
        let limb = self.limbs[joint];
        let carried = self.carried(joint);
        let balance = if carried < ALL { HeldBack::Balance } else { HeldBack::Nothing };
        self.torque.held_back(limb).max(balance).max(self.at_end(joint))
    }

    fn at_end(&self, joint: usize) -> HeldBack {
        let limits = &self.dance_limits[joint];
        let asked = match (&self.stance, self.stands_on[joint]) {
            (Some(stance), true) => stance.legs.positions[joint],
            _ => self.solver.positions[joint],
        };
        let room = (asked - limits.lower_rad).min(limits.upper_rad - asked);
        match room < AT_END_RAD && (asked - self.rest[joint]).abs() > AT_REST_RAD {
            true => HeldBack::Limit,
            false => HeldBack::Nothing,
        }
    }

    /// Share of a joint's movement that the feet can carry.
    pub(super) fn carried(&self, joint: usize) -> f64 {
        self.stance.as_ref().map_or(1.0, |stance| match self.limbs[joint].is_arm_or_head() {
            true => stance.governor.upper(joint),
            false => stance.governor.pelvis,
        })
    }

    /// What a joint's own way took from `aimed`: its speed and acceleration, then the gap
    /// that is kept between parts of the body.
    pub(super) fn held_on_its_way(&mut self, joint: usize, aimed: f64, allowed: f64) {
        if (allowed - aimed).abs() > CHANGED_RAD {
            self.held[joint] = self.held[joint].max(HeldBack::Speed);
        }
    }

    pub(super) fn held_apart(&mut self) {
        for joint in 0..self.held.len() {
            let asked = self.output[joint] + self.collision_limit.asked_step(joint);
            if (self.wanted[joint] - asked).abs() > CHANGED_RAD {
                self.held[joint] = self.held[joint].max(HeldBack::Collision);
            }
        }
    }
}
