//! Inverse kinematics of the whole body.

mod arm_search;
mod body_solver;
mod least_squares;
mod limb_task;
mod searched_arm;

pub(crate) use arm_search::ArmSearch;
pub(crate) use body_solver::{BodySolver, Feet, SolverGoal, SolverInput, SolverScope};
pub(crate) use least_squares::{BoxLeastSquares, JacobianColumn};
pub(crate) use limb_task::{LimbTask, capped, direction_row};
