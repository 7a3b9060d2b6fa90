//! How far each joint went: what nothing moves is no dance.

/// A dance whose widest joint goes less far shows nothing, degrees.
const STILL_DEG: f64 = 1.0;

/// The lowest and the highest position of each joint so far, radians.
#[derive(Clone, Debug)]
pub struct JointSpans(Vec<(f64, f64)>);

impl JointSpans {
    /// Of so many joints, none seen yet.
    pub fn new(joints: usize) -> Self {
        Self(vec![(f64::INFINITY, f64::NEG_INFINITY); joints])
    }

    /// Takes in the positions of one moment.
    pub fn see(&mut self, positions_rad: &[f64]) {
        for ((low, high), &at) in self.0.iter_mut().zip(positions_rad) {
            (*low, *high) = (low.min(at), high.max(at));
        }
    }

    /// Refuses to call it a dance if no joint moved.
    pub fn refuse_still(&self) -> anyhow::Result<()> {
        let spans = self.0.iter().map(|(low, high)| high - low);
        let widest_deg = spans.fold(0.0, f64::max).to_degrees();
        if widest_deg < STILL_DEG {
            anyhow::bail!(
                "nothing moves: no joint goes further than {widest_deg:.1} degrees in the whole \
                 dance; name the body's parts in [retarget.body], or look at kind, gain and limits"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dance_without_movement_is_refused() {
        let mut spans = JointSpans::new(2);
        spans.see(&[0.0, 1.0]);
        spans.see(&[0.01, 1.0]);
        assert!(spans.refuse_still().is_err());
        spans.see(&[0.0, 0.9]);
        assert!(spans.refuse_still().is_ok());
    }
}
