//! Checks that a motion is fit for training: somebody moves, y is up, bones keep their
//! length, left and right are not exchanged.
//!
//! Look at motion as it was read: on the common skeleton every bone has its
//! length again.

use servodance_types::BodyJoint;

use servodance_model::motion::Pose;
use servodance_model::motion::representation::heading_rad;
use servodance_model::motion::skeleton::bone_length_m;
use servodance_model::motion::vec3::{norm, sub, turn, wide};

/// A bone off its usual length by this share is broken in that frame.
const BROKEN: f64 = 0.25;
/// Share of frames that may be broken.
const BROKEN_FRAMES: f64 = 0.02;
/// Left and right count as exchanged where that brings the length this near.
const MENDED: f64 = 0.1;
/// Share of frames whose toes point backwards in a body that is mirrored.
const BACKWARDS: f64 = 0.8;
/// Least way of some joint from its mean place, metres: less is no motion.
const LEAST_MOTION_M: f64 = 0.01;
/// A body stands along an axis in a frame where so much of it, feet to head, is along it.
const ALONG: f64 = 0.9;
/// Share of frames in which a body stands along z where z is up. Nobody lies so straight.
const STANDS_ALONG_Z: f64 = 0.9;

/// Fails where nothing moves, or where z is up instead of y.
pub fn checked_motion(poses: &[Pose]) -> Result<(), String> {
    if poses.len() > 1 && largest_way_m(poses) < LEAST_MOTION_M {
        return Err("nothing moves: all frames are alike".into());
    }
    let stands = poses.iter().filter(|pose| stands_along(pose, 2)).count();
    if !poses.is_empty() && stands as f64 > STANDS_ALONG_Z * poses.len() as f64 {
        return Err("z is up, expected y: the body stands along z".into());
    }
    Ok(())
}

/// How far some joint gets from its mean place.
fn largest_way_m(poses: &[Pose]) -> f64 {
    let way = |joint: usize| {
        let places = poses.iter().map(|pose| wide(pose[joint]));
        let sum = places.clone().fold([0.0; 3], |a, b| std::array::from_fn(|k| a[k] + b[k]));
        let mean = sum.map(|v| v / poses.len() as f64);
        places.map(|place| norm(sub(place, mean))).fold(0.0, f64::max)
    };
    (0..BodyJoint::ALL.len()).map(way).fold(0.0, f64::max)
}

fn stands_along(pose: &Pose, axis: usize) -> bool {
    let place = |joint: BodyJoint| wide(pose[joint as usize]);
    let (left, right) = (place(BodyJoint::LeftAnkle), place(BodyJoint::RightAnkle));
    let feet = std::array::from_fn(|k| 0.5 * (left[k] + right[k]));
    let upwards = sub(place(BodyJoint::Head), feet);
    upwards[axis] > ALONG * norm(upwards)
}

/// The largest change of a bone's length, as a share of its median: the 95th percentile over
/// frames. Fails where the motion is unsound: no frames, a bone without length, bones that
/// change, left and right exchanged.
pub fn bone_change(poses: &[Pose]) -> Result<f64, String> {
    if poses.is_empty() {
        return Err("there are no frames".into());
    }
    let mut largest = 0.0_f64;
    for joint in BodyJoint::ALL {
        let Some(parent) = joint.parent() else {
            continue;
        };
        let lengths: Vec<f64> = poses.iter().map(|pose| bone_length_m(pose, joint)).collect();
        let usual = percentile(&lengths, 0.5);
        let bone = format!("{}-{}", parent.name(), joint.name());
        if usual < 1e-6 {
            // Collars and spine may lie on their parent; limbs may not.
            match is_limb(joint) {
                true => return Err(format!("the bone {bone} has no length")),
                false => continue,
            }
        }
        let changes: Vec<f64> = lengths.iter().map(|l| (l / usual - 1.0).abs()).collect();
        if let Some(frame) = changes.iter().position(|change| *change > BROKEN)
            && is_limb(joint)
        {
            exchanged(&poses[frame], joint, usual).map_or(Ok(()), |other| {
                Err(format!(
                    "frame {frame}: {} and {} are exchanged ({bone} is {:.2} m, else {usual:.2})",
                    joint.name(),
                    other.name(),
                    lengths[frame]
                ))
            })?;
        }
        let broken = changes.iter().filter(|change| **change > BROKEN).count();
        if broken as f64 > BROKEN_FRAMES * poses.len() as f64 {
            let worst = lengths
                .iter()
                .copied()
                .fold(usual, |a, b| if (b - usual).abs() > (a - usual).abs() { b } else { a });
            return Err(format!("the bone {bone} is {usual:.2} m long, but {worst:.2} in places"));
        }
        largest = largest.max(percentile(&changes, 0.95));
    }
    let backwards = poses.iter().filter(|pose| toes_point_backwards(pose)).count();
    if backwards as f64 > BACKWARDS * poses.len() as f64 {
        return Err("left and right are exchanged: the toes point backwards".into());
    }
    Ok(largest)
}

