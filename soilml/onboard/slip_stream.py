"""Speed, slip and flags of a rover without odometry on board, by a graph of one step.

It needs numpy and onnxruntime alone. `soilml export slip` writes the graph.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.features import as_number, as_numbers
from soilml.onboard.model_file import Session, open_slip_step, verified
from soilml.onboard.set_contract import Floats
from soilml.onboard.state_checksum import state_checksum

#: Of the weights of the grounds: ends of the 90 % interval of speed and slip, and the median.
QUANTILES = (0.02, 0.5, 0.98)
JUDGED = 10  # Rows whose misfit is judged together
#: Numbers of the belief beside those of the grounds: variance of the rim speeds about their mean,
#: last mean rim speed (m/s), and the last misfits; below zero where there was none.
RECENT = 2 + JUDGED
#: Flags in the order of the graph's output; docs/how-to/drive.md explains them.
FLAGS = (
    "standing",
    "passed-over",
    "no-soil",
    "no-fit",
    "beyond",
    "not-determined",
    "torque-set-aside",
)
REFUSED = FLAGS[:3]  # Flags of rows without an answer
SLIP_FORMAT = "2"  # Version of files and states; files of version 1 have no checksum
#: Readings of a row, with their least and largest possible value: what lies beyond is an error of a
#: sensor, and its square may overflow. A load beyond the table's counts as that of its end.
POSSIBLE = {
    "rim_speed": (-100.0, 100.0),  # m/s
    "load": (1e-6, 1e7),  # N, of a wheel
    "slope": (-1.6, 1.6),  # rad
    "elapsed": (1e-6, 1e9),  # s
}
#: Largest deviation of an answer from the file's own probe: of mean and standard deviation, in
#: standard deviations, and of probabilities.
PROBE_TOLERANCE = 5e-3


@final
@dataclass(frozen=True)
class SlipState:
    """What is known after some rows: of fixed size, to be stored as it is.

    Parameters
    ----------
    grounds, recent : ndarray of float32
        Of the graph.
    file : str
        Which file it is of, and the version of its format: `SlipStream.identity`.
    checksum : int
        Of all that, as the stream wrote it. A state whose numbers have changed since is refused.
    """

    grounds: NDArray[np.float32]
    recent: NDArray[np.float32]
    file: str
    checksum: int

    @staticmethod
    def of(grounds: NDArray[np.float32], recent: NDArray[np.float32], file: str) -> SlipState:
        """A state with its checksum."""
        return SlipState(grounds, recent, file, state_checksum(grounds, recent, file))


@dataclass(frozen=True)
class SlipEstimate:
    """Speed and slips of a row; three values are the ends of the 90 % interval and the median.

    Attributes
    ----------
    speed
        Mean body speed, m/s.
    speed_std
        Its standard deviation, m/s.
    speeds, slips
        Quantiles of the speed (3,), m/s, and of each wheel's slip (3, k).
    no_soil, beyond
        Probabilities of a hard floor, and of more slip than the table has.
    flags
        Those of `FLAGS` that are set.
    """

    speed: float
    speed_std: float
    speeds: Floats
    slips: Floats
    no_soil: float
    beyond: float
    flags: tuple[str, ...]

    @property
    def answered(self) -> bool:
        """Whether speed and slips mean anything."""
        return not set(self.flags) & set(REFUSED)


@final
@dataclass(frozen=True)
class SlipStream:
    """Speed and slips row by row, state in and state out (docs/how-to/drive.md)."""

    session: Session = field(repr=False)
    path: str
    metadata: Mapping[str, str] = field(repr=False)
    wheels: tuple[str, ...]
    radius: Floats  # (k,), m
    load_of_attitude: Floats  # (k, 3): loads are linear in three products of sines and cosines

    @staticmethod
    def load(path: str | os.PathLike[str]) -> SlipStream:
        """A file of `soilml export slip`, verified by its checksums and its own probe.

        The probe is some rows with their known answers. Raises `ModelFileError` for another file,
        a damaged one, or a failing probe.
        """
        session, metadata = open_slip_step(path, SLIP_FORMAT)

        def read() -> SlipStream:
            rover, table = json.loads(metadata["rover"]), json.loads(metadata["table"])
            shares = np.asarray(table["load_of_attitude"], dtype=np.float64)
            wheels = tuple(str(wheel["name"]) for wheel in rover["wheels"])
            radius = np.asarray([float(wheel["radius_m"]) for wheel in rover["wheels"]])
            own = wheels, radius, shares.reshape(-1, 3)
            return SlipStream(session, str(path), metadata, *own)

        probe = metadata.get("probe", "[]")
        return verified(Path(path), read, lambda found: found._reproduces(json.loads(probe)))

    @property
    def identity(self) -> str:
        """Identity of its states: version of the format, and checksum of the graph."""
        return f"{SLIP_FORMAT}-{self.metadata['graph_sha256'][:16]}"

    def start(self) -> SlipState:
        """The state before any row."""
        inputs = self.session.get_inputs()
        feed = {entry.name: np.zeros(entry.shape, np.float32) for entry in inputs}
        feed["recent"][1:] = -1.0
        grounds = self.session.run(["start"], feed)[0]
        return SlipState.of(grounds, feed["recent"], self.identity)

    def loads(self, slope: float, roll: float = 0.0) -> Floats:
        """Load of each wheel (k,), N, by pitch and roll, rad; roll is positive where left is high.

        Those of equally stiff wheels under a rigid body, as `soilml drive slip` has them. Not
        above zero where a wheel leaves the ground.
        """
        attitude = (np.cos(slope) * np.cos(roll), np.sin(slope), np.cos(slope) * np.sin(roll))
        return np.asarray(self.load_of_attitude @ np.asarray(attitude))

    def step(
        self,
        state: SlipState,
        rim_speed: Any,
        torque: Any,
        load: Any,
        slope: float,
        elapsed: float = 1.0,
    ) -> tuple[SlipEstimate, SlipState]:
        """The answer for a row, and the state after it.

        Parameters
        ----------
        state : SlipState
            That of the row before, or `start()`.
        rim_speed : array_like, shape (k,)
            Radius times rotation of each wheel, m/s, negative backward.
        torque : array_like, shape (k,)
            Read torque of each wheel, N m; NaN where there is none. One beyond what any soil
            supports is left out, with the flag `torque-set-aside`.
        load : array_like, shape (k,)
            Load of each wheel, N.
        slope : float
            Pitch, rad, positive uphill.
        elapsed : float
            Time since the row before, s.

        Raises
        ------
        InputError
            For another number of wheels; for what is not finite or not possible (`POSSIBLE`), but
            for a torque; for a state that is damaged or of another file; and for a row whose
            answer would not be finite. Go on with the state that was given.
        """
        self._check(state)
        given = {"rim_speed": rim_speed, "torque": torque, "load": load}
        feed = {name: as_numbers(name, values) for name, values in given.items()}
        for name, values in feed.items():
            if values.shape != (len(self.wheels),):
                raise InputError(
                    f"{name} has shape {values.shape}; needed are {len(self.wheels)} numbers, of "
                    f"{', '.join(self.wheels)}"
                )
        feed["slope"] = np.asarray([as_number("slope", slope)])
        feed["elapsed"] = np.asarray([as_number("elapsed", elapsed)])
        for name, (low, high) in POSSIBLE.items():
            values = feed[name]
            if not np.isfinite(values).all():
                raise InputError(f"{name} is not finite; give the row again without it missing")
            bad = values[(values < low) | (values > high)]
            if bad.size:
                raise InputError(f"{name} is {bad[0]:g}; possible is {low:g} to {high:g}")
        with np.errstate(over="ignore"):  # a torque beyond float32 is left out
            single = {name: values.astype(np.float32) for name, values in feed.items()}
        single |= {"grounds": state.grounds, "recent": state.recent}
        outputs = ("speed", "slip", "probability", "flags", "grounds_out", "recent_out")
        found = self.session.run(outputs, single)
        if not all(np.isfinite(part).all() for part in found):
            raise InputError("the answer for this row is not finite: the row is not used")
        speed, slip, probability, flags, grounds, recent = found
        estimate = SlipEstimate(
            speed=float(speed[0]),
            speed_std=float(speed[1]),
            speeds=speed[2:].astype(np.float64),
            slips=slip.astype(np.float64),
            no_soil=float(probability[0]),
            beyond=float(probability[1]),
            flags=tuple(name for name, on in zip(FLAGS, flags, strict=True) if on > 0.5),
        )
        return estimate, SlipState.of(grounds, recent, self.identity)

    def _check(self, state: object) -> None:
        """Raise `InputError` unless it is a state of this file, as a step wrote it."""
        begin = "begin with stream.start()"
        if not isinstance(state, SlipState):
            raise InputError(f"state is a {type(state).__name__}; needed is a SlipState: {begin}")
        if state.file != self.identity:
            raise InputError(
                f"this state is of {state.file!r}, which is another file or version than "
                f"{self.identity!r} of {self.path}: {begin}"
            )
        if state.checksum != state_checksum(state.grounds, state.recent, state.file):
            raise InputError(f"this state is damaged: its checksum does not match: {begin}")

    def _reproduces(self, probe: list[dict[str, Any]]) -> bool:
        """Whether the rows of the probe, one after the other, have their known answers."""
        state = self.start()
        for entry in probe:
            rows: dict[str, Any] = {n: np.asarray(v, np.float64) for n, v in entry["row"].items()}
            found, state = self.step(state, **rows)
            own = (found.speed, found.speed_std, found.no_soil, found.beyond)
            known = entry["speed"], entry["speed_std"], entry["no_soil"], entry["beyond"]
            scale = np.asarray([known[1], known[1], 1.0, 1.0])
            away = np.abs(np.subtract(own, known)) / scale
            if not (away < PROBE_TOLERANCE).all():
                return False
        return bool(probe)
