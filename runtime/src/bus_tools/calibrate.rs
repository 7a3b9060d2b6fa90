//! Zeros and directions of a robot file, measured on the robot.
//!
//! Torque goes off, people put the robot into its zero pose, and where each
//! servo then stands is where its joint reads zero. With directions asked for,
//! people then move joints towards their positive end, and a servo that counted
//! down gets the other direction. The rest of the file, comments included,
//! stays as it is.
//!
//! Servos get the modes that arming gives them (drive mode, one turn) before anything is
//! read, and an offset in a servo's own memory goes into the file: with another one the
//! robot gets no torque.
//!
//! Refused: a pose from which a joint could not reach its limits within the
//! servo's turn; the servo's horn must be mounted otherwise.

use super::consent::{Consent, pause};
use super::plug;
use crate::robot::Robot;
use crate::telemetry::pending_file::write_whole;
use anyhow::{Context, bail};
use servodance_drivers::{Bus, Port, Servo, open_buses};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use toml_edit::{DocumentMut, Table, Value};

/// A joint moved by less than this keeps its direction, radians.
const CLEAR_MOVE_RAD: f64 = 0.1;

/// Options of `servodance calibrate`.
#[derive(Debug)]
pub struct Calibration<'a> {
    /// The robot file, or a built-in robot.
    pub robot: &'a str,
    /// The port of each bus of the robot.
    pub ports: &'a [String],
    /// Where the calibrated file goes; over the robot file if left out.
    pub output: Option<&'a Path>,
    /// Whether directions are found too.
    pub directions: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct JointSettings {
    joint: String,
    zero_deg: f64,
    direction: i8,
    /// What the servo adds to its angle, ticks; `None` where it has no such setting.
    homing_offset: Option<i32>,
}

impl Calibration<'_> {
    /// Asks, reads, shows, asks, writes. `show` gets the table, line by line.
    /// Returns where the file went.
    pub fn run(&self, consent: Consent, show: impl Fn(&str)) -> anyhow::Result<PathBuf> {
        let robot = Robot::load(self.robot)?;
        let (source, target) = self.files()?;
        let text = std::fs::read_to_string(&source)
            .with_context(|| format!("cannot read robot file {}", source.display()))?;
        let ports = plug::ports(&robot, self.ports)?;
        consent.obtain(&format!(
            "Torque goes off on all {} servos of {} on {}: hold the robot.",
            robot.servos.len(),
            robot.name,
            self.ports.join(" ")
        ))?;
        let mut bus = open_buses(&ports, &robot.buses, &robot.servos)?;
        bus.disarm()?;
        // Zeros hold for the modes that arming gives: those first, or a servo in reverse or
        // over several turns would count otherwise later on.
        bus.set_up()?.iter().for_each(|note| show(note));
        let found = self.measure(&mut *bus, &robot)?;
        table(&robot.servos, &found).iter().for_each(|line| show(line));
        let edited = edit(&text, &found)?;
        let calibrated = Robot::from_text(&edited, &target).context(
            "with these zeros a joint could not reach its limits: mount its servo's horn otherwise",
        )?;
        drop(bus);
        check(&calibrated, &ports, self.directions, &show)?;
        consent.obtain(&format!("These go into {}.", target.display()))?;
        write_whole(&target, edited.as_bytes())?;
        Ok(target)
    }

    /// The file that is read and the one that is written.
    fn files(&self) -> anyhow::Result<(PathBuf, PathBuf)> {
        let source = match servodance_robots::built_in(self.robot) {
            None => PathBuf::from(self.robot),
            Some(built_in) => bail!(
                "{name} is built in and cannot be changed: calibrate a copy (`servodance robots {name} --out my-robot.toml`)",
                name = built_in.name
            ),
        };
        let target = self.output.map_or(source.clone(), Path::to_owned);
        Ok((source, target))
    }

    fn measure(&self, bus: &mut dyn Bus, robot: &Robot) -> anyhow::Result<Vec<JointSettings>> {
        let leaves_out_zero = |servo: &&Servo| servo.limits.clamp_rad(0.0) != 0.0;
        let exceptions: Vec<String> =
            robot.servos.iter().filter(leaves_out_zero).map(rest).collect();
        pause(&match exceptions.is_empty() {
            true => "Move the robot into its zero pose (every joint at zero)".into(),
            false => format!(
                "Move the robot into its zero pose (every joint at zero, but {})",
                exceptions.join(", ")
            ),
        })?;
        let rest = bus.observe()?;
        let mut positive = rest.clone();
        if self.directions {
            pause(
                "Move each joint 10 degrees or more towards its positive end; joints left alone keep their direction",
            )?;
            positive = bus.observe()?;
        }
        let readings = rest.iter().zip(&positive);
        let servos = robot.servos.iter().zip(readings).enumerate();
        let found = servos.map(|(index, (servo, (rest, positive)))| {
            let homing_offset = bus.homing_offset(index)?;
            let found = found(servo, rest.position_rad, positive.position_rad);
            Ok(JointSettings { homing_offset, ..found })
        });
        found.collect()
    }
}

/// Where a joint rests whose range leaves out zero.
fn rest(servo: &Servo) -> String {
    let rest_deg = servo.limits.clamp_rad(0.0).to_degrees();
    format!("{} at {rest_deg:.1} degrees", servo.name)
}

