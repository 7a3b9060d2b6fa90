//! Detects a dance that stalled: a model that continues what it sees goes on
//! standing once it stands.

use crate::motion::Pose;

/// Below this mean joint speed the dancer stands still, metres a frame.
const STILL_M: f32 = 0.1 / 20.0;
/// Standing still for so long while a beat is heard is a stall.
const STALL_FRAMES: u32 = 20;
/// From this confidence on a beat is heard.
const HEARD_CONFIDENCE: f32 = 0.5;

/// Notices a dancer who stands still although a beat is heard.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StallDetector {
    last: Option<Pose>,
    still_frames: u32,
    /// Restarts since the last time that the dancer moved.
    pub in_a_row: u32,
    pub restarts: u64,
}

impl StallDetector {
    /// Whether the dance stalled and is to be restarted; counts it.
    pub fn stalled(&mut self, pose: &Pose, confidence: f32) -> bool {
        let moved_m = self.last.map_or(f32::INFINITY, |last| mean_step_m(&last, pose));
        self.last = Some(*pose);
        if moved_m > STILL_M {
            self.still_frames = 0;
            if moved_m > 4.0 * STILL_M {
                self.in_a_row = 0;
            }
        } else if confidence >= HEARD_CONFIDENCE {
            self.still_frames += 1;
        }
        if self.still_frames < STALL_FRAMES {
            return false;
        }
        self.still_frames = 0;
        self.in_a_row += 1;
        self.restarts += 1;
        true
    }
}

fn mean_step_m(a: &Pose, b: &Pose) -> f32 {
    let step = |(p, q): (&[f32; 3], &[f32; 3])| {
        let squared: f32 = p.iter().zip(q).map(|(x, y)| (y - x).powi(2)).sum();
        squared.sqrt()
    };
    a.iter().zip(b).map(step).sum::<f32>() / a.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_types::JOINT_COUNT;

    #[test]
    fn a_still_dancer_is_restarted_only_while_a_beat_is_heard() {
        let pose = [[0.0; 3]; JOINT_COUNT];
        let mut detector = StallDetector::default();
        assert!((0..200).all(|_| !detector.stalled(&pose, 0.0)));
        let restarts = (0..100).filter(|_| detector.stalled(&pose, 0.9)).count();
        assert_eq!((restarts, detector.in_a_row), (5, 5));
        let moving =
            (0..100).filter(|i| detector.stalled(&[[0.03 * *i as f32; 3]; JOINT_COUNT], 0.9));
        assert_eq!(moving.count(), 0);
        assert_eq!((detector.in_a_row, detector.restarts), (0, 5));
    }
}
