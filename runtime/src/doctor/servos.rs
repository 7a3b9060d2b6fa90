//! The servos of a robot, asked: whether each answers, and what another program left.

use super::Finding;
use crate::bus_tools::plug;
use crate::robot::Robot;
use servodance_drivers::serial::Remedy;
use servodance_drivers::{Bus, BusError, BusResult, Port, ServoDeviation, open_buses};

/// Asks every servo of `robot` on these ports. Nothing is written, no torque changes.
pub fn servos(robot: &Robot, given: &[String]) -> anyhow::Result<Vec<Finding>> {
    let ports = plug::ports(robot, given)?;
    if robot.buses.iter().any(|bus| bus.config.kind.is_can()) {
        return Ok(vec![Finding::warning(
            "servos",
            "motors on CAN were not asked: some answer only what takes their torque",
            "hold the robot and use `servodance ping PORT --robot FILE`",
        )]);
    }
    Ok(match look(robot, &ports) {
        Ok((deviations, refused)) if deviations.is_empty() && refused.is_empty() => {
            let what = format!("all {} answer, and are as they should be", robot.servos.len());
            vec![Finding::good("servos", what)]
        }
        Ok((deviations, refused)) => {
            let remedy = "put it right: `servodance servos write`, or the robot file";
            let unfit = |error: &BusError| Finding::bad("servos", error.to_string(), remedy);
            let deviations = deviations.iter().map(|found| finding(robot, found));
            deviations.chain(refused.iter().map(unfit)).collect()
        }
        Err(error) => vec![Finding::bad(
            "servos",
            error.to_string(),
            "`servodance scan PORT` tells who answers, and at which rate",
        )],
    })
}

fn look(robot: &Robot, ports: &[Port]) -> BusResult<(Vec<ServoDeviation>, Vec<BusError>)> {
    let mut bus = open_buses(ports, &robot.buses, &robot.servos)?;
    bus.observe()?;
    Ok((bus.deviations()?, bus.refused()?))
}

fn finding(robot: &Robot, found: &ServoDeviation) -> Finding {
    let servo = &robot.servos[found.index];
    let what = format!("{} (id {}): {}", servo.name, servo.id, found.deviation.line());
    match found.deviation.remedy {
        Remedy::Refuse => Finding::bad("servos", what, "`servodance calibrate`, holding the robot"),
        Remedy::Write(_) => {
            let remedy = "arming puts it right; so does `servodance servos check --fix`";
            Finding::warning("servos", what, remedy)
        }
        Remedy::Tell => Finding::warning("servos", what, "leave it if it is meant"),
    }
}
