"""Speed, slip and flags of a rover without odometry on board, by a graph of one step.

It needs numpy and onnxruntime alone. `soilml export-slip` writes the graph.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError, ModelFileError
from soilml.onboard.features import as_number, as_numbers
from soilml.onboard.model_file import Session, create_session
from soilml.onboard.set_contract import Floats

#: Of the weights of the grounds: ends of the 90 % interval of speed and slip, and the median.
QUANTILES = (0.02, 0.5, 0.98)
JUDGED = 10  # Rows whose misfit is judged together
#: Numbers of the belief beside those of the grounds: variance of the rim speeds about their mean,
#: last mean rim speed (m/s), and the last misfits; below zero where there was none.
RECENT = 2 + JUDGED
#: Flags in the order of the graph's output; docs/how-to/slip-unknown.md explains them.
FLAGS = ("standing", "passed-over", "no-soil", "no-fit", "beyond", "not-determined")
REFUSED = FLAGS[:3]  # Flags of rows without an answer
KIND = "slip-step"  # The metadata entry `soilml_kind` of such a file


@dataclass(frozen=True)
class SlipState:
    """What is known after some rows: of fixed size, to be stored as it is."""

    grounds: NDArray[np.float32]
    recent: NDArray[np.float32]


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
    """Speed and slips row by row, state in and state out (docs/how-to/slip-unknown.md)."""

    session: Session
    path: str
    wheels: tuple[str, ...]
    load_range: tuple[float, float]  # N, of the table; a load beyond counts as that of its end
    load_of_attitude: Floats  # (k, 3): loads are linear in three products of sines and cosines

    @staticmethod
    def load(path: str | os.PathLike[str]) -> SlipStream:
        """A file of `soilml export-slip`; raises `ModelFileError` for any other."""
        try:
            session = create_session(Path(path).read_bytes())
        except OSError as error:
            raise ModelFileError(f"{path} cannot be read: {error.strerror or error}") from None
        except Exception as error:
            first = " ".join(str(error).split())
            raise ModelFileError(f"{path} cannot be loaded as an ONNX file: {first}") from None
        metadata = session.get_modelmeta().custom_metadata_map
        if metadata.get("soilml_kind") != KIND:
            raise ModelFileError(f"{path} is no file of soilml export-slip")
        low, high = (float(value) for value in metadata["load_N"].split())
        wheels = tuple(metadata["wheels"].split("\n"))
        shares = np.asarray([float(x) for x in metadata["load_of_attitude"].split()])
        return SlipStream(session, str(path), wheels, (low, high), shares.reshape(-1, 3))

    def start(self) -> SlipState:
        """The state before any row."""
        feed = {name: np.zeros(shape, np.float32) for name, shape in self._shapes.items()}
        feed["recent"][1:] = -1.0
        grounds = self.session.run(["start"], feed)[0]
        return SlipState(grounds, feed["recent"])

    def loads(self, slope: float, roll: float = 0.0) -> Floats:
        """Load of each wheel (k,), N, by pitch and roll, rad; roll is positive where left is high.

        Those of equally stiff wheels under a rigid body, as `soilml slip` has them. Not above zero
        where a wheel leaves the ground.
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

        rim_speed: Radius times rotation of each wheel (k,), m/s, negative backward.
        torque: Read torque of each wheel (k,), N m; NaN where there is none.
        load: Load of each wheel (k,), N.
        slope: Pitch, rad, positive uphill.
        elapsed: Time since the row before, s.

        Raises `InputError` for another number of wheels, or what is not finite but for a torque.
        """
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
        for name, values in feed.items():
            if name != "torque" and not np.isfinite(values).all():
                raise InputError(f"{name} is not finite; give the row again without it missing")
        if feed["load"].min() <= 0.0 or feed["elapsed"][0] <= 0.0:
            raise InputError("load and elapsed must be above zero")
        single = {name: values.astype(np.float32) for name, values in feed.items()}
        single |= {"grounds": state.grounds, "recent": state.recent}
        outputs = ("speed", "slip", "probability", "flags", "grounds_out", "recent_out")
        speed, slip, probability, flags, grounds, recent = self.session.run(outputs, single)
        found = SlipEstimate(
            speed=float(speed[0]),
            speed_std=float(speed[1]),
            speeds=speed[2:].astype(np.float64),
            slips=slip.astype(np.float64),
            no_soil=float(probability[0]),
            beyond=float(probability[1]),
            flags=tuple(name for name, on in zip(FLAGS, flags, strict=True) if on > 0.5),
        )
        return found, SlipState(grounds, recent)

    @property
    def _shapes(self) -> dict[str, list[int]]:
        return {entry.name: entry.shape for entry in self.session.get_inputs()}
