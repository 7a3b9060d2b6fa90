//! A robot's links as guesses look at them: names, places and what hangs below what.

use k::nalgebra::{Isometry3, Point3};

use super::words::NameWords;
use crate::kinematics::RobotModel;

/// Reads the corners of a mesh by its name in the description; none where it cannot.
pub type MeshReader<'a> = dyn Fn(&str) -> Vec<[f64; 3]> + 'a;

/// For descriptions whose meshes nobody can read.
pub fn no_meshes(_name: &str) -> Vec<[f64; 3]> {
    Vec::new()
}

pub(super) struct LinkTree<'a> {
    pub model: &'a RobotModel,
    pub words: &'a [NameWords],
    pub poses: &'a [Isometry3<f64>],
    pub children: &'a [Vec<usize>],
    pub meshes: &'a MeshReader<'a>,
}

impl LinkTree<'_> {
    pub fn at(&self, link: usize) -> Point3<f64> {
        Point3::from(self.poses[link].translation.vector)
    }
}
