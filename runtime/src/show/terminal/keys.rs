//! What each key asks for.

use crate::dance::IdleStyle;
use crate::show::{Request, Settings};
use clap::ValueEnum;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::time::{Duration, Instant};

/// A step of the amplitude.
const AMPLITUDE_STEP: f64 = 0.1;
/// Until then what was asked for may not be shown yet.
const UNDER_WAY: Duration = Duration::from_millis(300);

/// The keys, for the bottom of the screen.
pub const HELP: [&str; 2] = [
    "ENTER, ESC, SPACE emergency stop  s start  h hold  r resume  e end  q quit",
    "up/down amplitude  left/right style  n next seed  m mirror  i idle  x release",
];

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Meaning {
    /// Torque off now.
    EStop,
    /// End the program, as Ctrl-C does.
    Quit,
    /// As it is.
    Do(Request),
    /// Another value than the present one.
    Set(Change),
}

/// A change of one setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A step up.
    Louder,
    /// A step down.
    Softer,
    /// The style after this one.
    NextStyle,
    /// The style before this one.
    LastStyle,
    /// The seed after this one.
    NextSeed,
    /// The other way round.
    Mirror,
    /// The idle behaviour after this one.
    NextIdle,
}

/// What a key asks for, if anything.
pub fn meaning(key: KeyEvent) -> Option<Meaning> {
    use Meaning::{Do, EStop, Quit, Set};
    if key.kind == KeyEventKind::Release {
        return None;
    }
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return (key.code == KeyCode::Char('c')).then_some(Quit);
    }
    Some(match key.code {
        KeyCode::Enter | KeyCode::Esc | KeyCode::Char(' ') => EStop,
        KeyCode::Char('q') => Quit,
        KeyCode::Char('s') => Do(Request::Start),
        KeyCode::Char('h') => Do(Request::Hold),
        KeyCode::Char('r') => Do(Request::Resume),
        KeyCode::Char('e') => Do(Request::Stop),
        KeyCode::Char('x') => Do(Request::Release),
        KeyCode::Up => Set(Change::Louder),
        KeyCode::Down => Set(Change::Softer),
        KeyCode::Right => Set(Change::NextStyle),
        KeyCode::Left => Set(Change::LastStyle),
        KeyCode::Char('n') => Set(Change::NextSeed),
        KeyCode::Char('m') => Set(Change::Mirror),
        KeyCode::Char('i') => Set(Change::NextIdle),
        _ => return None,
    })
}

/// Turns changes into values, also of keys that come faster than the robot
/// shows what it took over.
#[derive(Debug)]
pub struct Keys {
    styles: usize,
    asked: Option<(Instant, Settings)>,
}

impl Keys {
    /// For so many styles.
    pub fn new(styles: usize) -> Self {
        let asked = None;
        Self { styles, asked }
    }

    /// The request that changes the present settings so.
    pub fn request(&mut self, change: Change, shown: Settings) -> Request {
        let fresh = self.asked.filter(|(at, _)| at.elapsed() < UNDER_WAY);
        let mut settings = fresh.map_or(shown, |(_, settings)| settings);
        let request = self.changed(change, settings);
        settings.take(request);
        self.asked = Some((Instant::now(), settings));
        request
    }

    fn changed(&self, change: Change, settings: Settings) -> Request {
        let amplitude = |step: f64| {
            let steps = (settings.amplitude / AMPLITUDE_STEP).round() + step;
            Request::Amplitude((steps * AMPLITUDE_STEP).clamp(0.0, 1.0))
        };
        let styles = self.styles.max(1);
        match change {
            Change::Louder => amplitude(1.0),
            Change::Softer => amplitude(-1.0),
            Change::NextStyle => Request::Style((settings.style + 1) % styles),
            Change::LastStyle => Request::Style((settings.style + styles - 1) % styles),
            Change::NextSeed => Request::Seed(settings.seed.wrapping_add(1)),
            Change::Mirror => Request::Mirror(!settings.mirror),
            Change::NextIdle => {
                let all = IdleStyle::value_variants();
                let place = all.iter().position(|idle| *idle == settings.idle);
                Request::Idle(all[(place.unwrap_or(0) + 1) % all.len()])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode) -> KeyEvent {
        KeyEvent::new(code, KeyModifiers::NONE)
    }

    #[test]
    fn the_keys_that_stop_are_those_of_the_page_and_enter() {
        for code in [KeyCode::Enter, KeyCode::Esc, KeyCode::Char(' ')] {
            assert_eq!(meaning(key(code)), Some(Meaning::EStop), "{code:?}");
        }
        let ctrl = |c| KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL);
        assert_eq!(meaning(ctrl('c')), Some(Meaning::Quit));
        assert_eq!(meaning(ctrl('h')), None);
        assert_eq!(meaning(key(KeyCode::Char('?'))), None);
    }

    #[test]
    fn every_letter_of_the_help_has_a_meaning() {
        for line in HELP {
            for item in line.split("  ") {
                let name = item.split(' ').next().unwrap_or_default();
                let mut letters = name.chars();
                if let (Some(letter), None) = (letters.next(), letters.next()) {
                    assert!(meaning(key(KeyCode::Char(letter))).is_some(), "{item}");
                }
            }
        }
    }

    #[test]
    fn keys_in_a_row_add_up_before_the_robot_shows_them() {
        let shown = Settings {
            amplitude: 0.95,
            mirror: false,
            idle: IdleStyle::Rest,
            style: 0,
            seed: u64::MAX,
        };
        let mut keys = Keys::new(3);
        let mut after = |change| keys.request(change, shown);
        assert_eq!(after(Change::Louder), Request::Amplitude(1.0));
        assert_eq!(after(Change::Softer), Request::Amplitude(0.9));
        assert_eq!(after(Change::Softer), Request::Amplitude(0.8));
        assert_eq!(after(Change::LastStyle), Request::Style(2));
        assert_eq!(after(Change::LastStyle), Request::Style(1));
        assert_eq!(after(Change::NextSeed), Request::Seed(0));
        assert_eq!(after(Change::NextIdle), Request::Idle(IdleStyle::Sway));
        assert_eq!(after(Change::Mirror), Request::Mirror(true));
        assert_eq!(after(Change::Mirror), Request::Mirror(false));
    }
}
