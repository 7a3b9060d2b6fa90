//! A pose as numbers: x, y, z in metres, then the quaternion x, y, z, w.

use servodance_retarget::nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

pub(crate) fn pose_array(pose: &Isometry3<f64>) -> [f64; 7] {
    let ([x, y, z], turn) = (pose.translation.vector.into(), pose.rotation.coords);
    [x, y, z, turn.x, turn.y, turn.z, turn.w]
}

pub(crate) fn pose_from_array([x, y, z, i, j, k, w]: [f64; 7]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}
