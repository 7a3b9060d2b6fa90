//! A servo map to fill in: placeholders that the simulation can dance with.

use servodance_retarget::{JointDraft, JointUse};

const MOST_SERVOS: usize = 252;
/// A servo's single turn ends here, degrees.
const TURN_DEG: f64 = 359.9;
/// How far a joint goes that the description does not limit, degrees each way.
const FREE_DEG: f64 = 175.0;
/// Narrower ranges are not worth a servo, degrees.
const LEAST_RANGE_DEG: f64 = 0.5;
/// Higher jerk limits limit nothing, degrees a second cubed.
const MOST_JERK_DEG_S3: f64 = 1e9;
/// Rest lies at least this far inside the range, degrees: rounding.
const ROUND_DEG: f64 = 0.01;

/// A servo that is taken until the user names the real one.
pub(super) struct Placeholder {
    pub model: &'static str,
    /// Its no-load speed leaves room for the load, degrees a second.
    velocity_deg_s: f64,
    /// Stall torque, newton metres.
    torque_nm: f64,
}

/// What carries the robot needs torque: a small and a large one.
const STRONG: [Placeholder; 2] = [
    Placeholder { model: "XM430-W350", velocity_deg_s: 230.0, torque_nm: 4.1 },
    Placeholder { model: "XM540-W270", velocity_deg_s: 150.0, torque_nm: 10.6 },
];
/// Arms and heads need speed.
const FAST: Placeholder =
    Placeholder { model: "XM430-W210", velocity_deg_s: 380.0, torque_nm: 3.0 };

/// One `[[joint]]` table to be.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ServoDraft {
    pub name: String,
    pub id: usize,
    pub role: JointUse,
    pub model: &'static str,
    pub zero_deg: f64,
    pub lower_deg: f64,
    pub upper_deg: f64,
    pub velocity_deg_s: f64,
    pub acceleration_deg_s2: f64,
    /// `None`: the description does not say.
    pub jerk_deg_s3: Option<f64>,
    pub notes: Vec<String>,
}

/// Servos for the joints that dance or are held, and why others have none.
pub(super) fn servo_drafts(joints: &[JointDraft]) -> (Vec<ServoDraft>, Vec<String>) {
    let mut servos: Vec<ServoDraft> = Vec::new();
    let mut left_out = Vec::new();
    // What dances comes first, should the ids run out.
    let mut ordered: Vec<&JointDraft> = joints.iter().collect();
    ordered.sort_by_key(|joint| !matches!(joint.role, JointUse::Dances(_) | JointUse::TurnsBase));
    for joint in ordered {
        let why_not = match joint.role {
            JointUse::Wheel { could_turn_base: true } => {
                Some("a wheel, which rests: --wheels lets it turn the base")
            }
            JointUse::Wheel { .. } => Some("a wheel, which rests"),
            JointUse::Slides => Some("slides: held where it is"),
            _ if servos.len() >= MOST_SERVOS => Some("no bus id is left"),
            _ => None,
        };
        if let Some(why) = why_not {
            left_out.push(format!("{}: {why}", joint.name));
            continue;
        }
        match servo(joint, servos.len() + 1) {
            Some(servo) => servos.push(servo),
            None => left_out.push(format!("{}: its range is too narrow", joint.name)),
        }
    }
    (servos, left_out)
}

