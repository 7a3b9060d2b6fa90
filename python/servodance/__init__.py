"""A robot hears music and dances to it: beats, dances, retargeting and a simulated servo bus.

Sound is a numpy array of samples between -1 and 1: ``(n,)``, or ``(channels, n)`` as librosa
gives it. Motion is ``(T, 22, 3)``, metres, y up, 20 frames a second unless said otherwise, in the
joint order of SMPL. Joint positions are radians. Everything equals what the command line gives
for the same input and seed, to the bit. Errors are :class:`Error` with the command line's words.
Native work releases the interpreter's lock.

    >>> import numpy as np, servodance
    >>> audio = np.zeros(22050, dtype=np.float32)
    >>> servodance.beats(audio, 22050).times
    array([], dtype=float64)
"""

from __future__ import annotations

import os
import pathlib
import tempfile
from dataclasses import dataclass
from typing import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _servodance as _native
from ._servodance import Error, __version__

__all__ = [
    "Beats", "DanceStream", "Error", "Features", "MusicStream", "RetargetStream", "Robot", "SimBus",
    "__version__", "beats", "features", "generate", "retarget", "robots", "styles",
]

#: Frames a second of features and of generated motion.
FRAME_RATE_HZ = 20.0
_LOCKS = ("lost", "holding", "locked", "changing")


def _mono(audio: ArrayLike) -> NDArray[np.float32]:
    samples = np.asarray(audio)
    if samples.dtype.kind not in "fi":
        raise TypeError(f"audio is {samples.dtype}; samples are float, -1 to 1, or signed integers")
    if samples.dtype.kind == "i":
        samples = samples.astype(np.float32) / -float(np.iinfo(samples.dtype).min)
    if samples.ndim == 2:
        if samples.shape[0] > samples.shape[1]:
            raise ValueError(f"audio has the shape {samples.shape}; channels come first: (channels, n)")
        samples = samples.astype(np.float32).mean(axis=0)
    if samples.ndim != 1:
        raise ValueError(f"audio has the shape {samples.shape}; give (n,) or (channels, n)")
    return np.ascontiguousarray(samples, dtype=np.float32)


def _rate(sr: float) -> int:
    if sr != int(sr):
        raise ValueError(f"sr is {sr}; sample rates are whole numbers")
    return int(sr)


def _poses(positions: ArrayLike) -> NDArray[np.float32]:
    poses = np.ascontiguousarray(positions, dtype=np.float32)
    if poses.ndim != 3 or poses.shape[1:] != (22, 3):
        raise ValueError(f"positions have the shape {poses.shape}; give (T, 22, 3)")
    if not len(poses) or not np.isfinite(poses).all():
        raise ValueError("positions are empty or not finite")
    return poses


def _path(model: str | os.PathLike[str] | None) -> pathlib.Path | None:
    return None if model is None else pathlib.Path(model)


@dataclass(frozen=True)
class Beats:
    """Beats of a recording."""

    #: Beat times, seconds.
    times: NDArray[np.float64]
    #: Median tempo, beats a minute; 0 with fewer than two beats.
    tempo: float
    #: Beats a bar; ``None`` where no bar stood out.
    meter: int | None
    #: Place of each beat in its bar from 1, 0 where not known; empty for the offline tracker.
    places: NDArray[np.uint8]
    #: How sure each beat was, 0 to 1; empty for the offline tracker.
    confidence: NDArray[np.float32]

    @property
    def downbeats(self) -> NDArray[np.float64]:
        """Times of the first beats of bars, seconds."""
        first: NDArray[np.bool_] = self.places == 1
        downbeats: NDArray[np.float64] = self.times[: len(first)][first]
        return downbeats


def beats(audio: ArrayLike, sr: float, *, causal: bool = False, tempo: tuple[float, float] | None = None) -> Beats:
    """The beats of a recording, with the whole of it known, or ``causal``: as a live robot hears
    them, with meter and places in the bar.

    ``tempo`` is the slowest and fastest tempo that the causal tracker follows, beats a minute.
    """
    return Beats(*_native.beats(_mono(audio), _rate(sr), not causal, tempo))


