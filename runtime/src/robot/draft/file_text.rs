//! The text of a new robot file: tables with the reasons beside them.

use super::servo_draft::ServoDraft;
use crate::physics::TrialDance;
use servodance_model::motion::Clip;
use servodance_retarget::{BodyLinks, ConfigDraft, Diagnostic, JointUse, Limb, Stance};
use std::fmt::Write;

/// All that goes into a new robot file.
pub(super) struct FilePlan<'a> {
    pub name: String,
    pub source: &'a str,
    pub trial: &'a Clip,
    pub dances: &'a [TrialDance],
    pub urdf: String,
    pub draft: &'a mut ConfigDraft,
    pub servos: Vec<ServoDraft>,
    pub left_out: Vec<String>,
    pub findings: Vec<Diagnostic>,
    pub rates: (u32, f64),
    pub rest: Vec<(String, f64)>,
    pub tried: Vec<String>,
}

pub(super) fn robot_file(plan: &FilePlan) -> String {
    let mut out = String::new();
    head(plan, &mut out);
    retarget(plan, &mut out);
    for servo in &plan.servos {
        joint(servo, &mut out);
    }
    for joint in &plan.left_out {
        let _ = writeln!(out, "\n# No servo for {}", comment(joint));
    }
    out
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

fn remarks(label: &str, lines: &[String], out: &mut String) {
    for line in lines {
        let _ = writeln!(out, "# {label}{}.", comment(line));
    }
}

fn head(plan: &FilePlan, out: &mut String) {
    let (baud, control_hz) = plan.rates;
    let name = quoted(&plan.name);
    let about = quoted(&format!(
        "{}: {} servos, to be filled in",
        comment(&plan.draft.name),
        plan.servos.len()
    ));
    let urdf = quoted(&plan.urdf);
    let _ = write!(
        out,
        "# Drafted by `servodance robot new` from the description alone. TO FILL IN: everything
# about the servos ([bus] and id, model, direction, zero_deg of each [[joint]]).
# Everything else is a guess with its reason; correct what is wrong. Then:
#   servodance robot check FILE.toml
#   servodance dance --robot FILE.toml            (simulated)
name = {name}
description = {about}
urdf = {urdf}
control_hz = {control_hz:.0}
# From motion to position, of the placeholder servos: motion is sent this much ahead.
servo_lag_s = 0.07
# Simulated servos are as strong as the masses ask for; real ones are not moved. Remove
# this when [bus] and every [[joint]] are filled in.
placeholder_servos = true

# TO FILL IN: a placeholder that the simulation understands.
[bus]
kind = \"dynamixel2\"
baud = {baud}
"
    );
}

fn retarget(plan: &FilePlan, out: &mut String) {
    let config = &plan.draft.config;
    let stance = match config.stance {
        Stance::Planted => "planted",
        _ => "hung",
    };
    out.push_str("\n[retarget]\n");
    let kind = comment(&plan.draft.kind_reason);
    let _ = writeln!(out, "# Guessed: {kind}.\nkind = \"{}\"", config.kind.name());
    remarks("Tried: ", &plan.tried, out);
    let _ = writeln!(out, "stance = \"{stance}\"");
    remarks("Seen: ", &plan.draft.reasons, out);
    let _ = writeln!(out, "forward = \"{}\"\nup = \"{}\"", config.forward, config.up);
    if config.body.left_sole.is_some() || config.body.right_sole.is_some() {
        let [length, width] = config.sole_m;
        out.push_str("# Length and width of a sole, from its shape or the legs' length.\n");
        let _ = writeln!(out, "sole_m = [{length:?}, {width:?}]");
        out.push_str("# How far it sinks at rest, of the leg length: room to move up.\n");
        let _ = writeln!(out, "crouch = {:?}", config.crouch);
    }
    if config.stance == Stance::Planted {
        out.push_str(
            "# How far swings of the arms may push the zero-moment point before the arms give\n\
             # way: 1 is the edge of the soles. Found as the gains are.\n",
        );
        let _ = writeln!(out, "arm_zmp_limit = {:?}", config.arm_zmp_limit);
    }
    remarks("Missing: ", &plan.draft.missing, out);
    body(&config.body, out);
    gains(plan, out);
    rest(plan, out);
    jerk(plan, out);
    for tip in &config.tip {
        let (name, link) = (quoted(&tip.name), quoted(&tip.link));
        let _ = write!(
            out,
            "\n# A point that no link's origin is: where the limb ends.\n[[retarget.tip]]\n\
             name = {name}\nlink = {link}\nat_m = {:?}\n",
            tip.at_m
        );
    }
    if !config.wheel.is_empty() {
        out.push_str(
            "\n# The base turns on the spot by these wheels; the radius is from their shapes.\n",
        );
    }
    for wheel in &config.wheel {
        let (link, radius_m) = (quoted(&wheel.link), wheel.radius_m);
        let _ = write!(out, "[[retarget.wheel]]\nlink = {link}\nradius_m = {radius_m:?}\n");
    }
    if !config.capsule.is_empty() {
        out.push_str(
            "\n# Collision capsules, from shapes; from lengths where there are only meshes.\n",
        );
    }
    for capsule in &config.capsule {
        let _ = write!(
            out,
            "[[retarget.capsule]]\nlink = {}\nfrom_m = {:?}\nto_m = {:?}\nradius_m = {:?}\n",
            quoted(&capsule.link),
            capsule.from_m,
            capsule.to_m,
            capsule.radius_m
        );
    }
}

/// Part of the body and the link that it was found in.
fn named(body: &BodyLinks) -> [(&'static str, &Option<String>); 17] {
    [
        ("pelvis", &body.pelvis),
        ("chest", &body.chest),
        ("head", &body.head),
        ("left_shoulder", &body.left_shoulder),
        ("left_elbow", &body.left_elbow),
        ("left_hand", &body.left_hand),
        ("right_shoulder", &body.right_shoulder),
        ("right_elbow", &body.right_elbow),
        ("right_hand", &body.right_hand),
        ("left_hip", &body.left_hip),
        ("left_knee", &body.left_knee),
        ("left_ankle", &body.left_ankle),
        ("left_sole", &body.left_sole),
        ("right_hip", &body.right_hip),
        ("right_knee", &body.right_knee),
        ("right_ankle", &body.right_ankle),
        ("right_sole", &body.right_sole),
    ]
}

/// `part: link`, a line each.
pub(super) fn parts(body: &BodyLinks) -> Vec<String> {
    let found = named(body).into_iter().filter_map(|(part, link)| {
        let link = link.as_ref()?;
        Some(format!("{part}: {link}"))
    });
    found.collect()
}

fn body(body: &BodyLinks, out: &mut String) {
    out.push_str(
        "\n# The link (or tip) whose origin is this point of the body.\n[retarget.body]\n",
    );
    for (part, link) in named(body) {
        if let Some(link) = link {
            let _ = writeln!(out, "{part} = {}", quoted(link));
        }
    }
}

fn gains(plan: &FilePlan, out: &mut String) {
    out.push_str("\n# How much of the movement of each limb is shown, 0 to 2.\n");
    for (limb, scale) in &plan.draft.scales {
        let _ = writeln!(
            out,
            "# {limb}: {scale:.2} times the dancer's length; points are scaled by it."
        );
    }
    if plan.draft.config.stance.stands() {
        out.push_str("# Found by dancing in the simulated world: the most that it can stand.\n");
    }
    let gain = &plan.draft.config.gain;
    let _ = writeln!(
        out,
        "[retarget.gain]\nleft_arm = {:?}\nright_arm = {:?}\nleft_leg = {:?}\nright_leg = {:?}\n\
         head = {:?}\ntorso = {:?}",
        gain.left_arm, gain.right_arm, gain.left_leg, gain.right_leg, gain.head, gain.torso
    );
}

fn rest(plan: &FilePlan, out: &mut String) {
    // Feet that stand decide where the legs are.
    let stands = plan.draft.config.stance == Stance::Planted;
    let legs = [Limb::LeftLeg, Limb::RightLeg].map(JointUse::Dances);
    let is_leg = |name: &String| {
        let mut servos = plan.servos.iter();
        servos.any(|servo| servo.name == *name && legs.contains(&servo.role))
    };
    let rest = plan.rest.iter();
    let mut rest = rest.filter(|(name, _)| !(stands && is_leg(name))).peekable();
    if rest.peek().is_none() {
        return;
    }
    out.push_str(
        "\n# The rest pose: arms down, as the solver finds it; degrees.\n[retarget.rest_deg]\n",
    );
    for (name, degrees) in rest {
        let _ = writeln!(out, "{} = {degrees:?}", quoted(name));
    }
}

fn jerk(plan: &FilePlan, out: &mut String) {
    let servos = plan.servos.iter();
    let given = servos.filter_map(|servo| Some((&servo.name, servo.jerk_deg_s3?)));
    let mut given = given.peekable();
    if given.peek().is_none() {
        return;
    }
    out.push_str("\n# Jerk limits that the description gives; degrees a second cubed.\n[retarget.jerk_deg_s3]\n");
    for (name, jerk_deg_s3) in given {
        let _ = writeln!(out, "{} = {jerk_deg_s3:?}", quoted(name));
    }
}

fn joint(servo: &ServoDraft, out: &mut String) {
    let role = match servo.role {
        JointUse::Dances(limb) => format!("moves the {}", limb_name(limb)),
        JointUse::TurnsBase => "turns the base".into(),
        _ => "nothing to show: held at rest".into(),
    };
    let _ = writeln!(out, "\n# {role}. TO FILL IN: id, model, direction, zero_deg.");
    remarks("", &servo.notes, out);
    let _ = write!(
        out,
        "[[joint]]\nname = {}\nid = {}\nmodel = \"{}\"\ndirection = 1\nzero_deg = {:?}\n\
         lower_deg = {:?}\nupper_deg = {:?}\nvelocity_deg_s = {:?}\nacceleration_deg_s2 = {:?}\n",
        quoted(&servo.name),
        servo.id,
        servo.model,
        servo.zero_deg,
        servo.lower_deg,
        servo.upper_deg,
        servo.velocity_deg_s,
        servo.acceleration_deg_s2
    );
}

fn limb_name(limb: Limb) -> &'static str {
    match limb {
        Limb::LeftArm => "left arm",
        Limb::RightArm => "right arm",
        Limb::LeftLeg => "left leg",
        Limb::RightLeg => "right leg",
        Limb::Head => "head",
        Limb::Torso => "torso",
    }
}
