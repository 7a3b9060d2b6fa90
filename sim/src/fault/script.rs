//! Faults by script: `TIME WHO WHAT [VALUE]`, one a line, `#` begins a comment.
//!
//! ```text
//! 3s    joint_3  dead           dead, revive, reboot, jam, free, overload,
//! 4s    joint_3  overheat 85    overheat CELSIUS, supply VOLTS, flags BITS, id N, baud N
//! 5s    wire     corrupt 0.01   drop, late (60 ms), corrupt, truncate, duplicate,
//! 6s    wire     clear          noise, echo, corrupt-instruction: each with a SHARE
//! 7s    adapter  gone           gone, back; bus-off, bus-on (CAN)
//! 8s    push     1 0 1.5        1.5 newton seconds towards x, for 50 ms (in a world)
//! 9s    lift                    put back where it was at the start (in a world)
//! 9s    pick-up  0.1            a hand lifts the robot by 0.1 m (in a world)
//! 12s   set-down                the hand sets it down and lets go
//! 9s    imu      dead           dead, revive: the motion sensor on the bus
//! 9s    plug     joint_3        plug, unplug: its plug goes in or out; new: as out of the box
//! ```
//!
//! A push has the direction `X Y` of the world and a size in newton seconds.
//! Refused with the line: a time that is none, somebody unknown, a fault that
//! is unknown or lacks its value.

use crate::bus::SimBus;
use crate::error::SimError;
use crate::fault::{ServoFault, WireFault};

/// Something that is to happen.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// To the servo at this place among all joints.
    Servo(usize, ServoFault),
    /// To the wire of every bus, for this share of the replies; `None` ends it.
    Wire(Option<(WireFault, f64)>),
    /// The adapters are pulled out (true) or put back.
    Adapter(bool),
    /// The CAN controllers leave the bus (true) or come back.
    BusOff(bool),
    /// Somebody pushes the robot: newton seconds towards x and y.
    Push([f64; 2]),
    /// A hand puts the robot back where it was at the start.
    Lift,
    /// A hand lifts it by so many metres, and sets it down again.
    PickUp(f64),
    /// See `PickUp`.
    SetDown,
    /// The motion sensor falls silent (true) or answers again.
    Imu(bool),
}

/// A line of a script.
#[derive(Clone, Debug, PartialEq)]
pub struct Cue {
    /// When, seconds from the start.
    pub time_s: f64,
    /// The fault, or its end.
    pub what: Happening,
}

/// The lines of a script in the order of time; `joints` are the names of all servos.
pub fn parse_script(text: &str, joints: &[&str]) -> Result<Vec<Cue>, SimError> {
    let mut cues = Vec::new();
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if !line.is_empty() {
            cues.push(parse_line(line, joints)?);
        }
    }
    cues.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(cues)
}

fn parse_line(line: &str, joints: &[&str]) -> Result<Cue, SimError> {
    let bad = |reason: String| SimError::Script { line: line.into(), reason };
    let mut words = line.split_whitespace();
    let mut word = |what: &str| words.next().ok_or_else(|| bad(format!("no {what}")));
    let time = word("time")?;
    let time_s = time.strip_suffix('s').and_then(|t| t.parse().ok());
    let time_s = time_s
        .filter(|t: &f64| (0.0..=1e6).contains(t))
        .ok_or_else(|| bad(format!("\"{time}\" is no time like 3.5s")))?;
    let who = word("joint, wire or adapter")?;
    let what = happening(who, words, joints).map_err(bad)?;
    Ok(Cue { time_s, what })
}

/// What is to happen at once, as a line of a script without its time: `plug knee`.
pub fn parse_happening(line: &str, joints: &[&str]) -> Result<Happening, SimError> {
    let bad = |reason: String| SimError::Script { line: line.into(), reason };
    let mut words = line.split_whitespace();
    let who = words.next().ok_or_else(|| bad("nothing in it".into()))?;
    happening(who, words, joints).map_err(bad)
}

fn happening<'a>(
    who: &str,
    mut words: impl Iterator<Item = &'a str>,
    joints: &[&str],
) -> Result<Happening, String> {
    match who {
        "push" | "lift" | "pick-up" | "set-down" => return body_event(who, words),
        "plug" => return plug_event(ServoFault::Plug, words, joints),
        "unplug" => return plug_event(ServoFault::Unplug, words, joints),
        "new" => return plug_event(ServoFault::New, words, joints),
        _ => {}
    }
    let fault = words.next().ok_or("no fault")?;
    let value: Option<f64> = match words.next() {
        None => None,
        Some(text) => {
            let value = text.parse().ok().filter(|value: &f64| value.is_finite());
            Some(value.ok_or_else(|| format!("\"{text}\" is no number"))?)
        }
    };
    if let Some(more) = words.next() {
        return Err(format!("\"{more}\" is one word too many"));
    }
    Ok(match who {
        "wire" => Happening::Wire(wire_fault(fault, value)?),
        "adapter" => match fault {
            "gone" => Happening::Adapter(true),
            "back" => Happening::Adapter(false),
            "bus-off" => Happening::BusOff(true),
            "bus-on" => Happening::BusOff(false),
            _ => return Err("an adapter can be gone, back, bus-off or bus-on".into()),
        },
        "imu" => match fault {
            "dead" => Happening::Imu(true),
            "revive" => Happening::Imu(false),
            _ => return Err("a motion sensor can be dead or revive".into()),
        },
        joint => Happening::Servo(place_of(joint, joints)?, servo_fault(fault, value)?),
    })
}

