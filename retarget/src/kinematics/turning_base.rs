//! A base on wheels that turns on the spot: how far each wheel rolls for it.
//!
//! A wheel of radius `r` with the level axle `a`, up being `u`, rolls towards `d = a x u`. When
//! the base turns by `t` about the vertical through `c`, the wheel's middle `p` goes
//! `t u x (p - c)`, and the wheel turns by `t (u x (p - c)) . d / r`. The middle `c` is where
//! the wheels' axles meet, as nearly as they do: there nothing slides sideways. Radians and
//! metres, in the frame of the root link.

use crate::config::{RetargetError, WheelConfig};
use crate::kinematics::{JointMotion, RobotModel};
use k::nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use servodance_types::JointLimits;

/// Steepest axle that still counts as level: sine of its angle.
const LEVEL: f64 = 0.3;
/// What keeps the middle near the wheels where their axles are one line.
const NEAR: f64 = 1e-6;
/// A wheel that turns less than this with its base, radians a radian, does not turn the base.
const LEAST: f64 = 1e-3;

/// A wheel: its joint, and how far that turns for a radian of the base.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurningWheel {
    pub joint: usize,
    pub per_rad: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct TurningBase {
    pub wheels: Vec<TurningWheel>,
    middle: Point3<f64>,
    /// The root link in the world before the base turns.
    home: Isometry3<f64>,
}

/// Where a wheel meets its axle, where it rolls to, and how its joint turns it.
struct Rolling {
    joint: usize,
    at: Point3<f64>,
    ahead: Vector3<f64>,
    radius_m: f64,
}

impl TurningWheel {
    /// Where its joint rests that is at `present_rad`: there, or nearer to the middle of its
    /// `limits`, so that it can turn the base by `most_rad` to both sides.
    pub fn rest_rad(&self, present_rad: f64, limits: &JointLimits, most_rad: f64) -> f64 {
        let (lower, upper) = (limits.lower_rad, limits.upper_rad);
        let room = (self.per_rad.abs() * most_rad).min(0.5 * (upper - lower));
        present_rad.max(lower + room).min(upper - room)
    }
}

impl TurningBase {
    /// `None` without wheels. `home` is the root link in the world before the base turns.
    /// Fails, by link, where one is not a wheel of the base, or where they do not turn it.
    pub fn new(
        model: &RobotModel,
        wheels: &[WheelConfig],
        home: Isometry3<f64>,
    ) -> Result<Option<Self>, RetargetError> {
        let Some(first) = wheels.first() else { return Ok(None) };
        let up = home.rotation.inverse() * Vector3::z();
        let rolling: Result<Vec<Rolling>, _> =
            wheels.iter().map(|wheel| rolling(model, wheel, &up)).collect();
        let rolling = rolling?;
        let middle = middle(&rolling);
        let wheels: Vec<TurningWheel> = rolling
            .iter()
            .map(|wheel| TurningWheel {
                joint: wheel.joint,
                per_rad: up.cross(&(wheel.at - middle)).dot(&wheel.ahead) / wheel.radius_m,
            })
            .collect();
        if wheels.len() < 2 || wheels.iter().any(|wheel| wheel.per_rad.abs() < LEAST) {
            return Err(refused(
                &first.link,
                "a base turns on two wheels or more, at some distance from where their axles meet",
            ));
        }
        Ok(Some(Self { wheels, middle, home }))
    }

    /// The nearest to `turn_rad` that every wheel can do inside `bounds`, from `rest`.
    pub fn within(&self, turn_rad: f64, rest: &[f64], bounds: &[(f64, f64)]) -> f64 {
        let ends = self.wheels.iter().map(|wheel| {
            let (low, high) = bounds[wheel.joint];
            let turn = |at: f64| (at - rest[wheel.joint]) / wheel.per_rad;
            (turn(low).min(turn(high)), turn(low).max(turn(high)))
        });
        let (low, high) = ends.fold((f64::NEG_INFINITY, f64::INFINITY), |(low, high), end| {
            (low.max(end.0), high.min(end.1))
        });
        turn_rad.max(low).min(high.max(low))
    }

    /// How far the base has turned from where it was with the joints at `rest`: the best fit.
    pub fn turn_rad(&self, positions: &[f64], rest: &[f64]) -> f64 {
        let wheels = self.wheels.iter();
        let (seen, all) = wheels.fold((0.0, 0.0), |(seen, all), wheel| {
            let turned = positions[wheel.joint] - rest[wheel.joint];
            (seen + wheel.per_rad * turned, all + wheel.per_rad * wheel.per_rad)
        });
        seen / all
    }

    /// The root link in the world when the base has turned.
    pub fn turned(&self, turn_rad: f64) -> Isometry3<f64> {
        let middle = Translation3::from((self.home * self.middle).coords);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_rad);
        middle * turn * middle.inverse() * self.home
    }
}

fn refused(link: &str, reason: &str) -> RetargetError {
    RetargetError::Link { link: link.to_owned(), reason: reason.to_owned() }
}

