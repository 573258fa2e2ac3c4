"""Estimates from all readings of one soil, onboard: the set posterior of a model file.

The estimate follows from all readings jointly; their order matters little. What they contribute
is kept in a memory of bounded size, so that a rover can continue where it stopped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.onboard.estimate import Reason
from soilml.onboard.features import READABLE, as_number, as_numbers, flatten_readings
from soilml.onboard.memory import ROWS_PER_CALL, Memory
from soilml.onboard.model_file import Session
from soilml.onboard.set_contract import (
    ABSENT_READING,
    ABSENT_STD,
    COMMON_ERROR_INPUTS,
    FORMER_SHARE_IN_RANGE,
    INFERRED,
    LEAST_STD,
    MEMORY_INPUTS,
    MEMORY_OUTPUTS,
    MODEL_ERROR_INPUT,
    NOISE_NAMES,
    OPERATING_NOISE,
    OPERATING_STD_INPUTS,
    OPTIONAL_READINGS,
    REQUIRED_READINGS,
    SENSOR_ERROR_COLUMNS,
    SET_OUTPUTS,
    SET_PREFIX,
    SET_SWITCH,
    STD_INPUTS,
    Floats,
    empty_memory,
)

Feed = dict[str, NDArray[Any]]

#: Standard deviations that may be zero, and everything that is read of a row.
MAY_BE_ZERO = ("torque_bias", *OPERATING_STD_INPUTS)
KNOWN = (*REQUIRED_READINGS, *OPTIONAL_READINGS, *STD_INPUTS, *OPERATING_STD_INPUTS)
#: Outputs that are read of the graph.
OUTPUTS = [*(SET_PREFIX + name for name in SET_OUTPUTS), *MEMORY_OUTPUTS]
#: Stands for the smallest positive standard deviation: zero and negative values are refused.
POSITIVE_STD = 1e-300
#: The graph leaves out a torque whose constant noise is a larger share of it.
MOST_CONSTANT_SHARE = 1.0 / 3.0


@final
@dataclass(frozen=True)
class SetPosterior:
    """The part of a model file's graph that estimates from sets of rows.

    terms: Number of monomials.
    noise: Noise model by name: constant part, and share of the reading.
    context_ranges: Least and largest value of each context input, which holds for a whole set.
    context_values: Values of the context inputs that were set.
    sets_only: Whether the file has no regressors of single rows.
    common_errors: Standard deviations of errors that all rows share, by `COMMON_ERROR_INPUTS`, as
        far as the file knows them: those of earlier interfaces know fewer, or none.
    error_columns: Columns of errors in the residual system.
    least_share_in_range: Share of a set's rows that must be in range; the others are set aside.
    log_torque: Whether the graph takes the logarithm of torque: where the noise of torque has no
        constant part, and in a file for any wheel.
    constant_noise: Constant part of the noise of torque that a user has set, N m; the graph takes
        the noise as a share of the reading.
    """

    terms: int
    noise: dict[str, tuple[float, float]]
    context_ranges: dict[str, tuple[float, float]]
    context_values: dict[str, float]
    sets_only: bool
    common_errors: dict[str, float]
    error_columns: int
    least_share_in_range: float
    log_torque: bool = True
    constant_noise: float = 0.0

    @staticmethod
    def of(metadata: Mapping[str, Any]) -> SetPosterior:
        """From the entry `set` of a file's metadata."""
        context, errors = metadata["context"].items(), metadata.get("errors", {})
        noise = {str(k): (float(v[0]), float(v[1])) for k, v in metadata["noise"].items()}
        constant, _ = noise.get("torque", (0.0, 0.0))
        return SetPosterior(
            terms=int(metadata["terms"]),
            noise=noise,
            context_ranges={str(k): (float(v[0]), float(v[1])) for k, v in context},
            context_values={},
            sets_only=bool(metadata["alone"]),
            common_errors={n: float(errors[n]) for n in COMMON_ERROR_INPUTS if n in errors},
            error_columns=len(SENSOR_ERROR_COLUMNS) + len(metadata.get("model_errors", ()))
            if errors
            else 1,
            least_share_in_range=float(metadata.get("least_share_in_range", FORMER_SHARE_IN_RANGE)),
            log_torque=metadata.get("kind") == "any wheel" or not constant,
        )

    @property
    def columns(self) -> int:
        """Columns of the residual system: monomials, and errors that all rows share."""
        return self.terms + self.error_columns

    @property
    def missing_context(self) -> tuple[str, ...]:
        """Context inputs that must be set before anything is estimated."""
        return tuple(name for name in self.context_ranges if name not in self.context_values)

    def with_context(self, context: Mapping[str, Any], noise: Mapping[str, Any]) -> SetPosterior:
        """A copy with context inputs (wheel, bearing values, prior) and noise set.

        Raises `InputError` if a name is not known, or a value is out of the range of the file.
        """
        if not isinstance(noise, Mapping):
            given = type(noise).__name__
            raise InputError(f"noise is a {given}; needed is a dict of names to values")
        parts = {name: _noise_parts(name, value) for name, value in noise.items()}
        values = {name: as_number(name, value) for name, value in context.items()}
        common = {name: values.pop(name) for name in COMMON_ERROR_INPUTS if name in values}
        for name, value in common.items():
            self._check_knows(name, value)
            inferred = name == MODEL_ERROR_INPUT and value == INFERRED
            if not (0.0 <= value < np.inf or inferred):
                raise InputError(
                    f"{name} is {value:g}; needed is a standard deviation, zero or more"
                )
        for name, value in values.items():
            if name not in self.context_ranges:
                known = ", ".join(self.context_ranges) or "none: it was trained for one wheel"
                raise InputError(
                    f"{name!r} is not a context input of this file; its context inputs: {known}"
                )
            low, high = self.context_ranges[name]
            if not low <= value <= high:
                raise InputError(
                    f"{name} is {value:g}; the range of this file is {low:g} to {high:g}"
                )
        values = self.context_values | values
        constant, _ = parts.get("torque", (self.constant_noise, 0.0))
        return replace(
            self,
            context_values=values,
            noise=self.noise | parts,
            common_errors={n: common.get(n, v) for n, v in self.common_errors.items()},
            constant_noise=constant if self.log_torque else 0.0,
        )

    def _check_knows(self, name: str, std: float) -> None:
        """Raise `InputError` for an error that a file of an earlier interface takes as zero."""
        of_model = name == MODEL_ERROR_INPUT and name not in self.common_errors
        if (of_model or not self.common_errors) and std != 0.0:
            raise InputError(
                f"{name} is {std:g}, but this file of an earlier version takes it as zero: train "
                "it again, with [set_posterior]"
            )

    def start(self, file: str = "") -> Memory:
        """The memory before the first reading, of the file with this identity."""
        system, counts = empty_memory(self.columns)
        return Memory(system.astype(np.float64), counts, file)

    def rows(self, measured: Mapping[str, Any]) -> dict[str, Floats]:
        """Row inputs of the graph (m,) from readings, checked and completed.

        measured: Slip, torque and load; optionally sinkage and drawbar pull, NaN where they were
            not measured, and standard deviations. Numbers or arrays that broadcast to one shape.

        Raises `InputError` if a reading is missing, not finite, out of its physical range, or not
        an input.
        """
        for name in measured:
            if name not in KNOWN:
                raise InputError(f"{name!r} is not read by this model; it reads {', '.join(KNOWN)}")
        required = {name: measured[name] for name in measured if name in REQUIRED_READINGS}
        flat, shape = flatten_readings(REQUIRED_READINGS, required)
        rows = dict(zip(REQUIRED_READINGS, flat, strict=True))
        absent = [np.full(len(flat[0]), value) for value in (ABSENT_READING, ABSENT_STD)]
        for name in OPTIONAL_READINGS:
            if name not in measured and f"{name}_std" not in measured:
                rows[name], rows[f"{name}_std"] = absent
                continue
            value = _broadcast(name, measured.get(name, np.nan), shape)
            missing = np.isnan(value)
            std = self._std(f"{name}_std", name, value, measured, shape)
            rows[name] = np.where(missing, ABSENT_READING, value)
            rows[f"{name}_std"] = np.where(missing, ABSENT_STD, std)
        for name, source in (("torque_std", "torque"), ("torque_bias", "torque_bias")):
            rows[name] = self._std(name, source, rows["torque"], measured, shape)
        for name, source in zip(OPERATING_STD_INPUTS, OPERATING_NOISE, strict=True):
            std = self._std(name, source, rows[source], measured, shape)
            self._check_knows(name, float(std.max(initial=0.0)))
            if self.common_errors:
                rows[name] = std
        if self.constant_noise and "torque_std" not in measured:
            factor = constant_noise_factor(rows["torque"], self.constant_noise)
            rows |= {name: rows[name] * factor for name in ("torque", "torque_std")}
        if len(measured) == len(REQUIRED_READINGS):
            return rows
        for name in measured.keys() & rows.keys() - READABLE.keys():  # others are positive
            least = 0.0 if name in MAY_BE_ZERO else POSITIVE_STD
            if not (rows[name] >= least).all():
                needed = "zero or more" if name in MAY_BE_ZERO else "above zero"
                raise InputError(f"{name} is {rows[name].min():g}; it must be {needed}")
        return rows

    def _std(
        self,
        name: str,
        source: str,
        reading: Floats,
        measured: Mapping[str, Any],
        shape: tuple[int, ...],
    ) -> Floats:
        """A standard deviation (m,) as measured, or from the noise model of its source."""
        if name in measured:
            return _broadcast(name, measured[name], shape)
        constant, share = self.noise.get(source, (0.0, 0.0))
        if source in OPTIONAL_READINGS and not constant + share:
            return np.full(len(reading), ABSENT_STD)
        least = 0.0 if name in MAY_BE_ZERO else LEAST_STD
        if not share:
            return np.full(len(reading), max(constant, least))
        return np.maximum(np.hypot(constant, share * np.abs(reading)), least)

    def feed(self, rows: Mapping[str, Floats], memory: Memory) -> Feed:
        """All inputs of the graph by name."""
        with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
            stacked = np.array(list(rows.values()), np.float32)
        feed: Feed = dict(zip(rows, stacked, strict=True)) | self._feed_of_set
        kept = memory.system.astype(np.float32), memory.counts.astype(np.float32)
        return feed | dict(zip(MEMORY_INPUTS, kept, strict=True))

    @cached_property
    def exact(self) -> SetPosterior:
        """The same of sensors and a model without errors that rows share."""
        return replace(self, common_errors=dict.fromkeys(self.common_errors, 0.0))

    @cached_property
    def _feed_of_set(self) -> Feed:
        """Inputs of the graph that hold for a whole set."""
        of_set = self.context_values | self.common_errors
        feed: Feed = {name: np.asarray([value], np.float32) for name, value in of_set.items()}
        return feed if self.sets_only else feed | {SET_SWITCH: np.ones(1, np.bool_)}

    def update(
        self, session: Session, rows: Mapping[str, Floats], memory: Memory
    ) -> tuple[list[Any], Memory]:
        """Outputs of the graph, in the order of `SET_OUTPUTS`, and memory after further rows.

        The memory is not packed.
        """
        count = len(next(iter(rows.values())))
        *parts, last = (
            {name: values[first : first + ROWS_PER_CALL] for name, values in rows.items()}
            for first in range(0, max(count, 1), ROWS_PER_CALL)
        )
        for part in parts:
            memory = memory.grown(*session.run(MEMORY_OUTPUTS, self.feed(part, memory))).packed()
        memory = memory.packed()
        outputs = session.run(OUTPUTS, self.feed(last, memory))
        return outputs[: len(SET_OUTPUTS)], memory.grown(*outputs[len(SET_OUTPUTS) :])


