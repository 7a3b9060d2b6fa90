//! Microphones: those there are, and listening to one. Built in with the
//! feature `mic`; without it, both say how to get it.

use servodance_audio::AudioSource;

/// Opens an input by id or name, the default one if `None`.
///
/// # Errors
/// There is none of that name, it cannot be opened, or microphones are not
/// built in.
#[cfg(feature = "mic")]
pub fn microphone(name: Option<&str>) -> anyhow::Result<AudioSource> {
    Ok(AudioSource::microphone(name)?)
}

/// The inputs of this machine as text: a line each, the default one first.
///
/// # Errors
/// The system does not say, or microphones are not built in.
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
        let rates = device.rates_hz.iter().map(|(low, high)| match low == high {
            true => format!("{low}"),
            false => format!("{low}-{high}"),
        });
        let channels = device.channels.iter().map(u16::to_string);
        let join = |words: Vec<String>| words.join(", ");
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{} {:width$}  {} Hz  {} channels  {}",
            if device.is_default { "*" } else { " " },
            device.id,
            join(rates.collect()),
            join(channels.collect()),
            device.name,
        );
    }
    text.push_str("* the default one\n");
    Ok(text)
}

#[cfg(not(feature = "mic"))]
const NOT_BUILT_IN: &str = "microphones are not built in; build with: \
    cargo build --release --features mic (on Debian first: apt install libasound2-dev pkg-config)";

/// Says how to build it in.
///
/// # Errors
/// Always.
#[cfg(not(feature = "mic"))]
pub fn microphone(_name: Option<&str>) -> anyhow::Result<AudioSource> {
    anyhow::bail!(NOT_BUILT_IN)
}

/// Says how to build it in.
///
/// # Errors
/// Always.
#[cfg(not(feature = "mic"))]
pub fn input_table() -> anyhow::Result<String> {
    anyhow::bail!(NOT_BUILT_IN)
}
