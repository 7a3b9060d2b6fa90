//! What happens when a servo stops answering in the middle of a dance, for each
//! policy of the safety layer (`safety.on_servo_lost` of the robot file).
//!
//! ```text
//! cargo run --release -p servodance-runtime --example servo_timeout
//! ```

use servodance_audio::song::Song;
use servodance_drivers::ServoLost;
use servodance_model::Generator;
use servodance_runtime::process::console::stdout_line;
use servodance_runtime::robot::Robot;
use servodance_runtime::session::fault_run::FaultRun;
use servodance_sim::parse_script;

fn main() -> anyhow::Result<()> {
    let mut robot = Robot::load("neck")?;
    let joint = robot.servos[0].name.clone();
    let generator = Generator::built_in()?;
    let mut song = Song::demo();
    song.samples.truncate(6 * song.sample_rate_hz as usize);
    for policy in [ServoLost::Stop, ServoLost::Hold, ServoLost::DanceOn] {
        robot.safety.on_servo_lost = policy;
        // Torque on at 0 s, music from 4 s on.
        let script = format!("6s {joint} dead");
        let run = FaultRun {
            faults: parse_script(&script, &[&joint])?,
            ..FaultRun::new(&robot, &generator, song.clone())
        };
        let result = run.run(&false.into(), |_| ())?;
        let ending = result.stopped_by.as_deref().unwrap_or("danced on");
        stdout_line!("{policy:?} after {:.1} s: {ending}", result.robot_s);
    }
    Ok(())
}
