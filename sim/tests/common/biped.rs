//! A small robot of two legs, of the size of OP3's, for tests of the world.

use servodance_types::{LinkDrive, LinkMotion, Placement, RigidLink, TouchPoint};

/// Joints of one leg, hip to ankle: hip roll, hip pitch, knee, ankle pitch, ankle roll.
pub const LEG: usize = 5;
pub const KNEES: [usize; 2] = [2, 7];
/// Legs bent a little, soles flat below the hips.
pub const BENT: [f64; 2 * LEG] = [0.0, -0.3, 0.6, -0.3, 0.0, 0.0, -0.3, 0.6, -0.3, 0.0];

fn link(name: &str, parent: Option<usize>, at_m: [f64; 3]) -> RigidLink {
    RigidLink {
        name: name.into(),
        parent,
        origin: Placement { rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], at_m },
        motion: LinkMotion::Fixed,
        drive: None,
        mass_kg: 0.0,
        com_m: [0.0; 3],
        inertia_kg_m2: [[0.0; 3]; 3],
        touch: Vec::new(),
    }
}

fn heavy(link: RigidLink, mass_kg: f64, com_z_m: f64, inertia_kg_m2: f64) -> RigidLink {
    let mut rows = [[0.0; 3]; 3];
    for (axis, row) in rows.iter_mut().enumerate() {
        row[axis] = inertia_kg_m2;
    }
    RigidLink { mass_kg, com_m: [0.0, 0.0, com_z_m], inertia_kg_m2: rows, ..link }
}

fn turning(link: RigidLink, joint: usize, axis: [f64; 3]) -> RigidLink {
    let drive = Some(LinkDrive { joint, scale: 1.0, offset: 0.0 });
    RigidLink { motion: LinkMotion::Revolute(axis), drive, ..link }
}

/// The links; joints 0 to 4 are those of the left leg, 5 to 9 of the right.
pub fn biped() -> Vec<RigidLink> {
    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Y: [f64; 3] = [0.0, 1.0, 0.0];
    let mut pelvis = heavy(link("pelvis", None, [0.0; 3]), 1.5, 0.08, 5e-3);
    for [x, y, z] in [[0.08, 0.0, 0.1], [-0.08, 0.0, 0.1], [0.0, 0.1, 0.1], [0.0, -0.1, 0.1]] {
        pelvis.touch.push(TouchPoint { at_m: [x, y, z], radius_m: 0.02, foot: None });
    }
    let mut links = vec![pelvis];
    for side in 0..2 {
        let (first, joint) = (links.len(), LEG * side);
        let y = if side == 0 { 0.045 } else { -0.045 };
        let below = |index: usize| Some(first + index);
        let hip = heavy(link("hip", Some(0), [0.0, y, 0.0]), 0.05, 0.0, 2e-5);
        let thigh = heavy(link("thigh", below(0), [0.0; 3]), 0.25, -0.055, 3e-4);
        let shank = heavy(link("shank", below(1), [0.0, 0.0, -0.11]), 0.2, -0.055, 3e-4);
        let ankle = heavy(link("ankle", below(2), [0.0, 0.0, -0.11]), 0.05, 0.0, 2e-5);
        let mut foot = heavy(link("foot", below(3), [0.0; 3]), 0.15, -0.02, 1e-4);
        for [x, y] in [[0.0635, 0.039], [0.0635, -0.039], [-0.0635, 0.039], [-0.0635, -0.039]] {
            let at_m = [x, y, -0.03];
            foot.touch.push(TouchPoint { at_m, radius_m: 0.0, foot: Some(side) });
        }
        let axes = [X, Y, Y, Y, X];
        let leg = [hip, thigh, shank, ankle, foot].into_iter().zip(axes).enumerate();
        links.extend(leg.map(|(place, (link, axis))| turning(link, joint + place, axis)));
    }
    links
}
