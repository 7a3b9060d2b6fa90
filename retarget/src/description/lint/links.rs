//! Masses and moments of single links.

use std::f64::consts::PI;

use crate::description::diagnostic::{DiagnosticCode, Diagnostics};

/// A link heavier than this share of the robot, when there are many.
const HEAVY_SHARE: f64 = 0.8;
/// Heavier than lead, kg/m^3.
const DENSEST: f64 = 12_000.0;

pub(super) fn lint_masses(robot: &urdf_rs::Robot, diagnostics: &mut Diagnostics) {
    let total: f64 = robot.links.iter().map(|l| l.inertial.mass.value).sum();
    if total <= 0.0 {
        let message = "no link weighs anything: balance cannot be kept";
        diagnostics.add(DiagnosticCode::MassMissing, &robot.name, message);
        return;
    }
    for link in &robot.links {
        let mass = link.inertial.mass.value;
        let shapes = link.collision.iter().map(|collision| &collision.geometry);
        let visuals = link.visual.iter().map(|visual| &visual.geometry);
        let volume: f64 = shapes.chain(visuals).map(volume_m3).fold(0.0, f64::max);
        let density = mass / volume;
        if robot.links.len() > 4 && mass > HEAVY_SHARE * total {
            let message = format!("{mass} kg of {total:.1} kg in all");
            diagnostics.add(DiagnosticCode::MassAbsurd, &link.name, message);
        } else if volume > 0.0 && mass > 0.01 && density > DENSEST {
            let message = format!("{mass} kg in {:.1} cm3: heavier than lead", volume * 1e6);
            diagnostics.add(DiagnosticCode::MassAbsurd, &link.name, message);
        }
        lint_inertia(link, diagnostics);
    }
}

/// Volume of a simple shape; 0 for meshes and shapes without size.
fn volume_m3(geometry: &urdf_rs::Geometry) -> f64 {
    use urdf_rs::Geometry::*;
    let volume = match geometry {
        Box { size } => size.iter().product(),
        Cylinder { radius, length } | Capsule { radius, length } => PI * radius * radius * length,
        Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        Mesh { .. } => 0.0,
    };
    if volume.is_finite() { volume } else { 0.0 }
}

/// No two moments of a body are less than the third together.
fn lint_inertia(link: &urdf_rs::Link, diagnostics: &mut Diagnostics) {
    let inertia = &link.inertial.inertia;
    let moments = [inertia.ixx, inertia.iyy, inertia.izz];
    let sum: f64 = moments.iter().sum();
    let bad = moments
        .iter()
        .any(|&moment| !moment.is_finite() || moment < 0.0 || 2.0 * moment > sum * 1.02 + 1e-9);
    if bad {
        let message =
            format!("moments {} {} {} belong to no body", moments[0], moments[1], moments[2]);
        diagnostics.add(DiagnosticCode::InertiaAbsurd, &link.name, message);
    }
}
