//! Serving a robot's simulated servos to other programs.

use crate::bus_tools::sim_link::{LinkChoice, sim_link};
use crate::process::console::stderr_line;
use crate::process::wrong_usage::misused;
use crate::robot::Robot;
use crate::world::{BodyReport, RobotWorld, WorldChoice};
use servodance_sim::{
    Happening, ServoFault, SimBus, SimLink, SimOptions, SimServoSpec, Violations, WireStats,
    happen, parse_happening, parse_script,
};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Options of `servodance sim-bus`.
#[derive(Clone, Copy, Debug, Default)]
pub struct SimBusOptions<'a> {
    /// What other programs open; the usual kind of the bus if left out.
    pub link: Option<LinkChoice>,
    /// Faults to inject, a line each (sim/reference/faults.md).
    pub faults: &'a str,
    /// Whether gears have the play that their vendor states.
    pub backlash: bool,
    /// The world that the servos carry the robot in.
    pub world: WorldChoice,
    /// Whether the servos are as they come out of the box, none of them plugged in. What
    /// somebody types then happens: `plug JOINT`, `unplug JOINT`, `new JOINT`, and other faults
    /// without their time.
    pub new_servos: bool,
}

/// Serves the robot's servos in real time until `stop` is set; `ready` gets
/// the serial port to open, `NAME=PORT` for each bus where there are several.
/// Returns one line about what was seen.
pub fn serve(
    robot: &Robot,
    options: SimBusOptions<'_>,
    stop: &AtomicBool,
    ready: impl Fn(&str),
) -> anyhow::Result<String> {
    if options.new_servos {
        refuse_new_servos(robot, options.link)?;
    }
    let names: Vec<&str> = robot.servos.iter().map(|s| s.name.as_str()).collect();
    let cues = parse_script(options.faults, &names)?;
    // An adapter that comes back is to be found where it was.
    let pluggable = cues.iter().any(|cue| matches!(cue.what, Happening::Adapter(_)));
    let mut cues = cues.into_iter().peekable();
    let joints: Vec<Vec<usize>> = robot.buses.iter().map(|bus| bus.joints.clone()).collect();
    let began = Instant::now();
    let mut sims = Vec::with_capacity(robot.buses.len());
    let world = RobotWorld::open(robot, options.world)?;
    for (place, bus) in robot.buses.iter().enumerate() {
        let specs = bus.servos.iter().map(SimServoSpec::from);
        let specs: Vec<SimServoSpec> = match options.backlash {
            true => specs.map(SimServoSpec::with_stated_backlash).collect(),
            false => specs.collect(),
        };
        let specs = match &world {
            Some(world) => world.placed(specs, bus),
            None => specs,
        };
        let link = sim_link(&bus.config, options.link, place)?;
        // A socket in a file can be opened by anybody.
        let has_path = pluggable || link == SimLink::Unix;
        let sim_options = SimOptions {
            link,
            path: has_path.then(|| {
                let name = format!("servodance-{}-{place}", std::process::id());
                std::env::temp_dir().join(name)
            }),
            seat: world.as_ref().map(|world| world.seat(bus)),
            imu: bus.config.imu.clone(),
            ..SimOptions::realtime(bus.config.baud, robot.control_hz)
        };
        let sim = SimBus::start(&specs, sim_options)?;
        if options.new_servos {
            take_out_of_the_box(&sim, bus.servos.len());
        }
        sims.push(sim);
    }
    let typed = options.new_servos.then(typed_lines);
    for (bus, sim) in robot.buses.iter().zip(&sims) {
        match bus.config.name.as_str() {
            "" => ready(sim.port_path()),
            name => ready(&format!("{name}={}", sim.port_path())),
        }
    }
    while !stop.load(Ordering::Acquire) {
        let now_s = began.elapsed().as_secs_f64();
        while let Some(cue) = cues.next_if(|cue| cue.time_s <= now_s) {
            happen(&cue.what, &mut sims, &joints)?;
        }
        for line in typed.iter().flat_map(Receiver::try_iter) {
            match parse_happening(&line, &names) {
                Ok(what) => happen(&what, &mut sims, &joints)?,
                Err(error) => stderr_line!("{error}"),
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let body = world.map(|world| {
        BodyReport::new(world.choice(), &world.shared.figures(), None, Default::default()).line()
    });
    Ok([Some(summary(&sims)), body].into_iter().flatten().collect::<Vec<_>>().join("\n"))
}

/// New servos have a rate of their own, which a socket has not, and CAN motors no way out of
/// the box.
fn refuse_new_servos(robot: &Robot, link: Option<LinkChoice>) -> anyhow::Result<()> {
    if link == Some(LinkChoice::Unix) {
        misused!(
            "--new-servos needs --link pty: a socket has no rate, and new servos have their own"
        );
    }
    match robot.buses.iter().find(|bus| bus.config.kind.is_can()) {
        Some(_) => misused!("--new-servos is for serial servos; {} has motors on CAN", robot.name),
        None => Ok(()),
    }
}

/// Id 1 and the factory's rate; nobody is plugged in yet.
fn take_out_of_the_box(sim: &SimBus, servos: usize) {
    for index in 0..servos {
        sim.set_servo_fault(index, ServoFault::New);
        sim.set_servo_fault(index, ServoFault::Unplug);
    }
}

/// The lines that somebody types, as they come; none any more after the end of input.
fn typed_lines() -> Receiver<String> {
    let (line, lines) = channel();
    std::thread::spawn(move || {
        for typed in std::io::stdin().lines().map_while(Result::ok) {
            if !typed.trim().is_empty() && line.send(typed).is_err() {
                return;
            }
        }
    });
    lines
}

/// One line about what passed and what was broken.
fn summary(sims: &[SimBus]) -> String {
    let mut wire = WireStats::default();
    let (mut broken, mut moved) = (Violations::default(), Violations::default());
    for sim in sims {
        wire += sim.wire_stats();
        broken += sim.violations();
        moved += sim.motion_violations();
    }
    let WireStats { packets_in, packets_out, bad_packets, .. } = wire;
    let Violations { position, velocity, acceleration, .. } = broken;
    let mut line = format!(
        "{packets_in} packets in, {packets_out} out, {bad_packets} bad; limits broken: \
         position {position}, velocity {velocity}, acceleration {acceleration}"
    );
    if let Some(first) = sims.iter().find_map(|sim| sim.violation_notes().into_iter().next()) {
        line += &format!(
            " ({} by what was told, {} by the motion; one of them: {first})",
            broken.total() - moved.total(),
            moved.total()
        );
    }
    line
}
