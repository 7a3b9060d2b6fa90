//! Moments of inertia that no part of the robot can have, put right.
//!
//! Some descriptions have large moments on purpose, so that a physics engine stays calm
//! with them: a foot of 80 g that is as hard to turn as a beam of 4 m.

use std::collections::HashMap;
use std::f64::consts::PI;

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};

/// Radii of gyration beyond this many times a link's reach are refused: mass seldom lies
/// beyond a link's joints at all.
const MOST_REACHES: f64 = 4.0;
/// Of a link whose joints, shapes and mass all lie at its origin the size is not known: it may
/// be as large as the largest.
const LEAST_M: f64 = 1e-3;
/// A ball so light (kg/m^3) is as large as a link of that mass gets.
const LIGHTEST: f64 = 500.0;
/// Radius of gyration of a rod against its length from the middle to an end, and of a ball
/// against its radius.
const OF_A_ROD: f64 = 0.58;
const OF_A_BALL: f64 = 0.63;

/// Gives links whose moments are far too large those of a rod or ball of their mass. One
/// finding tells of all of them, by the one that is farthest off.
pub(super) fn repair_inertias(robot: &mut urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    let reaches = reaches_m(robot);
    let largest_m = reaches.values().copied().fold(0.0, f64::max);
    let mut worst: Option<(f64, String, String)> = None;
    let mut repaired = 0;
    for link in &mut robot.links {
        let mass_kg = link.inertial.mass.value;
        let inertia = &mut link.inertial.inertia;
        let largest = [inertia.ixx, inertia.iyy, inertia.izz].into_iter().fold(0.0, f64::max);
        let radius_m = (largest / mass_kg).sqrt();
        let reach_m = reaches.get(&link.name).copied().unwrap_or(0.0);
        let most_m = if reach_m > LEAST_M { reach_m } else { largest_m };
        if most_m <= LEAST_M {
            continue;
        }
        let ball_m = (mass_kg / (4.0 / 3.0 * PI * LIGHTEST)).cbrt();
        if !radius_m.is_finite() || radius_m <= MOST_REACHES * most_m.max(ball_m) {
            continue;
        }
        let usual_m = (OF_A_ROD * 0.5 * reach_m).max(OF_A_BALL * ball_m);
        let moment = mass_kg * usual_m * usual_m;
        *inertia = urdf_rs::Inertia { ixx: moment, iyy: moment, izz: moment, ..Default::default() };
        repaired += 1;
        if worst.as_ref().is_none_or(|(most, ..)| largest > *most) {
            let [grams, radius_mm, usual_mm] = [mass_kg, radius_m, usual_m].map(|it| it * 1e3);
            let message = format!(
                "{grams:.3} g with a radius of gyration of {radius_mm:.0} mm: {usual_mm:.1} mm \
                 are used"
            );
            worst = Some((largest, link.name.clone(), message));
        }
    }
    if let Some((_, link, mut message)) = worst {
        if repaired > 1 {
            message += &format!("; so with {} more links", repaired - 1);
        }
        diagnostics.add(DiagnosticCode::InertiaOversized, &link, message);
    }
}

/// How far each link reaches from its origin, by its joints, shapes and mass, metres.
fn reaches_m(robot: &urdf_rs::Robot) -> HashMap<String, f64> {
    let norm = |at: &[f64; 3]| at.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut reaches: HashMap<String, f64> = HashMap::new();
    let mut reach = |link: &str, far_m: f64| {
        let known = reaches.entry(link.to_owned()).or_default();
        *known = known.max(far_m);
    };
    for joint in &robot.joints {
        reach(&joint.parent.link, norm(&joint.origin.xyz));
    }
    for link in &robot.links {
        reach(&link.name, norm(&link.inertial.origin.xyz));
        let shapes = link.collision.iter().map(|shape| (&shape.origin, &shape.geometry));
        let visuals = link.visual.iter().map(|shape| (&shape.origin, &shape.geometry));
        for (origin, geometry) in shapes.chain(visuals) {
            reach(&link.name, norm(&origin.xyz) + half_length_m(geometry));
        }
    }
    reaches
}

/// From the middle of a shape to its farthest point, metres; 0 for a mesh.
fn half_length_m(geometry: &urdf_rs::Geometry) -> f64 {
    use urdf_rs::Geometry::*;
    match geometry {
        Box { size } => 0.5 * size.iter().map(|v| v * v).sum::<f64>().sqrt(),
        Cylinder { radius, length } | Capsule { radius, length } => radius.hypot(0.5 * length),
        Sphere { radius } => *radius,
        Mesh { .. } => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn repaired(moment: f64, middle: &str) -> (f64, usize) {
        let xml = format!(
            r#"<robot name="r"><link name="foot"><inertial><origin xyz="{middle}"/><mass
            value="0.08"/><inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0"
            izz="{moment}"/></inertial></link><link name="shank"/><joint name="ankle"
            type="fixed"><parent link="shank"/><child link="foot"/><origin xyz="0 0 -0.1"/>
            </joint></robot>"#
        );
        let mut robot = urdf_rs::read_from_string(&xml).unwrap();
        let mut diagnostics = Diagnostics::default();
        repair_inertias(&mut robot, &mut diagnostics);
        (robot.links[0].inertial.inertia.ixx, diagnostics.list.len())
    }

    #[test]
    fn a_foot_as_hard_to_turn_as_a_beam_becomes_a_foot() {
        for middle in ["0.03 0 0", "0 0 0"] {
            assert_eq!(repaired(1e-4, middle), (1e-4, 0));
            let (moment, said) = repaired(0.12, middle);
            assert!((1e-5..1e-4).contains(&moment) && said == 1, "{moment}");
            assert_eq!(repaired(f64::NAN, middle).1, 0);
        }
    }
}
