"""Writes the pickles beside it: numbers of our own in the shape of AIST++ files."""
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