def constant_noise_factor(torque: Floats, constant: float) -> Floats:
    r"""Factors (m,) of torque readings (m,) whose noise has this constant part, N m.

    The graph weights the logarithm of a reading y by :math:`w = (y / \sigma)^2`. With
    :math:`\sigma^2 = a^2 + b^2 y^2` the weight rises with the error of the reading unless a is 0:
    :math:`d \log w / d \log y = 2 a^2 / \sigma^2`. The weighted mean of the logarithm is then too
    large by that times its variance :math:`(\sigma / y)^2`, to second order in the noise. Readings
    are reduced by this, their standard deviations as well:

    .. math:: y' = y \, e^{-2 (a / y)^2}
    """
    share = constant / np.maximum(np.abs(torque), POSITIVE_STD)
    return np.asarray(np.exp(-2.0 * np.minimum(share, MOST_CONSTANT_SHARE) ** 2))


def _noise_parts(name: Any, value: Any) -> tuple[float, float]:
    """Constant part and share of a noise; raises `InputError` for anything else."""
    parts = as_numbers(f"noise of {name}", value)
    good = parts.shape == (2,) and bool((parts >= 0.0).all()) and bool(np.isfinite(parts).all())
    if name not in NOISE_NAMES or not good:
        given = " and ".join(f"{part:g}" for part in parts.flat)
        raise InputError(
            f"noise of {name} is {given}; needed are two numbers of zero or more, a constant and a "
            f"share of the reading, for one of {', '.join(NOISE_NAMES)}"
        )
    return float(parts[0]), float(parts[1])


def _broadcast(name: str, value: Any, shape: tuple[int, ...]) -> Floats:
    low, high = READABLE.get(name, (0.0, np.inf))
    array = as_numbers(name, value)
    try:
        array = np.broadcast_to(array, shape).reshape(-1)
    except ValueError:
        raise InputError(f"{name} has shape {array.shape}, the readings have {shape}") from None
    if name in READABLE:
        bad = ~((array > low) & (array < high)) & ~np.isnan(array)
        if bad.any():
            raise InputError(f"{name} is {array[bad][0]:g}; needed is a finite number, or NaN")
    return array


def of_reason(in_range: bool, memory: Memory, least_share: float) -> Reason:
    """Why a set has the estimate that it has, as its graph decides."""
    if in_range:
        return Reason.ESTIMATED
    readings, rows, rows_in_range = memory.counts
    if not rows_in_range >= rows * np.float32(least_share):
        return Reason.OUT_OF_RANGE
    return Reason.INCONSISTENT if readings > 0.5 else Reason.NO_INFORMATION
