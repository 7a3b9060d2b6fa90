//! What servos measure, ten times a second, as a table.

use crate::bus_tools::memory::place::{ServoPlace, ServoPlaces};
use anyhow::bail;
use servodance_drivers::serial::table::measure::ServoUnits;
use servodance_drivers::{
    BusError, BusResult, FoundServo, Framing, Readings, SerialScanner, ServoModel,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const PERIOD: Duration = Duration::from_millis(100);
/// A wait is cut into pieces, so that Ctrl-C ends it at once.
const PIECE: Duration = Duration::from_millis(10);

/// Which servos, and how often.
#[derive(Debug)]
pub struct Watch<'a> {
    /// The servos.
    pub places: &'a ServoPlaces,
    /// One servo alone: its id or joint.
    pub one: Option<&'a str>,
    /// So many tables; without end if `None`.
    pub count: Option<u64>,
}

/// A servo that is watched: who it is on its line.
struct Watched {
    place: ServoPlace,
    found: Option<FoundServo>,
    /// The place of its line.
    line: usize,
}

/// A line that is open: port, framing and rate.
struct Line {
    path: String,
    channel: (Framing, u32),
    probe: SerialScanner,
}

/// Shows tables until `stop` is set, or there were enough. Nothing is written. A servo that
/// does not answer has a row that says so.
pub fn watch(watch: &Watch, stop: &AtomicBool, show: impl Fn(&[String])) -> anyhow::Result<()> {
    let (mut lines, mut servos) = open(watch)?;
    let stopped = || stop.load(Ordering::Acquire);
    let mut tables = 0;
    while watch.count.is_none_or(|count| tables < count) {
        let began = Instant::now();
        let mut rows = vec![head()];
        for servo in &mut servos {
            if stopped() {
                return Ok(());
            }
            rows.push(row(servo, &mut lines)?);
        }
        show(&rows);
        tables += 1;
        let is_last = watch.count == Some(tables);
        while !is_last && began.elapsed() < PERIOD && !stopped() {
            std::thread::sleep(PIECE);
        }
        if stopped() {
            return Ok(());
        }
    }
    Ok(())
}

/// Every line is opened once. Refused: servos of one port at two rates, for a port has one rate
/// at a time.
fn open(watch: &Watch) -> anyhow::Result<(Vec<Line>, Vec<Watched>)> {
    let places = match watch.one {
        Some(who) => vec![watch.places.one(who)?],
        None => watch.places.all()?,
    };
    let mut lines: Vec<Line> = Vec::new();
    let mut servos = Vec::with_capacity(places.len());
    for place in places {
        let channel = match place.channel() {
            Some(channel) => channel,
            None => {
                let found = place.open()?.found;
                (found.family.framing(), found.baud)
            }
        };
        let path = place.listener().path();
        let line = match lines.iter().position(|line| line.path == path) {
            Some(line) if lines[line].channel != channel => bail!(
                "servos answer at {} and at {} baud; --baud says which are watched",
                lines[line].channel.1,
                channel.1
            ),
            Some(line) => line,
            None => {
                let probe = place.listener().probe(channel.0, channel.1)?;
                lines.push(Line { path: path.into(), channel, probe });
                lines.len() - 1
            }
        };
        servos.push(Watched { place, found: None, line });
    }
    Ok((lines, servos))
}

fn head() -> String {
    format!(
        "{:<16} {:>3} {:>12} {:>14} {:>10} {:>8} {:>6}  errors",
        "servo", "id", "position", "velocity", "current", "voltage", "temp"
    )
}

fn row(servo: &mut Watched, lines: &mut [Line]) -> anyhow::Result<String> {
    let Watched { place, found, line } = servo;
    let probe = &mut lines[*line].probe;
    if found.is_none() {
        *found = heard(probe.ping(place.id))?;
    }
    let readings = match found {
        Some(found) => heard(probe.readings(found))?,
        None => None,
    };
    let (label, id) = (&place.label, place.id);
    Ok(match (found, readings) {
        (Some(found), Some(readings)) => {
            format!("{label:<16} {id:>3} {}", cells(place, found, &readings))
        }
        // It may come back as another one.
        (found, _) => {
            *found = None;
            format!("{label:<16} {id:>3} no answer")
        }
    })
}

/// An answer that does not come, or comes damaged, ends no watch.
fn heard<T>(answer: BusResult<Option<T>>) -> BusResult<Option<T>> {
    match answer {
        Err(BusError::Silent { .. } | BusError::Corrupt { .. }) => Ok(None),
        answer => answer,
    }
}

/// Position and velocity are the joint's where there is a robot, else the servo's own, its
/// angle from the middle of its turn.
fn cells(place: &ServoPlace, found: &FoundServo, readings: &Readings) -> String {
    let present = readings.present;
    let model = ServoModel::from_number(found.model_number);
    let (position, velocity) = match (&place.servo, model) {
        (Some(servo), _) => {
            let state = servo.state(present.ticks, present.velocity, present.current);
            (state.position_rad.to_degrees(), state.velocity_rad_s.to_degrees())
        }
        (None, Some(model)) => {
            let units = ServoUnits::from(model);
            let unit = units.velocity_rad_s_per_unit.to_degrees();
            (units.degrees(f64::from(present.ticks)), f64::from(present.velocity) * unit)
        }
        (None, None) => (f64::NAN, f64::NAN),
    };
    let current = match model.and_then(|model| model.current_a_per_unit) {
        Some(unit) => format!("{:.3} A", f64::from(present.current) * unit),
        None => "-".into(),
    };
    let errors = match readings.errors.as_deref() {
        Some("") => "none",
        Some(errors) => errors,
        None => "not told",
    };
    format!(
        "{:>12} {:>14} {current:>10} {:>8} {:>6}  {errors}",
        format!("{position:.1} deg"),
        format!("{velocity:.1} deg/s"),
        format!("{:.1} V", readings.voltage_v),
        format!("{:.0} C", readings.temperature_c),
    )
}
