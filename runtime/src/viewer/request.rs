//! Requests of viewers to the control loop, and their form in JSON.
//!
//! ```json
//! {"do": "hold"}
//! {"set": {"amplitude": 0.5, "style": "salsa"}}
//! ```
//!
//! Text is checked here once; a request for the control loop is small and `Copy`.
//! The emergency stop is no request: it does not wait in a queue.

use super::snapshot::{Activity, ViewerSettings};
use crate::control::idle::IdleStyle;
use serde::Deserialize;

/// Bytes of the name of a press.
const LONGEST_PRESS: usize = 32;

#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // the names say it
pub enum ViewerRequest {
    /// Torque on, and dance; only while waiting.
    Start,
    Hold,
    Resume,
    Stop,
    /// Release the emergency stop; only while waiting.
    Release,
    Amplitude(f64),
    Mirror(bool),
    Idle(IdleStyle),
    Style(usize),
    Seed(u64),
    /// The page of an operator has fallen silent.
    OperatorLost,
    /// Now is a beat: two of them put tempo and phase right.
    Tap,
    /// Another moment of a recording, seconds of music; only while playing.
    Seek(f64),
}

impl ViewerRequest {
    /// Takes over the setting that this request changes; other requests change none.
    pub fn apply_to(self, settings: &mut ViewerSettings) {
        match self {
            Self::Amplitude(amplitude) => settings.amplitude = amplitude,
            Self::Mirror(mirror) => settings.mirror = mirror,
            Self::Idle(idle) => settings.idle = idle,
            Self::Style(style) => settings.style = style,
            Self::Seed(seed) => settings.seed = seed,
            _ => {}
        }
    }

