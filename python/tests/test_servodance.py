"""The package against the command line, on the built-in song: `python -m unittest` in a
virtual environment with the wheel; SERVODANCE names the program."""

import csv
import os
import pathlib
import subprocess
import tempfile
import threading
import time
import unittest
import wave

import numpy as np
import servodance

PROGRAM = os.environ["SERVODANCE"]


def run(*arguments: object) -> str:
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=True)
    return done.stdout


class SameAsTheCommandLine(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        run("song", "--out", cls.path / "song.wav")
        with wave.open(str(cls.path / "song.wav")) as song:
            cls.sr = song.getframerate()
            samples = np.frombuffer(song.readframes(song.getnframes()), dtype="<i2")
            cls.audio = (samples.reshape(-1, song.getnchannels()).T / np.float32(32768)).astype(np.float32)

    @classmethod
    def tearDownClass(cls) -> None:
        cls.folder.cleanup()

    def generated(self) -> np.ndarray:
        run("generate", self.path / "song.wav", "--out", self.path / "motion.npz", "--seed", 3, "--quiet")
        return np.load(self.path / "motion.npz")["positions"]

    def test_beats(self) -> None:
        for causal in (False, True):
            option = ["--causal"] if causal else []
            lines = run("beats", self.path / "song.wav", *option).split()
            found = servodance.beats(self.audio, self.sr, causal=causal)
            self.assertGreater(len(found.times), 50)
            self.assertEqual([f"{beat:.4f}" for beat in found.times], lines)
        self.assertEqual(found.meter, 4)  # of the causal one, the last
        self.assertGreater(len(found.downbeats), 10)

    def test_motion_in_one_piece_and_in_blocks(self) -> None:
        expected = self.generated()
        whole = servodance.generate(self.audio, self.sr, seed=3)
        np.testing.assert_array_equal(whole, expected)
        stream = servodance.DanceStream(self.sr, seed=3)
        blocks = np.array_split(self.audio, 97, axis=1)
        parts = np.concatenate([stream.push(block) for block in blocks])
        np.testing.assert_array_equal(parts, expected)

    def test_joint_positions(self) -> None:
        motion = self.generated()
        run("retarget", self.path / "motion.npz", "--robot", "torso13", "--out", self.path / "joints.csv", "--quiet")
        with open(self.path / "joints.csv", newline="") as file:
            header, *rows = csv.reader(file)
        robot = servodance.Robot("torso13")
        joints, times = servodance.retarget(motion, 20, robot)
        self.assertEqual(header, ["time_s", *robot.joint_names])
        written = np.array(rows, dtype=float)
        self.assertEqual(joints.shape, written[:, 1:].shape)
        np.testing.assert_allclose(times, written[:, 0], atol=1e-4)
        np.testing.assert_allclose(joints, written[:, 1:], atol=1e-5)
        lower, upper = robot.limits[:, 0], robot.limits[:, 1]
        self.assertTrue(((joints >= lower - 1e-9) & (joints <= upper + 1e-9)).all())

    def test_joint_positions_frame_by_frame(self) -> None:
        motion = self.generated()[:100]
        stream = servodance.RetargetStream("neck")
        parts = np.concatenate([stream.push(pose) for pose in motion])
        self.assertGreater(len(parts), 300)
        self.assertGreater(np.ptp(parts, axis=0).max(), 0.1)


class Features(unittest.TestCase):
    def test_blocks_give_the_frames_of_the_whole(self) -> None:
        audio = np.random.default_rng(1).normal(0, 0.1, 44100).astype(np.float32)
        whole = servodance.features(audio, 22050)
        self.assertEqual(whole.values.shape[1], 39)
        stream = servodance.MusicStream(22050)
        parts = np.concatenate([stream.push(block).values for block in np.array_split(audio, 13)])
        np.testing.assert_array_equal(parts, whole.values)


class Refusals(unittest.TestCase):
    def test_what_is_wrong_is_named(self) -> None:
        silence = np.zeros(22050, dtype=np.float32)
        cases = [
            (servodance.Error, "op3", lambda: servodance.Robot("op4")),
            (servodance.Error, "hype", lambda: servodance.generate(silence, 22050, style="polka?")),
            (servodance.Error, "sample rate", lambda: servodance.beats(silence, 1)),
            (ValueError, "(T, 22, 3)", lambda: servodance.retarget(np.zeros((4, 21, 3)), 20, "neck")),
            (ValueError, "not finite", lambda: servodance.retarget(np.full((4, 22, 3), np.nan), 20, "neck")),
            (servodance.Error, "floor", lambda: servodance.SimBus("neck", world="moon").__enter__()),
            (servodance.Error, "with", lambda: servodance.SimBus("neck").port),
        ]
        for kind, words, call in cases:
            with self.subTest(words), self.assertRaises(kind) as raised:
                call()
            self.assertIn(words, str(raised.exception))


class Bus(unittest.TestCase):
    def test_another_program_finds_the_servos(self) -> None:
        with servodance.SimBus("neck") as bus:
            self.assertEqual(run("scan", bus.port, "--baud", "1000000").count("XM430"), 2)
        self.assertIn("limits broken: position 0", bus.summary)


class Lock(unittest.TestCase):
    def test_python_goes_on_while_a_dance_is_made(self) -> None:
        audio = np.zeros(30 * 22050, dtype=np.float32)
        worker = threading.Thread(target=servodance.generate, args=(audio, 22050))
        worker.start()
        ticks = 0
        while worker.is_alive():
            time.sleep(0.001)
            ticks += 1
        self.assertGreater(ticks, 20)


if __name__ == "__main__":
    unittest.main()