@dataclass(frozen=True)
class Features:
    """Music features, 20 frames a second, each from the samples before it."""

    #: Seconds since the first sample, (T,).
    times: NDArray[np.float64]
    #: (T, 39): onset strength, 20 MFCC, 12 chroma, onset peak, beat, then sine and cosine of the
    #: beat's phase, octaves of tempo from 120, confidence.
    values: NDArray[np.float32]
    #: Place between two beats, 0 to 1, (T,).
    phase: NDArray[np.float32]
    #: Beats a minute, 0 while unknown, (T,).
    tempo: NDArray[np.float32]
    #: 0 to 1, (T,).
    confidence: NDArray[np.float32]
    #: Probability of music, 0 to 1, (T,).
    presence: NDArray[np.float32]
    #: "lost", "holding", "locked" or "changing" (to another beat), a frame each.
    lock: list[str]
    #: Place of the last beat in its bar from 1, 0 while unknown, (T,).
    place: NDArray[np.uint8]
    #: Beats a bar, 0 while unknown, (T,).
    meter: NDArray[np.uint8]


class MusicStream:
    """Music in blocks of any length, features out, causally."""

    def __init__(self, sr: float, *, tempo: tuple[float, float] | None = None) -> None:
        self._stream = _native.MusicStream(_rate(sr), tempo)

    def push(self, audio: ArrayLike) -> Features:
        """The frames that these samples complete."""
        times, values, state = self._stream.push(_mono(audio))
        phase, tempo, confidence, presence, lock, place, meter = state.T
        names = [_LOCKS[int(value)] for value in lock]
        bar = place.astype(np.uint8), meter.astype(np.uint8)
        return Features(times, values, phase, tempo, confidence, presence, names, *bar)

    def tap(self, time: float) -> None:
        """A listener taps the beat at ``time`` seconds of the music; two taps put it right."""
        self._stream.tap(time)


def features(audio: ArrayLike, sr: float) -> Features:
    """The features of a whole recording."""
    return MusicStream(sr).push(audio)


def styles(model: str | os.PathLike[str] | None = None) -> list[str]:
    """The dance styles that the weights know."""
    return _native.styles(_path(model))


def generate(
    audio: ArrayLike,
    sr: float,
    *,
    style: str | None = None,
    seed: int = 1,
    lookahead: float = 0.0,
    model: str | os.PathLike[str] | None = None,
) -> NDArray[np.float32]:
    """Human motion to a recording: (T, 22, 3), metres, 20 frames a second.

    ``lookahead`` seconds of music after a frame help to find the beat in it; 0 is what a live
    robot hears. ``model`` is a file of weights in place of the built-in ones.
    """
    if not 0.0 <= lookahead <= 5.0:
        raise Error(f"lookahead {lookahead} is outside 0..5")
    return _native.generate(_mono(audio), _rate(sr), style, seed, lookahead, _path(model))


class DanceStream:
    """Music in blocks of any length, human motion out, as a live robot dances."""

    def __init__(
        self,
        sr: float,
        *,
        style: str | None = None,
        seed: int = 1,
        model: str | os.PathLike[str] | None = None,
    ) -> None:
        self._stream = _native.DanceStream(_rate(sr), style, seed, _path(model))

    def push(self, audio: ArrayLike) -> NDArray[np.float32]:
        """The poses, (k, 22, 3), of the frames that these samples complete."""
        return self._stream.push(_mono(audio))

    def set_style(self, style: str) -> None:
        """Goes on in another style."""
        self._stream.set_style(style)


def robots() -> list[str]:
    """The built-in robots."""
    return _native.built_in_robots()