    /// Whether it makes sense now; `pressed` is the emergency stop. The error is one line.
    pub fn possible(self, activity: Activity, pressed: bool) -> Result<(), String> {
        let waiting = activity == Activity::Waiting;
        let playing = activity == Activity::Playing;
        let no = |why: &str| Err(format!("{why} (it is {})", activity.name()));
        match self {
            Self::Start if !waiting => no("start is for a program that waits (--wait-for-start)"),
            Self::Start if pressed => no("the emergency stop is pressed: release it first"),
            Self::Release if !waiting => no("the emergency stop is released while waiting"),
            Self::Seek(_) if !playing => no("time_s is for a recording that is played"),
            Self::Hold | Self::Resume | Self::Stop if waiting => no("nothing moves"),
            Self::Tap if waiting || playing => no("a tap is for music that is danced to"),
            _ => Ok(()),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RequestText {
    #[serde(rename = "do")]
    action: Option<ActionText>,
    set: Option<SettingsText>,
    /// Which press of STOP it is about.
    press: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ActionText {
    Start,
    Hold,
    Resume,
    Stop,
    Tap,
    Estop,
    Release,
    Alive,
    Seen,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SettingsText {
    amplitude: Option<f64>,
    mirror: Option<bool>,
    idle: Option<IdleStyle>,
    style: Option<String>,
    seed: Option<u64>,
    time_s: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum ParsedRequest {
    /// The emergency stop, with the name of this press if its page waits for a confirmation.
    EStop(Option<String>),
    /// The page shows that this press has stopped the robot.
    Seen(String),
    /// The page is open in front of somebody.
    Alive,
    Requests(Vec<ViewerRequest>),
}

/// Understands a request; `styles` are those that the model knows.
/// The error is one line for the viewer: what is wrong, and the choices.
pub fn parse_request(json: &str, styles: &[String]) -> Result<ParsedRequest, String> {
    let text: RequestText = serde_json::from_str(json).map_err(|error| error.to_string())?;
    match (text.action, text.set, text.press) {
        // Whatever else it says, a stop stops.
        (Some(ActionText::Estop), _, press) => {
            Ok(ParsedRequest::EStop(press.filter(|press| press.len() <= LONGEST_PRESS)))
        }
        (Some(ActionText::Seen), None, Some(press)) => Ok(ParsedRequest::Seen(press)),
        (_, _, Some(_)) => Err("\"press\" is for \"estop\" and \"seen\"".into()),
        (Some(ActionText::Seen), None, None) => Err("\"seen\" needs a \"press\"".into()),
        (Some(action), None, None) => Ok(action.request()),
        (None, Some(wanted), None) => wanted.requests(styles).map(ParsedRequest::Requests),
        _ => Err("expected either \"do\" or \"set\"".into()),
    }
}

impl ActionText {
    fn request(self) -> ParsedRequest {
        ParsedRequest::Requests(vec![match self {
            Self::Start => ViewerRequest::Start,
            Self::Hold => ViewerRequest::Hold,
            Self::Resume => ViewerRequest::Resume,
            Self::Stop => ViewerRequest::Stop,
            Self::Tap => ViewerRequest::Tap,
            Self::Release => ViewerRequest::Release,
            Self::Estop => return ParsedRequest::EStop(None),
            Self::Alive | Self::Seen => return ParsedRequest::Alive,
        }])
    }
}

impl SettingsText {
    fn requests(self, styles: &[String]) -> Result<Vec<ViewerRequest>, String> {
        let mut requests = Vec::new();
        if let Some(amplitude) = self.amplitude {
            if !(0.0..=1.0).contains(&amplitude) {
                return Err(format!("amplitude is {amplitude}, expected 0 to 1"));
            }
            requests.push(ViewerRequest::Amplitude(amplitude));
        }
        if let Some(style) = self.style {
            let place = styles.iter().position(|known| *known == style);
            let known = || format!("unknown style \"{style}\"; known: {}", styles.join(", "));
            requests.push(ViewerRequest::Style(place.ok_or_else(known)?));
        }
        if let Some(time_s) = self.time_s {
            requests.push(ViewerRequest::Seek(time_s));
        }
        requests.extend(self.mirror.map(ViewerRequest::Mirror));
        requests.extend(self.idle.map(ViewerRequest::Idle));
        requests.extend(self.seed.map(ViewerRequest::Seed));
        match requests.is_empty() {
            true => Err("nothing to set".into()),
            false => Ok(requests),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn styles() -> Vec<String> {
        ["hype", "salsa"].map(String::from).to_vec()
    }

    #[test]
    fn requests_are_understood() {
        for (json, wanted) in [
            (r#"{"do":"hold"}"#, vec![ViewerRequest::Hold]),
            (r#"{"set":{"amplitude":0.5}}"#, vec![ViewerRequest::Amplitude(0.5)]),
            (
                r#"{"set":{"style":"salsa","mirror":true,"idle":"rest"}}"#,
                vec![
                    ViewerRequest::Style(1),
                    ViewerRequest::Mirror(true),
                    ViewerRequest::Idle(IdleStyle::Rest),
                ],
            ),
        ] {
            let understood = parse_request(json, &styles());
            assert_eq!(understood, Ok(ParsedRequest::Requests(wanted)), "{json}");
        }
        let estop = parse_request(r#"{"do":"estop"}"#, &styles());
        assert_eq!(estop, Ok(ParsedRequest::EStop(None)));
        let estop = parse_request(r#"{"do":"estop","press":"x7"}"#, &styles());
        assert_eq!(estop, Ok(ParsedRequest::EStop(Some("x7".into()))));
        let seen = parse_request(r#"{"do":"seen","press":"x7"}"#, &styles());
        assert_eq!(seen, Ok(ParsedRequest::Seen("x7".into())));
        assert_eq!(parse_request(r#"{"do":"alive"}"#, &styles()), Ok(ParsedRequest::Alive));
    }

    #[test]
    fn what_is_not_understood_is_said() {
        for (json, word) in [
            ("", "EOF"),
            ("[]", "expected"),
            ("{}", "either"),
            (r#"{"do":"jump"}"#, "jump"),
            (r#"{"do":"hold","set":{"seed":1}}"#, "either"),
            (r#"{"do":"hold","press":"x7"}"#, "estop"),
            (r#"{"do":"seen"}"#, "press"),
            (r#"{"set":{}}"#, "nothing"),
            (r#"{"set":{"amplitude":1.5}}"#, "0 to 1"),
            (r#"{"set":{"amplitude":null,"speed":2}}"#, "speed"),
            (r#"{"set":{"style":"polka"}}"#, "hype, salsa"),
            (r#"{"set":{"seed":-1}}"#, "-1"),
            (r#"{"set":{"idle":"jump"}}"#, "sway"),
        ] {
            let error = parse_request(json, &styles()).unwrap_err();
            assert!(error.contains(word), "{json}: {error}");
        }
    }
}
