//! What is told of a robot's body after a dance in a world.

use super::choice::WorldChoice;
use crate::telemetry::ViolationReport;
use serde::{Deserialize, Serialize};
use servodance_sim::world::BodyFigures;

/// The body of a simulated robot, from torque on to the end or to its fall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)] // docs/report.md
pub struct BodyReport {
    pub world: String,
    pub fell: bool,
    pub fell_s: Option<f64>,
    pub fall_announced_s: Option<f64>,
    pub tilt_rms_deg: f64,
    pub slip_mm_min: f64,
    pub load_share: [f64; 2],
    pub work_j: f64,
    pub beyond_limits: ViolationReport,
}

impl BodyReport {
    /// From the figures of a world; `fell_s` is robot time, `moved` the limits that true
    /// motion broke.
    pub fn new(
        world: WorldChoice,
        figures: &BodyFigures,
        fell_s: Option<f64>,
        moved: ViolationReport,
    ) -> Self {
        let minutes = (figures.seconds / 60.0).max(1e-9);
        Self {
            world: world.name().into(),
            fell: figures.fell,
            fell_s,
            fall_announced_s: None,
            tilt_rms_deg: figures.tilt_rms_rad.to_degrees(),
            slip_mm_min: figures.slip_m * 1e3 / minutes,
            load_share: figures.load_share,
            work_j: figures.work_j,
            beyond_limits: moved,
        }
    }

    /// A line for people.
    pub fn line(&self) -> String {
        let work = format!("{:.0} J of work", self.work_j);
        if self.world != WorldChoice::Floor.name() {
            return format!("on a {}: {work}", self.world);
        }
        let [left, right] = self.load_share.map(|share| share * 100.0);
        let fell = match (self.fell, self.fell_s) {
            (_, Some(fell_s)) => format!("fell after {fell_s:.2} s"),
            (true, None) => "fell".into(),
            (false, None) => "stayed on its feet".into(),
        };
        format!(
            "{fell}; leaned {:.1} degrees RMS, soles slid {:.0} mm/min, load on the left foot \
             {left:.0} %, on the right {right:.0} % of the time, {work}",
            self.tilt_rms_deg, self.slip_mm_min
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fall_is_told_with_its_time() {
        let figures = BodyFigures {
            seconds: 30.0,
            fell: true,
            tilt_rms_rad: 0.1,
            slip_m: 0.004,
            load_share: [0.99, 0.5],
            work_j: 41.7,
        };
        let inside = ViolationReport::default();
        let fell = BodyReport::new(WorldChoice::Floor, &figures, Some(30.5), inside).line();
        assert!(fell.contains("fell after 30.50 s") && fell.contains("8 mm/min"), "{fell}");
        assert!(fell.contains("right 50 %") && fell.contains("42 J"), "{fell}");
        let hangs = BodyReport::new(WorldChoice::Stand, &figures, None, inside).line();
        assert_eq!(hangs, "on a stand: 42 J of work");
    }
}
