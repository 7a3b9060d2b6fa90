//! Who is on a bus.

use super::listen::{Ear, ProtocolChoice, line, vitals};
use anyhow::bail;
use servodance_drivers::{Protocol, available_ports, latency_timer};

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

/// Every servo that answers on `port`, told as it is found; all usual rates and
/// both framings unless one is given. `note` gets what is not a servo.
pub fn scan(
    port: &str,
    baud: Option<u32>,
    protocol: ProtocolChoice,
    mut found: impl FnMut(&str),
    note: impl Fn(&str),
) -> anyhow::Result<()> {
    let ear = Ear::new(port, baud, protocol)?;
    if let Some(text) = latency_timer(ear.path()).and_then(|timer| timer.note(ear.path())) {
        note(&text);
    }
    let mut count = 0;
    for (protocol, baud) in ear.channels() {
        let mut probe = ear.probe(protocol, baud)?;
        note(&match protocol {
            Protocol::Dynamixel2 => format!("{baud} baud, protocol 2.0"),
            Protocol::Protocol1 => format!("{baud} baud, protocol 1: asking 254 ids"),
        });
        for servo in probe.everyone()? {
            count += 1;
            found(&line(&servo, &vitals(&mut probe, &servo)));
        }
    }
    if count == 0 {
        bail!(
            "{}: no servo answered at {}; check power, wiring and direction control of the adapter",
            ear.path(),
            ear.rates()
        );
    }
    Ok(())
}
