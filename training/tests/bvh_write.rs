//! A BVH file holds the joints where the dance had them, read by a reader that
//! shares no code with the writer.

use servodance_model::motion::bvh_write::bvh;
use servodance_model::motion::rotation::{IDENTITY, Matrix, apply, multiply};
use servodance_model::motion::vec3::{Vec3, add, norm, sub, wide};
use servodance_training::choreography::{DanceBeat, DanceStyle, choreograph};
use servodance_types::BodyJoint;

fn about(axis: usize, deg: f64) -> Matrix {
    let (sin, cos) = deg.to_radians().sin_cos();
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut m = IDENTITY;
    (m[a][a], m[a][b], m[b][a], m[b][b]) = (cos, -sin, sin, cos);
    m
}

/// Reads the file as any BVH reader would: positions of all joints.
fn positions(text: &str, frame: usize) -> Vec<(String, Vec3)> {
    let (hierarchy, motion) = text.split_once("MOTION\n").unwrap();
    let numbers: Vec<f64> =
        motion.lines().nth(2 + frame).unwrap().split(' ').map(|n| n.parse().unwrap()).collect();
    let mut channels = numbers.iter().copied();
    let mut stack: Vec<(Matrix, Vec3)> = Vec::new();
    let (mut found, mut name, mut here) = (Vec::new(), None, ([0.0; 3], IDENTITY));
    for line in hierarchy.lines().map(str::trim) {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[0] {
            "ROOT" | "JOINT" => name = Some(words[1].to_owned()),
            "End" => name = None,
            "OFFSET" => {
                let offset: Vec<f64> = words[1..].iter().map(|w| w.parse().unwrap()).collect();
                let (turn, place) = stack.last().copied().unwrap_or((IDENTITY, [0.0; 3]));
                let offset = [offset[0], offset[1], offset[2]];
                here = (add(place, apply(&turn, offset)), turn);
                if name.is_none() {
                    stack.push((IDENTITY, [0.0; 3]));
                }
            }
            "CHANNELS" => {
                if words[1] == "6" {
                    here.0 = std::array::from_fn(|_| channels.next().unwrap());
                }
                let mut turn = here.1;
                for axis in [2, 0, 1] {
                    turn = multiply(&turn, &about(axis, channels.next().unwrap()));
                }
                stack.push((turn, here.0));
                found.push((name.clone().unwrap(), here.0));
            }
            "}" => drop(stack.pop()),
            _ => {}
        }
    }
    assert_eq!(channels.next(), None);
    found
}

#[test]
fn joints_come_back_where_they_were() {
    let beats: Vec<DanceBeat> =
        (0..20).map(|i| DanceBeat { time_s: 0.5 * f64::from(i), downbeat: i % 4 == 0 }).collect();
    let clip = choreograph(&beats, 10.0, DanceStyle::Disco, 3).normalised();
    let text = bvh(&clip);
    let mut worst: f64 = 0.0;
    for frame in (0..clip.poses.len()).step_by(10) {
        for (name, place) in positions(&text, frame) {
            let joint = BodyJoint::from_name(&name).unwrap();
            let true_place = wide(clip.poses[frame][joint as usize]);
            worst = worst.max(norm(sub(place, true_place)));
        }
    }
    assert!(worst < 0.06, "{worst} m");
}
