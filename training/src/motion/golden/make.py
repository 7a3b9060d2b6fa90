"""Writes the files beside it: numbers of our own in the shape of AIST++ files,
and npz files in that of AMASS."""
import pickle
import numpy as np

poses = np.zeros((2, 72), np.float32)
poses[1, 16 * 3 + 2] = np.pi / 2
motion = {
    "smpl_poses": poses,
    "smpl_trans": np.array([[0, 90, 0], [180, 90, 0]], np.float64),
    "smpl_scaling": np.array([90.0], np.float32),
    "smpl_loss": 0.5,
}
pickle.dump(motion, open("aist.pkl", "wb"), protocol=4)
pickle.dump(motion, open("aist_protocol2.pkl", "wb"), protocol=2)
pickle.dump({"other": np.zeros(3, np.float32)}, open("aist_empty.pkl", "wb"))

# Upright with z up: the root turned by 90 degrees about x.
angles = np.zeros((2, 156))
angles[:, 0] = np.pi / 2
angles[1, 18 * 3 + 1] = np.pi / 2
rate = {"mocap_framerate": np.array(120.0), "gender": np.array("neutral")}
np.savez("smplh.npz", poses=angles, trans=np.zeros((2, 3)), **rate)
np.savez("smpl_wide.npz", poses=np.zeros((2, 99)), trans=np.zeros((2, 3)), **rate)
