//! Robots, and human motion turned into their joint positions.

use crate::{error, table};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use servodance_model::motion::{Clip, Pose};
use servodance_retarget::{DraftOptions, Retargeter};
use servodance_runtime::offline::generate::trial_dances;
use servodance_runtime::offline::motion_tracking::track_motion;
use servodance_runtime::robot;
use servodance_training::choreography::trial_dance;
use servodance_types::{Contacts, FRAME_RATE_HZ, JOINT_COUNT, MotionFrame};
use std::path::PathBuf;

#[pyfunction]
pub fn built_in_robots() -> Vec<&'static str> {
    robot::names()
}

/// A robot: its description, servos and limits.
#[pyclass(frozen)]
pub struct Robot {
    pub(crate) robot: robot::Robot,
}

#[pymethods]
impl Robot {
    #[new]
    fn load(name_or_file: &str) -> PyResult<Self> {
        Ok(Self { robot: robot::Robot::load(name_or_file).map_err(error)? })
    }

    #[staticmethod]
    fn from_description(py: Python<'_>, description: PathBuf, out: PathBuf) -> PyResult<Self> {
        py.detach(|| {
            let dances = trial_dances().map_err(error)?;
            robot::new_robot(
                &description,
                &out,
                true,
                DraftOptions::default(),
                &trial_dance(),
                &dances,
            )
            .map_err(error)?;
            Self::load(&out.to_string_lossy())
        })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.robot.name
    }

    #[getter]
    fn control_hz(&self) -> f64 {
        self.robot.control_hz
    }

    #[getter]
    fn urdf(&self) -> &str {
        &self.robot.urdf_xml
    }

    #[getter]
    fn joint_names(&self) -> Vec<&str> {
        self.robot.servos.iter().map(|servo| servo.name.as_str()).collect()
    }

    /// Lower, upper, velocity and acceleration limit of each joint.
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let row = |limits: servodance_types::JointLimits| {
            let range = [limits.lower_rad, limits.upper_rad];
            let [lower, upper] = range;
            [lower, upper, limits.velocity_rad_s, limits.acceleration_rad_s2]
        };
        table(py, self.robot.servos.iter().flat_map(|servo| row(servo.limits)).collect(), 4)
    }

    fn rest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let retargeter = self.robot.retargeter().map_err(error)?;
        Ok(PyArray1::from_slice(py, retargeter.rest()))
    }
}

/// Times and joint positions.
type Commands<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

#[pyfunction]
pub fn retarget<'py>(
    py: Python<'py>,
    positions: PyReadonlyArray3<'py, f32>,
    fps: f64,
    robot: &Robot,
) -> PyResult<Commands<'py>> {
    let poses = positions.as_slice()?.chunks_exact(3 * JOINT_COUNT).map(pose).collect();
    let robot = &robot.robot;
    let (mut times, mut joints) = (Vec::new(), Vec::new());
    py.detach(|| {
        // As a file's motion: its skeleton fitted, on the floor, at the origin.
        let clip = Clip { fps, ..Clip::of_frames(poses) }.normalised();
        track_motion(robot, &clip.frames(), |time_s, positions_rad| {
            times.push(time_s);
            joints.extend_from_slice(positions_rad);
            Ok(())
        })
    })
    .map_err(error)?;
    Ok((PyArray1::from_vec(py, times), table(py, joints, robot.servos.len())?))
}

/// The retargeter frame by frame: 20 poses a second in, joint positions out.
#[pyclass]
pub struct RetargetStream {
    retargeter: Retargeter,
    period_s: f64,
    joints: usize,
    frames: u64,
    cycles: u64,
}

#[pymethods]
impl RetargetStream {
    #[new]
    fn new(robot: &Robot) -> PyResult<Self> {
        let robot = &robot.robot;
        Ok(Self {
            retargeter: robot.retargeter().map_err(error)?,
            period_s: robot.period_s(),
            joints: robot.servos.len(),
            frames: 0,
            cycles: 0,
        })
    }

    #[getter]
    fn lookahead_s(&self) -> f64 {
        self.retargeter.lookahead_s()
    }

    /// Takes a pose; gives the positions of every cycle that it completes.
    fn push<'py>(
        &mut self,
        py: Python<'py>,
        positions: PyReadonlyArray2<'py, f32>,
        contacts: (bool, bool),
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let time_s = self.frames as f64 / FRAME_RATE_HZ;
        let contacts = Contacts { left: contacts.0, right: contacts.1 };
        let positions = pose(positions.as_slice()?);
        self.retargeter.push(&MotionFrame { time_s, positions, contacts });
        self.frames += 1;
        // A cycle sees the frames up to its look-ahead, as in `retarget`.
        let next_s = self.frames as f64 / FRAME_RATE_HZ - self.retargeter.lookahead_s();
        let mut out = Vec::new();
        let mut targets = vec![0.0; self.joints];
        while (self.cycles as f64 * self.period_s) < next_s {
            let now_s = self.cycles as f64 * self.period_s;
            self.retargeter.next(now_s, &mut targets).map_err(error)?;
            out.extend_from_slice(&targets);
            self.cycles += 1;
        }
        table(py, out, self.joints)
    }
}

fn pose(values: &[f32]) -> Pose {
    std::array::from_fn(|joint| std::array::from_fn(|axis| values[3 * joint + axis]))
}
