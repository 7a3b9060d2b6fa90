//! The servos on a bus.

use super::listen::{ProtocolChoice, SerialListener, line, vitals};
use crate::process::realtime::{OrdinaryAfterwards, ThreadRole, raise};
use crate::process::wrong_usage::misused;
use anyhow::bail;
use servodance_drivers::can::{CanFound, CanPort, CanScanner};
use servodance_drivers::{Framing, available_ports, latency_timer};

/// The bitrates of a serial CAN adapter, the usual ones first.
const BITRATES: [u32; 9] =
    [1_000_000, 500_000, 250_000, 125_000, 800_000, 100_000, 50_000, 20_000, 10_000];

/// The serial ports of this machine, a line each, with what slows them down.
pub fn ports() -> Vec<String> {
    let ports = available_ports();
    if ports.is_empty() {
        return vec![
            "no serial port found; plug the adapter in, or see `servodance sim-bus`".into(),
        ];
    }
    let line = |port: String| match latency_timer(&port) {
        Some(timer) => format!("{port}  latency timer {} ms", timer.latency_ms),
        None => port,
    };
    ports.into_iter().map(line).collect()
}

/// Every servo or motor that answers on `port`, told as it is found; all usual
/// rates, and of a serial port both framings, unless one is given. `note` gets
/// what is not a servo.
pub fn scan(
    port: &str,
    baud: Option<u32>,
    protocol: ProtocolChoice,
    mut found: impl FnMut(&str),
    note: impl Fn(&str),
) -> anyhow::Result<()> {
    if let Ok(can) = CanPort::parse(port) {
        if protocol != ProtocolChoice::All {
            misused!("--protocol is for serial servos; on CAN every family is looked for");
        }
        return scan_can(port, &can, baud, found, note);
    }
    // Thousands of pings, each a moment late on a busy machine, would take half as long again.
    // Where it is not allowed they do.
    let _afterwards = OrdinaryAfterwards;
    let _ = raise(ThreadRole::Control);
    let listener = SerialListener::new(port, baud, protocol)?;
    if let Some(text) = latency_timer(listener.path()).and_then(|timer| timer.note(listener.path()))
    {
        note(&text);
    }
    let mut count = 0;
    for (protocol, baud) in listener.usual_channels() {
        let mut probe = listener.probe(protocol, baud)?;
        note(&match protocol {
            Framing::Protocol2 => format!("looking at {baud} baud, protocol 2.0"),
            Framing::Protocol1 => format!("looking at {baud} baud, protocol 1"),
        });
        for servo in probe.everyone()? {
            count += 1;
            found(&line(&servo, &vitals(&mut probe, &servo)));
        }
    }
    if baud.is_none() {
        note("rates below 38400 baud were left out: --baud looks at one");
    }
    if count == 0 {
        bail!(
            "{}: no servo answered at {}; check power, wiring and direction control of the adapter",
            listener.path(),
            listener.rates()
        );
    }
    Ok(())
}

/// Every motor that is heard or answers on a CAN bus. A bus has one bitrate:
/// where somebody answers, no other is tried.
fn scan_can(
    port: &str,
    can: &CanPort,
    bitrate: Option<u32>,
    mut found: impl FnMut(&str),
    note: impl Fn(&str),
) -> anyhow::Result<()> {
    let is_adapter = matches!(can, CanPort::Slcan(_));
    let bitrates = match bitrate {
        Some(bitrate) if is_adapter => vec![bitrate],
        Some(_) => misused!("--baud is for slcan: the bitrate of {port} is set by the system"),
        None if is_adapter => BITRATES.to_vec(),
        None => vec![BITRATES[0]],
    };
    for &bitrate in &bitrates {
        let rate = match is_adapter {
            true => format!("{bitrate} bit/s  "),
            false => String::new(),
        };
        let mut scanner = CanScanner::open(port, bitrate)?;
        note(&format!("{rate}listening, then asking 127 ids in three languages"));
        match scanner.everyone() {
            Ok(motors) if motors.is_empty() => {}
            Ok(motors) => {
                let lines = motors.iter().map(|motor| format!("{rate}{}", can_line(motor)));
                lines.for_each(|line| found(&line));
                return Ok(());
            }
            Err(error) if bitrates.len() > 1 => note(&format!("{rate}{error}")),
            Err(error) => bail!("{port}: {error}"),
        }
    }
    bail!(
        "{port}: no motor was heard or answered; check power, wiring and termination; CubeMars \
         motors answer only what takes their torque: `servodance ping {port} --robot FILE`"
    )
}

fn can_line(motor: &CanFound) -> String {
    format!(
        "{}  id {:>3}  {}  firmware {}  {}{}",
        motor.family,
        motor.id,
        motor.model.unwrap_or("model not told"),
        motor.firmware.as_deref().unwrap_or("not told"),
        motor.detail.as_ref().map_or(String::new(), |detail| format!("{detail}  ")),
        motor.error.as_deref().unwrap_or("no error told")
    )
}