fn place_of(joint: &str, joints: &[&str]) -> Result<usize, String> {
    let place = joints.iter().position(|known| *known == joint);
    place.ok_or_else(|| {
        let names = joints.join(", ");
        format!("no \"{joint}\"; there are wire, adapter, {names}")
    })
}

/// `plug JOINT`, `unplug JOINT`, `new JOINT`.
fn plug_event<'a>(
    fault: ServoFault,
    mut words: impl Iterator<Item = &'a str>,
    joints: &[&str],
) -> Result<Happening, String> {
    match (words.next(), words.next()) {
        (Some(joint), None) => Ok(Happening::Servo(place_of(joint, joints)?, fault)),
        _ => Err("one joint stands behind plug, unplug and new".into()),
    }
}

/// `push X Y NS`, `lift`, `pick-up METRES` or `set-down`.
fn body_event<'a>(who: &str, words: impl Iterator<Item = &'a str>) -> Result<Happening, String> {
    let numbers: Vec<&str> = words.collect();
    let read = |text: &&str| text.parse().ok().filter(|number: &f64| number.is_finite());
    let read: Option<Vec<f64>> = numbers.iter().map(read).collect();
    match (who, read.as_deref()) {
        ("lift", Some([])) => Ok(Happening::Lift),
        ("set-down", Some([])) => Ok(Happening::SetDown),
        ("lift" | "set-down", _) => Err(format!("nothing stands behind {who}")),
        ("pick-up", Some(&[height_m])) if (0.0..=1.0).contains(&height_m) => {
            Ok(Happening::PickUp(height_m))
        }
        ("pick-up", _) => Err("a robot is picked up by 0 to 1 metres: pick-up 0.1".into()),
        (_, Some(&[x, y, impulse_ns])) if x.hypot(y) > 0.0 => {
            Ok(Happening::Push([x, y].map(|part| part / x.hypot(y) * impulse_ns)))
        }
        _ => Err("a push needs a direction X Y and newton seconds: push 1 0 1.5".into()),
    }
}

fn servo_fault(fault: &str, value: Option<f64>) -> Result<ServoFault, String> {
    let needed = value.ok_or_else(|| format!("{fault} needs a number"));
    Ok(match fault {
        "dead" => ServoFault::Dead,
        "revive" => ServoFault::Revive,
        "reboot" => ServoFault::Reboot,
        "jam" => ServoFault::Jam,
        "free" => ServoFault::Free,
        "overload" => ServoFault::Overload,
        "trip" => ServoFault::Trip,
        "overheat" => ServoFault::Overheat(needed?),
        "supply" => ServoFault::Supply(needed?),
        "baud" => match needed? {
            baud if (1.0..=1e7).contains(&baud) && baud.fract() == 0.0 => {
                ServoFault::Baud(baud as u32)
            }
            baud => return Err(format!("baud {baud} is not 1 to 10000000")),
        },
        "flags" => match needed? {
            bits if (0.0..=255.0).contains(&bits) && bits.fract() == 0.0 => {
                ServoFault::Flags(bits as u8)
            }
            bits => return Err(format!("flags {bits} is not 0 to 255")),
        },
        "id" => match needed? {
            id if (0.0..=252.0).contains(&id) && id.fract() == 0.0 => ServoFault::Id(id as u8),
            id => return Err(format!("id {id} is not 0 to 252")),
        },
        _ => {
            return Err(format!(
                "no fault \"{fault}\"; a servo can be dead, revive, reboot, jam, free, overload, trip, \
                 overheat CELSIUS, supply VOLTS, flags BITS, id N, baud N"
            ));
        }
    })
}

fn wire_fault(fault: &str, share: Option<f64>) -> Result<Option<(WireFault, f64)>, String> {
    let kind = match fault {
        "clear" => return Ok(None),
        "drop" => WireFault::Drop,
        "late" => WireFault::Late(0.06),
        "corrupt" => WireFault::Corrupt,
        "truncate" => WireFault::Truncate,
        "duplicate" => WireFault::Duplicate,
        "noise" => WireFault::Noise,
        "echo" => WireFault::Echo,
        "corrupt-instruction" => WireFault::CorruptInstruction,
        "lose" => WireFault::Lose,
        "bytes" => WireFault::Bytes,
        _ => {
            return Err(format!(
                "no fault \"{fault}\"; a wire can clear, drop, late, corrupt, truncate, duplicate, \
                 noise, echo, corrupt-instruction, lose, bytes"
            ));
        }
    };
    match share {
        Some(share) if (0.0..=1.0).contains(&share) => Ok(Some((kind, share))),
        _ => Err(format!("{fault} needs a share of 0 to 1")),
    }
}

