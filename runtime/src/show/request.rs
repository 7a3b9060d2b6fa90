//! What may be asked of a show, and how it is written: one JSON object.
//!
//! ```json
//! {"do": "hold"}
//! {"set": {"amplitude": 0.5, "style": "salsa"}}
//! ```
//!
//! Text is checked here once; what goes to the control loop is small and `Copy`.
//! The emergency stop is not among it: it does not wait in a queue.

use super::snapshot::Activity;
use crate::dance::IdleStyle;
use serde::{Deserialize, Serialize};

/// What can be changed while the robot dances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Share of the movement around rest, 0 to 1.
    pub amplitude: f64,
    /// Whether the robot is the dancer's mirror image.
    pub mirror: bool,
    /// What to do while there is no music.
    pub idle: IdleStyle,
    /// The style, as a place in the model's list.
    pub style: usize,
    /// Seed of the dancer's random numbers.
    pub seed: u64,
}

impl Settings {
    /// Takes over what a request sets, if it sets something.
    pub fn take(&mut self, request: Request) {
        match request {
            Request::Amplitude(amplitude) => self.amplitude = amplitude,
            Request::Mirror(mirror) => self.mirror = mirror,
            Request::Idle(idle) => self.idle = idle,
            Request::Style(style) => self.style = style,
            Request::Seed(seed) => self.seed = seed,
            _ => {}
        }
    }
}

/// A request to the control loop, which looks once a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Torque on, and dance; only while waiting.
    Start,
    /// Brake and hold position.
    Hold,
    /// Follow the dance again.
    Resume,
    /// To rest, then torque off.
    Stop,
    /// Release the emergency stop; only while waiting.
    Release,
    /// See [`Settings::amplitude`].
    Amplitude(f64),
    /// See [`Settings::mirror`].
    Mirror(bool),
    /// See [`Settings::idle`].
    Idle(IdleStyle),
    /// See [`Settings::style`].
    Style(usize),
    /// See [`Settings::seed`].
    Seed(u64),
    /// Another moment of a recording, seconds of music; only while playing.
    Seek(f64),
}

impl Request {
    /// Whether it makes sense now; `pressed` is the emergency stop.
    ///
    /// # Errors
    /// Why not, in a line for whoever asked.
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
            _ => Ok(()),
        }
    }
}

/// A request as it comes in.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    #[serde(rename = "do")]
    action: Option<Action>,
    set: Option<Wanted>,
}

/// What can be done at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// See [`Request::Start`].
    Start,
    /// See [`Request::Hold`].
    Hold,
    /// See [`Request::Resume`].
    Resume,
    /// See [`Request::Stop`].
    Stop,
    /// Torque off now.
    Estop,
    /// See [`Request::Release`].
    Release,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wanted {
    amplitude: Option<f64>,
    mirror: Option<bool>,
    idle: Option<IdleStyle>,
    style: Option<String>,
    seed: Option<u64>,
    time_s: Option<f64>,
}

/// A request that was understood.
#[derive(Clone, Debug, PartialEq)]
pub enum Understood {
    /// Press the emergency stop.
    EStop,
    /// For the control loop, in order.
    Requests(Vec<Request>),
}

/// Understands a request; `styles` are those that the model knows.
///
/// # Errors
/// One line for whoever asked: what is wrong, and the choices.
pub fn understand(json: &str, styles: &[String]) -> Result<Understood, String> {
    let text: Text = serde_json::from_str(json).map_err(|error| error.to_string())?;
    match (text.action, text.set) {
        (Some(Action::Estop), _) => Ok(Understood::EStop),
        (Some(action), None) => Ok(Understood::Requests(vec![match action {
            Action::Start => Request::Start,
            Action::Hold => Request::Hold,
            Action::Resume => Request::Resume,
            Action::Stop => Request::Stop,
            Action::Release | Action::Estop => Request::Release,
        }])),
        (None, Some(wanted)) => wanted.requests(styles).map(Understood::Requests),
        _ => Err("expected either \"do\" or \"set\"".into()),
    }
}

impl Wanted {
    fn requests(self, styles: &[String]) -> Result<Vec<Request>, String> {
        let mut requests = Vec::new();
        if let Some(amplitude) = self.amplitude {
            if !(0.0..=1.0).contains(&amplitude) {
                return Err(format!("amplitude is {amplitude}, expected 0 to 1"));
            }
            requests.push(Request::Amplitude(amplitude));
        }
        if let Some(style) = self.style {
            let place = styles.iter().position(|known| *known == style);
            let known = || format!("unknown style \"{style}\"; known: {}", styles.join(", "));
            requests.push(Request::Style(place.ok_or_else(known)?));
        }
        if let Some(time_s) = self.time_s {
            requests.push(Request::Seek(time_s));
        }
        requests.extend(self.mirror.map(Request::Mirror));
        requests.extend(self.idle.map(Request::Idle));
        requests.extend(self.seed.map(Request::Seed));
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
            (r#"{"do":"hold"}"#, vec![Request::Hold]),
            (
                r#"{"set":{"amplitude":0.5}}"#,
                vec![Request::Amplitude(0.5)],
            ),
            (
                r#"{"set":{"style":"salsa","mirror":true,"idle":"rest"}}"#,
                vec![
                    Request::Style(1),
                    Request::Mirror(true),
                    Request::Idle(IdleStyle::Rest),
                ],
            ),
        ] {
            let understood = understand(json, &styles());
            assert_eq!(understood, Ok(Understood::Requests(wanted)), "{json}");
        }
        let estop = understand(r#"{"do":"estop"}"#, &styles());
        assert_eq!(estop, Ok(Understood::EStop));
    }

    #[test]
    fn what_is_not_understood_is_said() {
        for (json, word) in [
            ("", "EOF"),
            ("[]", "expected"),
            ("{}", "either"),
            (r#"{"do":"jump"}"#, "jump"),
            (r#"{"do":"hold","set":{"seed":1}}"#, "either"),
            (r#"{"set":{}}"#, "nothing"),
            (r#"{"set":{"amplitude":1.5}}"#, "0 to 1"),
            (r#"{"set":{"amplitude":null,"speed":2}}"#, "speed"),
            (r#"{"set":{"style":"polka"}}"#, "hype, salsa"),
            (r#"{"set":{"seed":-1}}"#, "-1"),
            (r#"{"set":{"idle":"jump"}}"#, "sway"),
        ] {
            let error = understand(json, &styles()).unwrap_err();
            assert!(error.contains(word), "{json}: {error}");
        }
    }
}