fn servo(joint: &JointDraft, id: usize) -> Option<ServoDraft> {
    let mut notes = Vec::new();
    let [small, large] = &STRONG;
    let placeholder = match joint.role {
        JointUse::Dances(limb) if limb.is_arm_or_head() => &FAST,
        _ if joint.effort_nm.is_some_and(|nm| nm > small.torque_nm) => large,
        _ => small,
    };
    if let Some(nm) = joint.effort_nm.filter(|nm| *nm > placeholder.torque_nm) {
        notes.push(format!("the description asks for {nm} N m: more than this servo gives"));
    }
    let (zero_deg, lower_deg, upper_deg) = match joint.range_rad {
        None => {
            notes.push("the description gives no range: fill in".into());
            (180.0, -FREE_DEG, FREE_DEG)
        }
        Some(range) => range_deg(range.map(f64::to_degrees), &mut notes),
    };
    if upper_deg - lower_deg < LEAST_RANGE_DEG {
        return None;
    }
    let given_deg_s = joint.velocity_rad_s.map(f64::to_degrees);
    if given_deg_s.is_none() {
        notes.push("the description gives no usable speed: the servo's is taken".into());
    }
    let velocity_deg_s = given_deg_s.unwrap_or(f64::MAX).min(placeholder.velocity_deg_s);
    let acceleration_deg_s2 = match joint.acceleration_rad_s2 {
        Some(given) => given.to_degrees().min(3000.0),
        None => (velocity_deg_s * 10.0).min(3000.0),
    };
    Some(ServoDraft {
        name: joint.name.clone(),
        id,
        role: joint.role,
        model: placeholder.model,
        zero_deg,
        lower_deg,
        upper_deg,
        velocity_deg_s: tenths(velocity_deg_s).max(0.1),
        acceleration_deg_s2: tenths(acceleration_deg_s2).max(1.0),
        jerk_deg_s3: joint
            .jerk_rad_s3
            .map(|jerk| tenths(jerk.to_degrees().clamp(1.0, MOST_JERK_DEG_S3))),
        notes,
    })
}

/// Where the servo's middle is put and what of the range its turn can hold.
fn range_deg([lower, upper]: [f64; 2], notes: &mut Vec<String>) -> (f64, f64, f64) {
    let fits = |zero: f64| zero + lower >= 0.0 && zero + upper <= TURN_DEG;
    let zero = match fits(180.0) {
        true => 180.0,
        false => (180.0 - f64::midpoint(lower, upper)).clamp(0.0, 360.0).round(),
    };
    let inside = |at: f64| at.clamp(-zero, TURN_DEG - zero);
    if !fits(zero) {
        notes.push(format!(
            "the description allows {lower:.0} to {upper:.0} degrees: cut to one turn of the servo"
        ));
    }
    let hundredths = |at: f64| (at / ROUND_DEG).round() * ROUND_DEG;
    let low = hundredths((inside(lower) / ROUND_DEG - 1e-6).ceil() * ROUND_DEG);
    let high = hundredths((inside(upper) / ROUND_DEG + 1e-6).floor() * ROUND_DEG);
    (zero, low, high)
}

fn tenths(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use servodance_retarget::Limb;

    fn joint(range_rad: Option<[f64; 2]>) -> JointDraft {
        JointDraft {
            name: "turn".into(),
            role: JointUse::Dances(Limb::Head),
            range_rad,
            velocity_rad_s: Some(2.0),
            acceleration_rad_s2: None,
            jerk_rad_s3: None,
            effort_nm: None,
        }
    }

    #[test]
    fn any_range_fits_the_servo_s_single_turn() {
        for range in [[-1.0, 1.0], [-0.2, 5.9], [-9.0, 9.0], [3.2, 6.0], [-6.1, -3.3], [0.0, 7.0]] {
            let servo = servo(&joint(Some(range)), 1).unwrap();
            let ends = [servo.lower_deg, servo.upper_deg].map(|end| end + servo.zero_deg);
            assert!(ends[0] >= -1e-9 && ends[1] <= TURN_DEG + 1e-9, "{range:?}: {ends:?}");
            assert!(servo.lower_deg >= range[0].to_degrees() - 1e-9);
            assert!(servo.upper_deg <= range[1].to_degrees() + 1e-9);
        }
    }

    #[test]
    fn joints_that_cannot_have_a_servo_are_left_out_by_name() {
        let mut wheel = joint(None);
        wheel.role = JointUse::Wheel { could_turn_base: false };
        let (servos, left_out) = servo_drafts(&[wheel, joint(Some([0.1, 0.1001])), joint(None)]);
        assert_eq!((servos.len(), left_out.len()), (1, 2));
        assert!(left_out.iter().any(|line| line == "turn: a wheel, which rests"));
    }
}
