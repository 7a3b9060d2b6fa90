//! A register of a servo that does not hold what the robot file and the vendor say: left
//! behind by another program, and dangerous or merely odd.

use crate::serial::register::Register;

/// What is done about a deviation before torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Remedy {
    /// This value is written and read back.
    Write(u64),
    /// It may be meant: it is told.
    Tell,
    /// No torque before somebody has looked.
    Refuse,
}

/// A register that holds something else than expected.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Deviation {
    /// The register.
    pub register: Register,
    /// What it holds, in its own units.
    pub actual: i64,
    /// What was expected, in words.
    pub wanted: String,
    /// What it means for the robot.
    pub why: &'static str,
    /// What is done about it.
    pub remedy: Remedy,
}

impl Deviation {
    /// A register that is written with the value that it should have.
    pub(crate) fn write(register: Register, actual: u64, wanted: u64, why: &'static str) -> Self {
        let remedy = Remedy::Write(wanted);
        Self { register, actual: actual as i64, wanted: wanted.to_string(), why, remedy }
    }

    /// An offset of the angle, ticks, that is not the robot file's.
    pub(crate) fn shifted(register: Register, actual: i32, wanted: i32) -> Self {
        Self {
            register,
            actual: i64::from(actual),
            wanted: wanted.to_string(),
            why: "every angle is shifted by it; `servodance calibrate` measures the zeros anew",
            remedy: Remedy::Refuse,
        }
    }

    /// In one line: the register, both values, what it means.
    pub fn line(&self) -> String {
        let Self { register, actual, wanted, why, .. } = self;
        format!("{} is {actual}, {wanted} is expected: {why}", register.name)
    }
}

/// A deviation and the place of its servo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServoDeviation {
    /// The servo's place on the robot.
    pub index: usize,
    /// What deviates.
    pub deviation: Deviation,
}
