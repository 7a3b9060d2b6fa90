//! What the system knows of its serial ports: which there are, and the latency
//! timer of their USB adapter.

use std::path::Path;

/// How long a USB adapter (FTDI) collects bytes before it passes them on.
#[allow(missing_docs)] // units stand in the names
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatencyTimer {
    /// Milliseconds; 1 is the best, 16 the default.
    pub latency_ms: u32,
    pub file: String,
}

impl LatencyTimer {
    /// What to do about it; nothing where it is as short as can be.
    pub fn note(&self, port: &str) -> Option<String> {
        let Self { latency_ms, file } = self;
        (*latency_ms > 1).then(|| {
            format!(
                "USB latency timer of {port} is {latency_ms} ms and delays every reply: \
                 set it with `echo 1 | sudo tee {file}`"
            )
        })
    }
}

/// The latency timer of a serial port, if it has one.
pub fn latency_timer(port: &str) -> Option<LatencyTimer> {
    latency_timer_in(Path::new("/sys/bus/usb-serial/devices"), port)
}

fn latency_timer_in(devices: &Path, port: &str) -> Option<LatencyTimer> {
    let device = Path::new(port).canonicalize().ok()?;
    let file = devices.join(device.file_name()?).join("latency_timer");
    let latency_ms = std::fs::read_to_string(&file).ok()?.trim().parse().ok()?;
    Some(LatencyTimer { latency_ms, file: file.to_string_lossy().into_owned() })
}

/// The serial ports of this machine.
pub fn available_ports() -> Vec<String> {
    // Without this folder the enumeration of `serialport` panics.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let ports = serialport::available_ports().unwrap_or_default();
    ports.into_iter().map(|port| port.port_name).collect()
}

pub(super) fn choices() -> String {
    let ports = available_ports();
    if ports.is_empty() {
        "; this machine has no serial ports".into()
    } else {
        format!("; serial ports here: {}", ports.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_adapter_is_told_with_what_to_do() {
        let folder = std::env::temp_dir().join(format!("latency-{}", std::process::id()));
        let device = folder.join("devices/ttyUSB0");
        std::fs::create_dir_all(&device).unwrap();
        std::fs::write(folder.join("ttyUSB0"), "").unwrap();
        std::fs::write(device.join("latency_timer"), "16\n").unwrap();
        let port = folder.join("ttyUSB0");
        let port = port.to_str().unwrap();
        let timer = latency_timer_in(&folder.join("devices"), port).unwrap();
        let note = timer.note(port).unwrap();
        assert!(note.contains("is 16 ms") && note.contains("latency_timer`"), "{note}");
        let best = LatencyTimer { latency_ms: 1, ..timer };
        assert_eq!(best.note(port), None);
        assert_eq!(latency_timer_in(&folder.join("devices"), "/dev/null"), None);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