fn is_limb(joint: BodyJoint) -> bool {
    ["knee", "ankle", "elbow", "wrist"].iter().any(|part| joint.name().ends_with(part))
}

/// The joint of the other side, if it sits where this one should.
fn exchanged(pose: &Pose, joint: BodyJoint, usual: f64) -> Option<BodyJoint> {
    let (other, parent) = (joint.mirrored(), joint.parent()?);
    let mut swapped = *pose;
    swapped[joint as usize] = pose[other as usize];
    let length = norm(sub(wide(swapped[joint as usize]), wide(pose[parent as usize])));
    ((length / usual - 1.0).abs() < MENDED).then_some(other)
}

fn toes_point_backwards(pose: &Pose) -> bool {
    let heading = heading_rad(pose);
    let forward = |ankle: BodyJoint, toe: BodyJoint| {
        turn(sub(wide(pose[toe as usize]), wide(pose[ankle as usize])), -heading)[2]
    };
    forward(BodyJoint::LeftAnkle, BodyJoint::LeftFoot) < -0.02
        && forward(BodyJoint::RightAnkle, BodyJoint::RightFoot) < -0.02
}

fn percentile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choreography::{DanceBeat, DanceStyle, choreograph};

    fn dance() -> Vec<Pose> {
        let beats: Vec<DanceBeat> = (0..10)
            .map(|i| DanceBeat { time_s: 0.5 * f64::from(i), downbeat: i % 4 == 0 })
            .collect();
        choreograph(&beats, 5.0, DanceStyle::Disco, 3).normalised().poses
    }

    fn error(change: impl Fn(&mut Vec<Pose>)) -> String {
        let mut poses = dance();
        change(&mut poses);
        bone_change(&poses).unwrap_err()
    }

    #[test]
    fn a_motion_without_movement_and_one_with_z_up_are_told() {
        let poses = dance();
        assert_eq!(checked_motion(&poses), Ok(()));
        let still = vec![poses[0]; 60];
        assert!(checked_motion(&still).unwrap_err().contains("nothing moves"));
        let z_up = |pose: &Pose| pose.map(|[x, y, z]| [x, -z, y]);
        let turned: Vec<Pose> = poses.iter().map(z_up).collect();
        assert!(checked_motion(&turned).unwrap_err().contains("z is up, expected y"));
    }

    #[test]
    fn a_sound_motion_keeps_its_bones() {
        let change = bone_change(&dance()).unwrap();
        assert!(change < 0.01, "{change}");
    }

    #[test]
    fn exchanged_hands_are_found_in_a_single_frame() {
        let message = error(|poses| poses[40].swap(20, 21));
        assert!(
            message.contains("frame 40: left_wrist and right_wrist are exchanged"),
            "{message}"
        );
    }

    #[test]
    fn a_mirrored_body_walks_backwards() {
        let message = error(|poses| {
            for pose in poses {
                *pose = BodyJoint::ALL.map(|joint| pose[joint.mirrored() as usize]);
            }
        });
        assert!(message.contains("toes point backwards"), "{message}");
    }

    #[test]
    fn growing_and_missing_bones_are_named() {
        let message = error(|poses| {
            for pose in &mut poses[50..] {
                pose[15][1] += 0.2;
            }
        });
        assert!(message.contains("the bone neck-head"), "{message}");
        let message = error(|poses| {
            for pose in poses {
                pose[18] = pose[16];
            }
        });
        assert!(message.contains("left_shoulder-left_elbow has no length"), "{message}");
        assert!(error(Vec::clear).contains("no frames"));
    }
}
