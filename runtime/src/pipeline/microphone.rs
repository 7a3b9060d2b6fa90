//! Microphones: those there are, and listening to one. Built in with the
//! feature `mic`; without it, both say how to get it.

use servodance_audio::AudioSource;

/// Opens an input by id or name, the default one if `None`.
#[cfg(feature = "mic")]
pub fn microphone(name: Option<&str>) -> anyhow::Result<AudioSource> {
    Ok(AudioSource::microphone(name)?)
}

/// The inputs of this machine as text: a line each, the default one first.
#[cfg(feature = "mic")]
pub fn input_table() -> anyhow::Result<String> {
    use std::fmt::Write;

    let devices = servodance_audio::capture::devices()?;
    if devices.is_empty() {
        return Ok("no inputs\n".to_owned());
    }
    let width = devices.iter().map(|d| d.id.len()).max().unwrap_or(0);
    let mut text = String::new();
    for device in &devices {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{} {:width$}  {} Hz  {} channels  {}",
            if device.is_default { "*" } else { " " },
            device.id,
            spans(device.rates_hz.iter().copied()),
            spans(device.channels.iter().map(|&n| (n.into(), n.into()))),
            device.name,
        );
    }
    text.push_str("* the default one\n");
    Ok(text)
}

/// Values and ranges in order as text; neighbours become one range.
#[cfg(feature = "mic")]
fn spans(ranges: impl Iterator<Item = (u32, u32)>) -> String {
    let mut merged: Vec<(u32, u32)> = Vec::new();
    for (low, high) in ranges {
        // A plug-in that takes any rate says so with the largest number.
        let high = high.min(384_000);
        match merged.last_mut() {
            Some(last) if low <= last.1 + 1 => last.1 = last.1.max(high),
            _ => merged.push((low, high)),
        }
    }
    let span = |(low, high)| match low == high {
        true => format!("{low}"),
        false => format!("{low}-{high}"),
    };
    let spans: Vec<String> = merged.into_iter().map(span).collect();
    spans.join(", ")
}

#[cfg(not(feature = "mic"))]
const NOT_BUILT_IN: &str = "microphones are not built in; build with: \
    cargo build --release --features mic (on Debian first: apt install libasound2-dev pkg-config)";

/// Says how to build it in.
#[cfg(not(feature = "mic"))]
pub fn microphone(_name: Option<&str>) -> anyhow::Result<AudioSource> {
    anyhow::bail!(NOT_BUILT_IN)
}

/// Says how to build it in.
#[cfg(not(feature = "mic"))]
pub fn input_table() -> anyhow::Result<String> {
    anyhow::bail!(NOT_BUILT_IN)
}
