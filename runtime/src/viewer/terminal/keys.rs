//! The keys of the terminal view and the requests they make.

use crate::control::idle::IdleStyle;
use crate::viewer::{ViewerRequest, ViewerSettings};
use clap::ValueEnum;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use std::time::{Duration, Instant};

const AMPLITUDE_STEP: f64 = 0.1;
/// Until then what was asked for may not be shown yet.
const UNDER_WAY: Duration = Duration::from_millis(300);

pub const HELP: [&str; 2] = [
    "ENTER, ESC, SPACE emergency stop  s start  h hold  r resume  e end  q quit",
    "up/down amplitude  left/right style  n next seed  m mirror  i idle  x release  t tap",
];

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyAction {
    EStop,
    Quit,
    Do(ViewerRequest),
    Set(SettingChange),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SettingChange {
    Louder,
    Softer,
    NextStyle,
    LastStyle,
    NextSeed,
    Mirror,
    NextIdle,
}

pub fn key_action(key: KeyEvent) -> Option<KeyAction> {
    use KeyAction::{Do, EStop, Quit, Set};
    if key.kind == KeyEventKind::Release {
        return None;
    }
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return (key.code == KeyCode::Char('c')).then_some(Quit);
    }
    Some(match key.code {
        KeyCode::Enter | KeyCode::Esc | KeyCode::Char(' ') => EStop,
        KeyCode::Char('q') => Quit,
        KeyCode::Char('s') => Do(ViewerRequest::Start),
        KeyCode::Char('h') => Do(ViewerRequest::Hold),
        KeyCode::Char('r') => Do(ViewerRequest::Resume),
        KeyCode::Char('e') => Do(ViewerRequest::Stop),
        KeyCode::Char('x') => Do(ViewerRequest::Release),
        KeyCode::Char('t') => Do(ViewerRequest::Tap),
        KeyCode::Up => Set(SettingChange::Louder),
        KeyCode::Down => Set(SettingChange::Softer),
        KeyCode::Right => Set(SettingChange::NextStyle),
        KeyCode::Left => Set(SettingChange::LastStyle),
        KeyCode::Char('n') => Set(SettingChange::NextSeed),
        KeyCode::Char('m') => Set(SettingChange::Mirror),
        KeyCode::Char('i') => Set(SettingChange::NextIdle),
        _ => return None,
    })
}

/// Turns changes into values, also of keys that come faster than the robot
/// shows what it took over.
#[derive(Debug)]
pub struct SettingKeys {
    styles: usize,
    asked: Option<(Instant, ViewerSettings)>,
}

impl SettingKeys {
    pub fn new(styles: usize) -> Self {
        let asked = None;
        Self { styles, asked }
    }

    pub fn request(&mut self, change: SettingChange, shown: ViewerSettings) -> ViewerRequest {
        let fresh = self.asked.filter(|(at, _)| at.elapsed() < UNDER_WAY);
        let mut settings = fresh.map_or(shown, |(_, settings)| settings);
        let request = self.changed(change, settings);
        request.apply_to(&mut settings);
        self.asked = Some((Instant::now(), settings));
        request
    }

    fn changed(&self, change: SettingChange, settings: ViewerSettings) -> ViewerRequest {
        let amplitude = |step: f64| {
            let steps = (settings.amplitude / AMPLITUDE_STEP).round() + step;
            ViewerRequest::Amplitude((steps * AMPLITUDE_STEP).clamp(0.0, 1.0))
        };
        let styles = self.styles.max(1);
        match change {
            SettingChange::Louder => amplitude(1.0),
            SettingChange::Softer => amplitude(-1.0),
            SettingChange::NextStyle => ViewerRequest::Style((settings.style + 1) % styles),
            SettingChange::LastStyle => {
                ViewerRequest::Style((settings.style + styles - 1) % styles)
            }
            SettingChange::NextSeed => ViewerRequest::Seed(settings.seed.wrapping_add(1)),
            SettingChange::Mirror => ViewerRequest::Mirror(!settings.mirror),
            SettingChange::NextIdle => {
                let all = IdleStyle::value_variants();
                let place = all.iter().position(|idle| *idle == settings.idle);
                ViewerRequest::Idle(all[(place.unwrap_or(0) + 1) % all.len()])
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
            assert_eq!(key_action(key(code)), Some(KeyAction::EStop), "{code:?}");
        }
        let ctrl = |c| KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL);
        assert_eq!(key_action(ctrl('c')), Some(KeyAction::Quit));
        assert_eq!(key_action(ctrl('h')), None);
        assert_eq!(key_action(key(KeyCode::Char('?'))), None);
    }

    #[test]
    fn every_letter_of_the_help_has_a_meaning() {
        for line in HELP {
            for item in line.split("  ") {
                let name = item.split(' ').next().unwrap_or_default();
                let mut letters = name.chars();
                if let (Some(letter), None) = (letters.next(), letters.next()) {
                    assert!(key_action(key(KeyCode::Char(letter))).is_some(), "{item}");
                }
            }
        }
    }

    #[test]
    fn keys_in_a_row_add_up_before_the_robot_shows_them() {
        let shown = ViewerSettings {
            amplitude: 0.95,
            mirror: false,
            idle: IdleStyle::Rest,
            style: 0,
            seed: u64::MAX,
        };
        let mut keys = SettingKeys::new(3);
        let mut after = |change| keys.request(change, shown);
        assert_eq!(after(SettingChange::Louder), ViewerRequest::Amplitude(1.0));
        assert_eq!(after(SettingChange::Softer), ViewerRequest::Amplitude(0.9));
        assert_eq!(after(SettingChange::Softer), ViewerRequest::Amplitude(0.8));
        assert_eq!(after(SettingChange::LastStyle), ViewerRequest::Style(2));
        assert_eq!(after(SettingChange::LastStyle), ViewerRequest::Style(1));
        assert_eq!(after(SettingChange::NextSeed), ViewerRequest::Seed(0));
        assert_eq!(after(SettingChange::NextIdle), ViewerRequest::Idle(IdleStyle::Sway));
        assert_eq!(after(SettingChange::Mirror), ViewerRequest::Mirror(true));
        assert_eq!(after(SettingChange::Mirror), ViewerRequest::Mirror(false));
    }
}
