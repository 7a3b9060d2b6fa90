//! A pose as numbers: x, y, z in metres, then the quaternion x, y, z, w.

use servodance_retarget::nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion,
};
use servodance_types::Placement;

pub(crate) fn pose_array(pose: &Isometry3<f64>) -> [f64; 7] {
    let ([x, y, z], turn) = (pose.translation.vector.into(), pose.rotation.coords);
    [x, y, z, turn.x, turn.y, turn.z, turn.w]
}

/// A placement by rows as a pose.
pub(crate) fn pose_of(placement: &Placement) -> Isometry3<f64> {
    let rows = Matrix3::from_fn(|row, column| placement.rotation[row][column]);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    Isometry3::from_parts(Translation3::from(placement.at_m), turn)
}

pub(crate) fn pose_from_array([x, y, z, i, j, k, w]: [f64; 7]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}