/// Makes it happen on these buses, of which `joints[bus]` are the places among all joints.
pub fn happen(
    what: &Happening,
    buses: &mut [SimBus],
    joints: &[Vec<usize>],
) -> Result<(), SimError> {
    // One world for all buses.
    let world = buses.first().and_then(SimBus::world);
    match (what, world) {
        (Happening::Push(impulse_ns), Some(world)) => world.push(*impulse_ns),
        (Happening::Lift, Some(world)) => world.lift(),
        (Happening::PickUp(height_m), Some(world)) => world.pick_up(*height_m),
        (Happening::SetDown, Some(world)) => world.set_down(),
        _ => {}
    }
    for (bus, joints) in buses.iter_mut().zip(joints) {
        match what {
            Happening::Servo(place, fault) => {
                if let Some(own) = joints.iter().position(|joint| joint == place) {
                    bus.set_servo_fault(own, *fault);
                }
            }
            Happening::Wire(fault) => bus.set_wire_fault(*fault),
            Happening::Adapter(true) => bus.unplug(),
            Happening::Adapter(false) => bus.replug()?,
            Happening::BusOff(off) => bus.set_bus_off(*off),
            Happening::Imu(silent) => bus.silence_imu(*silent),
            Happening::Push(_) | Happening::Lift | Happening::PickUp(_) | Happening::SetDown => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINTS: [&str; 2] = ["neck", "knee"];

    #[test]
    fn a_script_is_read_in_the_order_of_time() {
        let text = "# a bad day\n4s knee overheat 85\n\n1.5s wire corrupt 0.1 # a little\n2s adapter gone\n3s adapter back\n5s wire clear\n6s neck id 2\n7s push 0 -2 1.5\n8s lift\n9s imu dead\n10s pick-up 0.1\n11s set-down";
        let cues = parse_script(text, &JOINTS).unwrap();
        let times: Vec<f64> = cues.iter().map(|cue| cue.time_s).collect();
        assert_eq!(times, [1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0]);
        assert_eq!([&cues[9].what, &cues[10].what], [&Happening::PickUp(0.1), &Happening::SetDown]);
        assert_eq!(cues[6].what, Happening::Push([0.0, -1.5]));
        assert_eq!([&cues[7].what, &cues[8].what], [&Happening::Lift, &Happening::Imu(true)]);
        assert_eq!(cues[3].what, Happening::Servo(1, ServoFault::Overheat(85.0)));
        assert_eq!(cues[5].what, Happening::Servo(0, ServoFault::Id(2)));
    }

    #[test]
    fn a_line_without_a_time_happens_at_once() {
        for (line, fault) in [
            ("plug knee", ServoFault::Plug),
            (" unplug  knee", ServoFault::Unplug),
            ("new knee", ServoFault::New),
            ("knee id 7", ServoFault::Id(7)),
        ] {
            let happening = parse_happening(line, &JOINTS).unwrap();
            assert_eq!(happening, Happening::Servo(1, fault), "{line}");
        }
        let error = parse_happening("1s plug knee", &JOINTS).unwrap_err().to_string();
        assert!(error.contains("1s plug knee"), "{error}");
        assert!(parse_happening("", &JOINTS).is_err());
    }

    #[test]
    fn what_is_wrong_is_told_with_the_line() {
        for (line, says) in [
            ("knee dead", "\"knee\" is no time"),
            ("1s", "no joint, wire or adapter"),
            ("1s elbow dead", "there are wire, adapter, neck, knee"),
            ("1s knee sad", "a servo can be dead"),
            ("1s knee overheat", "overheat needs a number"),
            ("1s knee overheat nan", "is no number"),
            ("1s knee id 300", "id 300 is not 0 to 252"),
            ("1s knee flags 256", "flags 256 is not 0 to 255"),
            ("1s knee baud 0.5", "baud 0.5 is not 1"),
            ("1s push 1 0", "a push needs a direction"),
            ("1s push 0 0 1", "a push needs a direction"),
            ("1s push 1 0 nan", "a push needs a direction"),
            ("1s lift 2", "nothing stands behind lift"),
            ("1s pick-up 7", "0 to 1 metres"),
            ("1s set-down 1", "nothing stands behind set-down"),
            ("1s plug", "one joint stands behind plug"),
            ("1s unplug elbow", "no \"elbow\""),
            ("1s imu sad", "dead or revive"),
            ("1s wire drop", "drop needs a share"),
            ("1s wire drop 2", "drop needs a share"),
            ("1s adapter lost", "gone, back"),
            ("-1s knee dead", "is no time"),
            ("1s knee dead 1 2", "one word too many"),
        ] {
            let error = parse_script(line, &JOINTS).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains(line), "{error}");
        }
    }
}
