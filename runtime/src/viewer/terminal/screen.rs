//! The layout of the screen: figures, joints, events, keys.
//!
//! Seventeen lines of eighty cells hold all that matters; more room shows more
//! joints and events, less room leaves the last out.

use super::joints::{joint, layout};
use super::keys::HELP;
use crate::pipeline::step_times::StepTimes;
use crate::process::console;
use crate::viewer::Scene;
use crate::viewer::snapshot::{
    Activity, MusicStatus, RobotStatus, Snapshot, ViewerEvent, state_name,
};
use clap::ValueEnum;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use servodance_drivers::{BusStats, State};
use servodance_types::BeatLock;
use std::time::{Duration, Instant};

const PHASE: usize = 16;
/// Lines for events at least, if there is room for joints and them.
const EVENTS: usize = 3;
const REMARK: Duration = Duration::from_secs(4);
/// Surer than this that it is music.
const MUSIC: f64 = 0.45;
/// Part of the wanted rate below which the bus is slow.
const SLOW: f64 = 0.95;
/// Parts of a period: a gap between commands, and what the link adds to answers.
const UNEVEN: f64 = 1.5;
const LATE: f64 = 0.5;
const LEVELS: [&str; 9] = [" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];

#[derive(Debug, Default)]
pub struct Remark(Option<(Instant, String)>);

impl Remark {
    pub fn new(text: String) -> Self {
        Self(Some((Instant::now(), text)))
    }

    fn text(&self) -> Option<&str> {
        let (said, text) = self.0.as_ref()?;
        (said.elapsed() < REMARK).then_some(text)
    }
}

pub fn draw(
    frame: &mut Frame,
    scene: &Scene,
    now: &Snapshot,
    pressed: bool,
    remark: &Remark,
    address: Option<&str>,
) {
    let area = frame.area();
    let (width, height) = (usize::from(area.width), usize::from(area.height));
    let mut lines = vec![
        title(scene, &now.now, pressed),
        music(&now.now.music),
        settings(scene, &now.now),
        bus(scene, &now.now),
        safety(&now.now),
        answers(scene, now),
    ];
    let mut last: Vec<Line> = HELP.map(|help| Line::from(help).dark_gray()).to_vec();
    last.extend(address.map(|address| Line::from(address.to_owned()).dark_gray()));
    last.insert(0, said(remark));
    let room = height.saturating_sub(lines.len() + last.len());
    lines.extend(joints(scene, now, width, room.saturating_sub(EVENTS)));
    let room = height.saturating_sub(lines.len() + last.len());
    lines.extend(now.events().iter().rev().take(room).map(event));
    lines.resize(height.saturating_sub(last.len()), Line::default());
    lines.append(&mut last);
    for (row, line) in (0..area.height).zip(&lines) {
        let row = Rect::new(area.x, area.y + row, area.width, 1);
        frame.render_widget(line, row);
    }
}

fn badge<'a>(text: String, colour: Color) -> Span<'a> {
    Span::styled(format!(" {text} "), Style::new().fg(Color::Black).bg(colour)).bold()
}

fn title<'a>(scene: &Scene, now: &RobotStatus, pressed: bool) -> Line<'a> {
    let activity = match now.activity {
        Activity::Dancing => Color::Green,
        _ => Color::Yellow,
    };
    let (safety, colour) = match now.safety {
        _ if pressed => ("EMERGENCY STOP", Color::Red),
        State::Fault => ("fault", Color::Red),
        State::Running if !now.hold => ("running", Color::Green),
        State::Running => ("holding", Color::Yellow),
        other => (state_name(other), Color::Yellow),
    };
    Line::from(vec![
        Span::from("servodance ").bold(),
        Span::from(format!("{} ", scene.robot)),
        badge(now.activity.name().into(), activity),
        Span::from(" "),
        badge(safety.into(), colour),
        Span::from(format!("  music {:.1} s   torque on for {:.0} s", now.music_s, now.robot_s)),
    ])
}

fn music<'a>(music: &MusicStatus) -> Line<'a> {
    let heard = music.lock != BeatLock::Lost && music.tempo_bpm > 0.0;
    let tempo = match heard {
        true => format!("{:>3.0} BPM", music.tempo_bpm),
        false => "  – BPM".into(),
    };
    let lock = match music.lock {
        BeatLock::Lost => "no beat",
        BeatLock::Locked => "locked",
        BeatLock::Holding => "carried on",
        BeatLock::Changing => "changing",
    };
    let beat = (music.phase.clamp(0.0, 1.0) * PHASE as f64) as usize;
    let phase = (0..PHASE).map(|cell| if heard && cell <= beat { "━" } else { "─" });
    let bar = match (heard, music.place, music.meter) {
        (true, Some(place), Some(meter)) => format!("{place}/{meter}"),
        _ => "–/–".into(),
    };
    let level = |band: &f32| LEVELS[(band.clamp(0.0, 1.0) * 8.0).round() as usize];
    let spectrum: String = music.bands.iter().map(level).collect();
    let presence = match music.presence > MUSIC {
        true => "music",
        false => "no music",
    };
    Line::from(vec![
        Span::from(format!("{tempo} {lock:<10} {bar} ")),
        Span::from(phase.collect::<String>()).yellow(),
        Span::from(" "),
        Span::from(spectrum).light_blue(),
        Span::from(format!(" {presence}")),
    ])
}

fn settings<'a>(scene: &Scene, now: &RobotStatus) -> Line<'a> {
    let wanted = &now.settings;
    let style = scene.styles.get(wanted.style).map_or("–", String::as_str);
    let idle = wanted.idle.to_possible_value();
    let idle = idle.map_or_else(String::new, |idle| idle.get_name().to_owned());
    let percent = |share: f64| (share * 100.0).round();
    let moving = match percent(now.amplitude) == percent(wanted.amplitude) {
        true => String::new(),
        false => format!(" (now {} %)", percent(now.amplitude)),
    };
    Line::from(format!(
        "amplitude {} %{moving}   style {style}   seed {}   mirror {}   without music {idle}",
        percent(wanted.amplitude),
        wanted.seed,
        if wanted.mirror { "on" } else { "off" },
    ))
}

/// A figure that is worth a colour if `bad`.
fn figure<'a>(text: String, bad: bool) -> Span<'a> {
    let colour = if bad { Color::Yellow } else { Color::Reset };
    Span::styled(text, Style::new().fg(colour))
}

fn bus<'a>(scene: &Scene, now: &RobotStatus) -> Line<'a> {
    let slow = now.rate_hz < SLOW * scene.control_hz;
    let period_ms = 1e3 / scene.control_hz;
    let delay_ms = now.bus.delay_us as f64 * 1e-3;
    let StepTimes { p50_ms, p99_ms, max_ms } = now.gaps;
    Line::from(vec![
        figure(format!("bus {:.1} / {} Hz", now.rate_hz, scene.control_hz), slow),
        figure(format!("  commands {p50_ms:.1}"), false),
        figure(format!(", p99 {p99_ms:.1}"), p99_ms > UNEVEN * period_ms),
        figure(format!(", worst {max_ms:.1} ms apart"), max_ms > 2.0 * period_ms),
        figure(format!("  delay {delay_ms:.1} ms"), delay_ms > LATE * period_ms),
    ])
}

fn safety<'a>(now: &RobotStatus) -> Line<'a> {
    let broken = match now.violations {
        Some(count) => count.to_string(),
        None => "not judged".into(),
    };
    Line::from(vec![
        Span::from(format!("commands limited {}", now.interventions)),
        figure(format!("   limits broken {broken}"), now.violations > Some(0)),
        Span::from(format!("   idle {:.0} %", now.idle_share * 100.0)),
        figure(format!("   late motion {}", now.late_frames), now.late_frames > 0),
    ])
}

/// Answers that went wrong, and the servo with which most did.
fn answers<'a>(scene: &Scene, now: &Snapshot) -> Line<'a> {
    let BusStats { timeouts, crc_errors, retries, .. } = now.now.bus;
    let mut line = vec![
        figure(format!("answers late or lost {timeouts}"), timeouts > 0),
        figure(format!("   damaged {crc_errors}"), crc_errors > 0),
        figure(format!("   asked again {retries}"), retries > 0),
    ];
    let servos = scene.joints.iter().zip(&now.joints).filter(|(_, joint)| joint.errors.lost() > 0);
    if let Some(((name, _), joint)) = servos.max_by_key(|(_, joint)| joint.errors.lost()) {
        line.push(figure(format!("   most: {name} {}", joint.errors.lost()), true));
    }
    Line::from(line)
}

/// The joints in as many columns as need be, in `room` lines at most.
fn joints<'a>(scene: &Scene, now: &Snapshot, width: usize, room: usize) -> Vec<Line<'a>> {
    let (lines, columns) = layout(scene.joints.len(), width, room);
    let cells = (width / columns).saturating_sub(2);
    let mut beside = vec![Line::default(); lines];
    let all = scene.joints.iter().zip(&now.joints);
    for (place, ((name, limits), now)) in all.enumerate().take(lines * columns) {
        let row = &mut beside[place % lines];
        if place >= lines {
            row.push_span("  ");
        }
        row.spans.extend(joint(name, limits, now, cells).spans);
    }
    beside
}

fn event<'a>(event: &ViewerEvent) -> Line<'a> {
    let colour = match event.state {
        "fault" | "error" => Color::Red,
        _ => Color::Reset,
    };
    let when = match event.time_s.is_finite() {
        true => format!("{:>8.2} s ", event.time_s),
        false => " ".repeat(11),
    };
    let text = format!("{when}{}: {}", event.state, event.cause);
    Line::styled(text, Style::new().fg(colour))
}

fn said<'a>(remark: &Remark) -> Line<'a> {
    match remark.text() {
        Some(text) => Line::from(text.to_owned()).light_red(),
        None => Line::from(console::newest(1).pop().unwrap_or_default()).cyan(),
    }
}
