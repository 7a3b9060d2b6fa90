//! From a box of new servos to those of a robot: one servo after the other gets its settings,
//! its id and, last of all, its rate.
//!
//! ```text
//! look who is set up -> ask for one servo -> find it -> settings -> id -> rate -> next joint
//!      line.rs                            newcomer.rs  settings.rs  line.rs
//! ```
//!
//! A robot with several buses is set up bus by bus; motors on CAN have no rate to set, and
//! `can_line.rs` finds them.
//!
//! How far a robot is, its bus says: a servo with a joint's id, model and the bus's rate is set
//! up. Because the rate comes last, a servo that was interrupted is found where it was.
//! Torque goes off, and never on.

mod can_line;
mod line;
mod newcomer;
mod settings;
mod voice;

pub use voice::NextServo;

use crate::bus_tools::plug;
use crate::bus_tools::setup::can_line::CanLine;
use crate::bus_tools::setup::line::SetupLine;
use crate::bus_tools::setup::voice::Voice;
use crate::robot::Robot;
use anyhow::bail;
use servodance_drivers::Port;
use std::io::IsTerminal;

enum AnyLine<'a> {
    Serial(SetupLine<'a>),
    Can(CanLine<'a>),
}

/// Sets up every servo of the robot that is not yet. Refused, and asked for again where
/// somebody is there: two new servos at once, a servo of another model.
pub fn set_up(
    robot: &Robot,
    ports: &[String],
    next: NextServo,
    say: impl Fn(&str),
    note: impl Fn(&str),
) -> anyhow::Result<()> {
    if next == NextServo::Asked && !std::io::stdin().is_terminal() {
        bail!("there is no terminal to ask on: --yes takes each new servo as soon as it answers");
    }
    let ports = plug::ports(robot, ports)?;
    // What cannot be set up at all is said before anything is changed.
    let mut lines = Vec::with_capacity(ports.len());
    for (port, layout) in ports.iter().zip(&robot.buses) {
        lines.push(match port {
            Port::Serial(_) => AnyLine::Serial(SetupLine::new(port, layout)?),
            Port::Can(_) => AnyLine::Can(CanLine::new(port, layout)?),
            Port::Ros2(_) => bail!("{port}: the servos behind ROS 2 are set up by their own tools"),
        });
    }
    let voice = Voice { say: &say, note: &note };
    for (line, layout) in lines.iter().zip(&robot.buses) {
        if robot.buses.len() > 1 {
            say(&format!("bus {}:", layout.config.name));
        }
        match line {
            AnyLine::Serial(line) => line.set_up(next, &voice)?,
            AnyLine::Can(line) => line.set_up(next, &voice)?,
        }
    }
    say(&format!(
        "{}: all {} servos are set up; next: connect them all, `servodance servos check`, `servodance calibrate`",
        robot.name,
        robot.servos.len()
    ));
    Ok(())
}