/// The settings with which the joint reads its rest position at `rest_rad`,
/// given what it reads with the old ones.
fn found(servo: &Servo, rest_rad: f64, positive_rad: f64) -> JointSettings {
    let moved_rad = positive_rad - rest_rad;
    let direction = if moved_rad <= -CLEAR_MOVE_RAD { -servo.direction } else { servo.direction };
    let servo_rad = servo.zero_rad + servo.direction * rest_rad;
    let zero_rad = servo_rad - direction * servo.limits.clamp_rad(0.0);
    // Serial servos count within a turn, CAN motors do not.
    let zero_rad = match servo.motor {
        None => zero_rad.rem_euclid(TAU),
        Some(_) => zero_rad,
    };
    JointSettings {
        joint: servo.name.clone(),
        // A thousandth of a degree is a hundredth of an encoder tick.
        zero_deg: (zero_rad.to_degrees() * 1e3).round() / 1e3,
        direction: direction as i8,
        homing_offset: None,
    }
}

fn table(servos: &[Servo], found: &[JointSettings]) -> Vec<String> {
    let mut lines = vec![format!(
        "{:<14} {:>3}  {:>9} -> {:>9}  {:>9}",
        "joint", "id", "zero_deg", "zero_deg", "direction"
    )];
    lines.extend(servos.iter().zip(found).map(|(servo, found)| {
        let turned = f64::from(found.direction) != servo.direction;
        format!(
            "{:<14} {:>3}  {:>9.3} -> {:>9.3}  {:>9}{}",
            servo.name,
            servo.id,
            servo.zero_rad.to_degrees(),
            found.zero_deg,
            found.direction,
            if turned { "  (turned round)" } else { "" }
        )
    }));
    lines
}

/// The file with new zeros and directions, and nothing else changed.
fn edit(text: &str, found: &[JointSettings]) -> anyhow::Result<String> {
    let mut document: DocumentMut = text.parse().context("the robot file is no TOML")?;
    let joints = document
        .get_mut("joint")
        .and_then(|joints| joints.as_array_of_tables_mut())
        .context("the robot file has no [[joint]] tables")?;
    for found in found {
        let named = |table: &&mut Table| {
            table.get("name").and_then(|name| name.as_str()) == Some(&found.joint)
        };
        let table = joints
            .iter_mut()
            .find(named)
            .with_context(|| format!("the robot file has no [[joint]] \"{}\"", found.joint))?;
        set_value(table, "zero_deg", Value::from(found.zero_deg));
        set_value(table, "direction", Value::from(i64::from(found.direction)));
        if let Some(ticks) = found.homing_offset
            && (ticks != 0 || table.contains_key("homing_offset"))
        {
            set_value(table, "homing_offset", Value::from(i64::from(ticks)));
        }
    }
    Ok(document.to_string())
}

/// Replaces a value; blanks and comments around it stay, and so does one that
/// says the same already.
fn set_value(table: &mut Table, key: &str, mut value: Value) {
    if let Some(old) = table.get(key).and_then(|item| item.as_value()) {
        let number = |value: &Value| value.as_float().or(value.as_integer().map(|i| i as f64));
        if number(old) == number(&value) {
            return;
        }
        *value.decor_mut() = old.decor().clone();
    }
    table.insert(key, toml_edit::Item::Value(value));
}

/// Reads the robot through its new settings. After directions were found, its
/// joints stand where they were moved to.
fn check(robot: &Robot, ports: &[Port], moved: bool, show: &impl Fn(&str)) -> anyhow::Result<()> {
    let mut bus = open_buses(ports, &robot.buses, &robot.servos)?;
    let states = bus.observe()?;
    let worst = robot.servos.iter().zip(&states).map(|(servo, state)| {
        let off_rad = state.position_rad - servo.limits.clamp_rad(0.0);
        (off_rad.abs(), &servo.name)
    });
    if let (false, Some((off_rad, joint))) = (moved, worst.max_by(|a, b| a.0.total_cmp(&b.0))) {
        show(&format!(
            "read again with these: {joint} is furthest from zero, {:.2} degrees",
            off_rad.to_degrees()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_two_keys_change() {
        let text = "\
# My robot.\nname = \"x\"\n\n[[joint]]\nname = \"a\" # left\nzero_deg = 180.0   # horn up\ndirection = 1\n\n[[joint]]\nname = \"b\"\nzero_deg = 90\ndirection = -1 # mirrored\n";
        let found = [
            JointSettings {
                joint: "a".into(),
                zero_deg: 171.5,
                direction: -1,
                homing_offset: Some(0),
            },
            JointSettings { joint: "b".into(), zero_deg: 90.0, direction: -1, homing_offset: None },
        ];
        let wanted =
            text.replace("180.0   #", "171.5   #").replace("direction = 1\n", "direction = -1\n");
        assert_eq!(edit(text, &found).unwrap(), wanted);
    }

    #[test]
    fn a_joint_reads_zero_where_it_rested() {
        let robot = Robot::load("neck").unwrap();
        let mut servo = robot.servos[0].clone();
        for (direction, moved_rad, turned) in [(1.0, 0.3, 1), (1.0, -0.3, -1), (-1.0, 0.05, -1)] {
            servo.direction = direction;
            let rest_rad = 0.25;
            let new = found(&servo, rest_rad, rest_rad + moved_rad);
            assert_eq!(new.direction, turned);
            let ticks = servo.exact_ticks(rest_rad).round() as i32;
            servo.zero_rad = new.zero_deg.to_radians();
            servo.direction = f64::from(new.direction);
            assert!(servo.position_rad(ticks).abs() < 1e-3);
            servo.zero_rad = robot.servos[0].zero_rad;
        }
    }
}
