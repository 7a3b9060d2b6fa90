//! A joint as a line of text: position and target between the limits, angle and
//! temperature, and why it does not go where the dance would have it.
//!
//! ```text
//! head_pan    ·······┃●········   12.3°  36°  balance
//! ```

use crate::viewer::snapshot::JointStatus;
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use servodance_types::{HeldBack, JointLimits};

const NAME: usize = 16;
const FIGURES: usize = 13;
pub const NARROWEST: usize = NAME + FIGURES + 7;
const WIDEST: usize = NAME + FIGURES + 60;
/// The word for what holds a joint back, where there is room for it.
const REASON: usize = 11;
const ROOM_FOR_REASON: usize = NARROWEST + REASON;
const WARM_C: f64 = 55.0;
const HOT_C: f64 = 65.0;

/// Lines and columns for so many joints on a screen so wide, if there is room
/// for `lines` at most.
pub fn layout(joints: usize, width: usize, lines: usize) -> (usize, usize) {
    let most = (width / NARROWEST).max(1);
    let wanted = joints.div_ceil(lines.max(1)).clamp(1, most);
    (joints.div_ceil(wanted).min(lines), wanted)
}

/// A joint in `width` cells.
pub fn joint<'a>(name: &str, limits: &JointLimits, now: &JointStatus, width: usize) -> Line<'a> {
    let width = width.min(WIDEST);
    let reason = if width >= ROOM_FOR_REASON { REASON } else { 0 };
    let bar = width.saturating_sub(NAME + FIGURES + reason).max(1);
    let name: String = name.chars().take(NAME - 2).collect();
    let mut line = vec![Span::from(format!("{name:<0$}", NAME - 1))];
    line.extend(track(limits, now, bar));
    let degrees = now.position_rad.to_degrees();
    line.push(Span::from(format!(" {degrees:>6.1}° ")));
    line.push(heat(now.temperature_c));
    if reason > 0 {
        let word = if now.held == HeldBack::Nothing { "" } else { now.held.name() };
        line.push(Span::from(format!("  {word:<9}")).yellow());
    }
    Line::from(line)
}

fn track<'a>(limits: &JointLimits, now: &JointStatus, cells: usize) -> Vec<Span<'a>> {
    let place = |rad: f64| {
        let share = (rad - limits.lower_rad) / (limits.upper_rad - limits.lower_rad);
        // A position that is not known is no number, and stands at the left.
        (share.clamp(0.0, 1.0) * (cells - 1) as f64).round() as usize
    };
    let (position, target) = (place(now.position_rad), place(now.target_rad));
    let cell = |at: usize| match at {
        at if at == position => Span::from("●").light_blue(),
        at if at == target => Span::from("┃").dark_gray(),
        _ => Span::from("·").dark_gray(),
    };
    (0..cells).map(cell).collect()
}

fn heat<'a>(celsius: f64) -> Span<'a> {
    match celsius.is_finite() {
        false => Span::from("  –"),
        true => {
            let colour = match celsius {
                c if c >= HOT_C => Color::Red,
                c if c >= WARM_C => Color::Yellow,
                _ => Color::Reset,
            };
            Span::styled(format!("{celsius:>3.0}°"), Style::new().fg(colour))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(line: &Line) -> String {
        line.spans.iter().map(|span| &*span.content).collect()
    }

    #[test]
    fn a_joint_stands_where_it_is_between_its_limits() {
        let limits = JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.0,
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 1.0,
        };
        let at = |position_rad, target_rad, temperature_c| {
            let now =
                JointStatus { position_rad, target_rad, temperature_c, ..JointStatus::default() };
            text(&joint("elbow", &limits, &now, NAME + FIGURES + 11))
        };
        assert_eq!(at(0.0, 1.0, 36.4), "elbow          ·····●····┃    0.0°  36°");
        assert_eq!(at(-9.0, 0.0, f64::NAN), "elbow          ●····┃····· -515.7°   –");
        assert!(at(f64::NAN, f64::NAN, 70.0).ends_with("NaN°  70°"));
    }

    #[test]
    fn a_joint_that_is_held_back_says_why_where_there_is_room() {
        let limits = JointLimits {
            lower_rad: -1.0,
            upper_rad: 1.0,
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 1.0,
        };
        let now = JointStatus { held: HeldBack::Balance, ..JointStatus::default() };
        let wide = text(&joint("elbow", &limits, &now, ROOM_FOR_REASON));
        assert!(wide.trim_end().ends_with("–  balance"), "{wide}");
        assert!(wide.chars().count() <= ROOM_FOR_REASON, "{wide}");
        let narrow = text(&joint("elbow", &limits, &now, NARROWEST));
        assert!(narrow.ends_with('–'), "{narrow}");
    }

    #[test]
    fn more_joints_than_lines_stand_beside_each_other() {
        assert_eq!(layout(20, 80, 30), (20, 1));
        assert_eq!(layout(20, 80, 12), (10, 2));
        assert_eq!(layout(20, 40, 12), (12, 1), "no room for all");
        assert_eq!(layout(2, 10, 0), (0, 1));
    }
}