class Robot:
    """A built-in robot by name, or a robot file by path."""

    def __init__(self, name_or_file: str | os.PathLike[str]) -> None:
        self._robot = _native.Robot(os.fspath(name_or_file))

    @classmethod
    def from_urdf(cls, description: str | os.PathLike[str], out: str | os.PathLike[str] | None = None) -> Robot:
        """A robot drafted from a URDF or MJCF file, tried in the simulated world (some minutes).

        The robot file goes to ``out`` (.toml), to be edited and loaded again; without it the draft
        is not kept. An existing file is overwritten.
        """
        robot = cls.__new__(cls)
        with tempfile.TemporaryDirectory() as folder:
            stem = pathlib.Path(description).stem
            to = pathlib.Path(folder) / f"{stem}.toml" if out is None else pathlib.Path(out)
            robot._robot = _native.Robot.from_description(pathlib.Path(description), to)
        return robot

    @property
    def name(self) -> str:
        return self._robot.name

    @property
    def joint_names(self) -> list[str]:
        return self._robot.joint_names

    @property
    def control_hz(self) -> float:
        """Control cycles a second."""
        return self._robot.control_hz

    @property
    def urdf(self) -> str:
        """The description's text."""
        return self._robot.urdf

    @property
    def limits(self) -> NDArray[np.float64]:
        """Lower, upper (rad), velocity (rad/s), acceleration (rad/s2) of each joint: (J, 4)."""
        return self._robot.limits()

    @property
    def rest(self) -> NDArray[np.float64]:
        """The rest pose, (J,), radians."""
        return self._robot.rest()

    def __repr__(self) -> str:
        return f"Robot({self.name!r}, {len(self.joint_names)} joints)"


def _robot(robot: Robot | str | os.PathLike[str]) -> Robot:
    return robot if isinstance(robot, Robot) else Robot(robot)


def retarget(
    positions: ArrayLike, fps: float, robot: Robot | str | os.PathLike[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Joint positions (N, J) of a robot that dances ``positions`` (T, 22, 3), and their times (N,).

    Inside every position, velocity and acceleration limit; ``fps`` is that of ``positions``.
    As with a file's motion, the skeleton's size is fitted, the floor put at 0, the start turned to +z.
    """
    if not (np.isfinite(fps) and fps > 0):
        raise ValueError(f"fps is {fps}; it is above 0")
    times, joints = _native.retarget(_poses(positions), float(fps), _robot(robot)._robot)
    return joints, times


class RetargetStream:
    """Retargeting frame by frame: a pose each 50 ms in, joint positions at the control rate out."""

    def __init__(self, robot: Robot | str | os.PathLike[str]) -> None:
        self._stream = _native.RetargetStream(_robot(robot)._robot)

    @property
    def lookahead(self) -> float:
        """How far the joint positions are behind the newest pose, seconds."""
        return self._stream.lookahead_s

    def push(self, pose: ArrayLike, contacts: Sequence[bool] = (False, False)) -> NDArray[np.float64]:
        """The joint positions, (k, J), of the cycles that this pose (22, 3) completes.

        ``contacts`` says whether the left and the right foot stand on the floor.
        """
        return self._stream.push(_poses(np.asarray(pose)[None])[0], (bool(contacts[0]), bool(contacts[1])))


class SimBus:
    """Simulated servos of a robot on a serial port that any driver opens.

        >>> with SimBus("neck") as bus:  # doctest: +SKIP
        ...     port = dynamixel_sdk.PortHandler(bus.port)

    ``link`` is "pty", "slcan", "unix" or "udp"; ``world`` "none", "floor" or "stand"; ``faults``
    are lines such as "3s l_knee dead". ``summary`` says after the end what passed on the wire
    and which limits were broken.
    """

    def __init__(
        self,
        robot: Robot | str | os.PathLike[str],
        *,
        link: str | None = None,
        world: str = "none",
        faults: Sequence[str] = (),
        backlash: bool = False,
    ) -> None:
        self._options = (_robot(robot)._robot, link, world, "\n".join(faults), backlash)
        self._bus: _native.SimBus | None = None
        self.summary: str | None = None

    def __enter__(self) -> SimBus:
        self._bus = _native.SimBus(*self._options)
        return self

    def __exit__(self, *raised: object) -> None:
        if self._bus is not None:
            self.summary = self._bus.stop()
            self._bus = None

    @property
    def ports(self) -> dict[str, str]:
        """Path of each bus by its name; the name of a single bus is empty."""
        if self._bus is None:
            raise Error("the simulated bus is not running: use it in a `with` statement")
        named = (port.rpartition("=") for port in self._bus.ports)
        return {name: path for name, _, path in named}

    @property
    def port(self) -> str:
        """Path of the first bus."""
        return next(iter(self.ports.values()))