fn rolling(
    model: &RobotModel,
    wheel: &WheelConfig,
    up: &Vector3<f64>,
) -> Result<Rolling, RetargetError> {
    let link = model.named(&wheel.link, "wheel.link")?;
    let (Some(drive), JointMotion::Revolute(axis)) =
        (model.links[link].drive, model.links[link].motion)
    else {
        return Err(refused(&wheel.link, "a wheel is turned by a servo"));
    };
    if model.drives_above(link) > 1 {
        return Err(refused(&wheel.link, "a wheel that turns the base is on the base itself"));
    }
    let pose = model.link_poses(&[])[link];
    let axle = pose.rotation * axis.into_inner() * drive.scale;
    if axle.dot(up).abs() > LEVEL {
        return Err(refused(&wheel.link, "a wheel's axle is level"));
    }
    let ahead = axle.cross(up).normalize();
    let at = Point3::from(pose.translation.vector);
    Ok(Rolling { joint: drive.joint, at, ahead, radius_m: wheel.radius_m })
}

/// The point nearest to all axles; of a line of them the one nearest to the wheels' mean.
fn middle(wheels: &[Rolling]) -> Point3<f64> {
    let mean = wheels.iter().map(|w| w.at.coords).sum::<Vector3<f64>>() / wheels.len() as f64;
    let (mut squares, mut sides) = (Matrix3::identity() * NEAR, Vector3::zeros());
    for wheel in wheels {
        squares += wheel.ahead * wheel.ahead.transpose();
        sides += wheel.ahead * wheel.ahead.dot(&(wheel.at.coords - mean));
    }
    let away = squares.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * sides);
    Point3::from(mean + away)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write;

    /// Wheels of 0.1 m at these places, their axles pointing there.
    fn cart(wheels: &[([f64; 2], [f64; 2])]) -> Result<TurningBase, RetargetError> {
        let mut urdf = String::from("<robot name=\"cart\"><link name=\"base\"/>");
        let mut all = Vec::new();
        let names: Vec<String> = (0..wheels.len()).map(|i| format!("wheel{i}")).collect();
        for (name, ([x, y], [along, across])) in names.iter().zip(wheels) {
            let _ = write!(
                urdf,
                "<link name=\"{name}\"/><joint name=\"{name}\" type=\"continuous\">\
                 <parent link=\"base\"/><child link=\"{name}\"/><origin xyz=\"{x} {y} 0.1\"/>\
                 <axis xyz=\"{along} {across} 0\"/></joint>"
            );
            all.push(WheelConfig { link: name.clone(), radius_m: 0.1 });
        }
        urdf.push_str("</robot>");
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let model = RobotModel::new(&urdf, &names)?;
        Ok(TurningBase::new(&model, &all, Isometry3::identity())?.expect("wheels"))
    }

    fn per_rad(base: &TurningBase) -> Vec<f64> {
        base.wheels.iter().map(|wheel| (wheel.per_rad * 1e3).round() / 1e3).collect()
    }

    #[test]
    fn the_right_wheel_rolls_ahead_when_the_base_turns_to_the_left() {
        let base = cart(&[([0.05, 0.2], [0.0, 1.0]), ([0.05, -0.2], [0.0, 1.0])]).unwrap();
        assert_eq!(per_rad(&base), [-2.0, 2.0]);
        // It turns about the middle of its axle, not about the root.
        let turned = base.turned(std::f64::consts::FRAC_PI_2);
        let origin = turned.translation.vector;
        assert!((origin - Vector3::new(0.05, -0.05, 0.0)).norm() < 1e-5, "{origin}");
        // A wheel that is mounted the other way round counts the other way round.
        let flipped = cart(&[([0.0, 0.2], [0.0, 1.0]), ([0.0, -0.2], [0.0, -1.0])]).unwrap();
        assert_eq!(per_rad(&flipped), [-2.0, -2.0]);
    }

    #[test]
    fn three_wheels_turn_about_where_their_axles_meet() {
        let wheels = [0.0_f64, 120.0, 240.0].map(|degrees| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            ([0.3 + 0.2 * cos, 0.2 * sin], [cos, sin])
        });
        let base = cart(&wheels).unwrap();
        assert_eq!(per_rad(&base), [-2.0; 3]);
        assert!((base.middle.x - 0.3).abs() < 1e-4, "{}", base.middle);
    }

    #[test]
    fn a_turn_is_found_again_and_kept_inside_the_wheels_limits() {
        let base = cart(&[([0.0, 0.2], [0.0, 1.0]), ([0.0, -0.2], [0.0, 1.0])]).unwrap();
        let rest = [0.4, -0.3];
        let positions = [0.4 - 2.0 * 0.25, -0.3 + 2.0 * 0.25];
        assert!((base.turn_rad(&positions, &rest) - 0.25).abs() < 1e-12);
        let turn = base.within(1.0, &rest, &[(-0.6, 3.0), (-3.0, 3.0)]);
        assert!((turn - 0.5).abs() < 1e-12, "{turn}");
    }

    #[test]
    fn what_does_not_turn_a_base_is_refused_by_name() {
        let one = cart(&[([0.0, 0.2], [0.0, 1.0])]).unwrap_err().to_string();
        assert!(one.contains("wheel0"), "{one}");
        // In line, one behind the other: a bicycle.
        let bicycle = cart(&[([0.2, 0.0], [0.0, 1.0]), ([-0.2, 0.0], [0.0, 1.0])]);
        assert!(bicycle.is_err());
    }
}
