"""What a set posterior requires of the wheels and soils for which it is trained."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS, USUAL_SENSOR_ERRORS, without_errors
from soilml.onboard.set_contract import (
    ABSENT_READING,
    ABSENT_STD,
    INFERRED,
    LEAST_STD,
    RESPONSE_CHANNELS,
)
from soilml.physics.effects.base import Effect
from soilml.physics.effects.contact_shape import ExitAngle
from soilml.physics.model import Model
from training.onnx_graph.value import Value, log, maximum, minimum
from training.set_posterior.families.coordinates import PriorAxis

#: Logarithms are taken of nothing smaller: slip, load, torque or sinkage of zero or less is then
#: far out of range.
SMALLEST = LEAST_STD
#: A torque or sinkage whose relative noise is larger than this is left out where its logarithm is
#: taken: the logarithm of a normal variable that may be negative is not normal (zero is 3 sigma
#: away here).
MOST_RELATIVE_NOISE = 1.0 / 3.0
#: Standard deviations of errors that the readings of a drive typically have in common.
TYPICAL_ERRORS = USUAL_SENSOR_ERRORS | {"drawbar_pull_bias": 0.0, "model_error": INFERRED}
#: Usual standard deviations of `LAW_ERROR_COLUMNS`: what other laws of the soil that fit a shear
#: test as well make of the parameters. A hyperbola instead of an exponential, half and half, takes
#: 11 % of the strength; a peak of 30 % that decays, 12 to 26 % of the shear modulus; an envelope
#: that loses 4.6 degrees a decade, 7 % of the strength for a load larger by a factor of e.
LAW_ERRORS = {"strength": 0.04, "strength_by_load": 0.035, "shear_modulus": 0.16}
#: Largest correction of the logarithm's bias, that of 20 % noise: its series in the noise is
#: accurate there.
MOST_LOG_CORRECTION = 0.02


@dataclass(frozen=True)
class ContextValues:
    """Graph values that a family computes from its inputs, float32."""

    features: Value  # (f, rows) inputs of the response surface
    feature_slopes: Floats  # (2, f) derivatives of the features by log slip and log load
    torque: Value  # (1, rows) the torque reading on the scale of the response
    torque_slope: Value  # (1, rows) derivative of that scale by torque, 1 / (N m)
    torque_by_load: float  # derivative of the torque scale by log load, with its sign changed
    reference_log_load: Value | float  # from which changes with the logarithm of load are counted
    most_torque_noise: float  # readings with more noise on that scale are left out
    length: Value | float  # unit of sinkage, and of torque over load, m
    target_scale: Value | None  # (q,) factors of the values of the estimated axes; None: 1
    axis_std: Value | None  # (p, 1) std of nearly known coordinates, 1 for others; None: no such


@dataclass(frozen=True)
class SimulatedSets:
    """Simulated sets of one size, and what their exact posterior depends on.

    `readings` are sensor readings and their standard deviations by input name, (sets, rows);
    `context` are the inputs of a whole set, (sets,); `truth` are the estimated parameters
    (sets, q). `noise` has for each measured channel, and for `torque_bias`, its constant part and
    its share of the true value, (2, sets, rows).
    """

    readings: dict[str, Floats]
    context: dict[str, Floats]
    truth: Floats
    designs: Floats  # (sets, rows, d)
    x: Floats  # (sets, p) coordinates of all unknowns
    normal_std: Floats  # (sets,) prior standard deviation of the nearly known coordinates
    length: Floats  # (sets,) unit of sinkage, and of torque over load, m
    noise: dict[str, Floats]

    def rows(self, index: int) -> dict[str, Floats]:
        """The readings of one set (rows,)."""
        return {name: values[index] for name, values in self.readings.items()}

    def context_of(self, index: int) -> dict[str, float]:
        """The context inputs of one set."""
        return {name: float(values[index]) for name, values in self.context.items()}


def measured(
    values: Sequence[Floats],
    noise: Mapping[str, Floats],
    everything: NDArray[np.bool_],
    rng: np.random.Generator,
) -> dict[str, Floats]:
    """Readings of the channels (sets, rows) with noise and the bias of torque, and their stds.

    values: True values of torque, sinkage and drawbar pull.
    noise: As in `SimulatedSets`, without channels that are never measured.
    everything: Whether a set (sets, 1) has other channels than torque.
    """
    readings = {}
    for name, value in zip(RESPONSE_CHANNELS, values, strict=True):
        constant, share = noise.get(name, np.full((2, 1, 1), ABSENT_STD))
        std = np.hypot(constant, share * value)
        there = (name in noise) & (everything | (name == "torque"))
        noisy = value + std * rng.standard_normal(value.shape)
        readings[name] = np.where(there, noisy, ABSENT_READING)
        readings[f"{name}_std"] = np.where(there, std, ABSENT_STD)
    constant, share = noise["torque_bias"]
    bias = np.hypot(constant, share * values[0])
    readings["torque"] += bias * rng.standard_normal((len(bias), 1))
    return readings | {"torque_bias": bias}


def add_log_torque(readings: dict[str, Value], length: Value | float) -> tuple[Value, Value]:
    r"""Logarithm of torque over load and length (1, rows), and its derivative by torque.

    .. math:: y = \log \frac{T}{W r} + \min\left(\tfrac12 \left(\sigma / T\right)^2, 0.02\right),
        \qquad \frac{dy}{dT} = \frac1T

    The expectation of the logarithm of a noisy reading lies below the logarithm of the truth by
    half of the squared relative noise (Taylor series of second order), which is added.
    """
    torque = maximum(readings["torque"], SMALLEST)
    relative_noise = readings["torque_std"] / torque
    correction = minimum(relative_noise * relative_noise * 0.5, MOST_LOG_CORRECTION)
    torque_ratio = torque / (readings["load"] * length)
    return log(torque_ratio) + correction, 1.0 / torque


@dataclass(frozen=True)
class WheelFamily(ABC):
    """Wheels on soils: operating conditions, response of the wheel, and its inputs in a graph.

    A design is one operating condition of one wheel, a row (n, d) of numbers that the family
    defines. Axes are the unknowns: first those that are estimated, then nuisance parameters
    anywhere in their range, and last nearly known nuisance parameters with a normal prior around 0.
    """

    axes: tuple[PriorAxis, ...]  # all unknowns
    targets: int  # number of axes that are estimated
    free: int  # number of axes that lie anywhere in their range; the others have a normal prior
    degree: tuple[int, int]  # of the polynomial, and of its terms of the estimated axes alone

    @abstractmethod
    def designs(self, count: int, seed: int) -> Floats:
        """Operating conditions (count, d) that the soil carries, spread over the range."""

    @abstractmethod
    def features(self, designs: Floats) -> Floats:
        """Inputs of the response surface, smooth and of order one, (n, f)."""

    @abstractmethod
    def responses(self, designs: Floats, x: Floats, *effects: Effect) -> Floats:
        """Channels (n, m, 3) at coordinates x (n, m, p), with further effects of the model.

        They are a rising function of torque along which its noise is nearly constant, the logarithm
        of sinkage over length, and drawbar pull over load; NaN without equilibrium.
        """

    @abstractmethod
    def model_errors(self) -> dict[str, float]:
        """Typical standard deviations of errors of the model, by `MODEL_ERROR_COLUMNS`.

        Nil for what is an unknown of the family, or an effect of its model.
        """

    @abstractmethod
    def add_context(self, readings: dict[str, Value]) -> ContextValues:
        """Add nodes that compute the context from readings (1, rows) and from `inputs`."""

    @abstractmethod
    def sets(self, count: int, rows: int, seed: int) -> SimulatedSets:
        """Sets of rows under operating conditions of a rover, with noise; soils of the prior."""

    @abstractmethod
    def metadata(self) -> dict[str, Any]:
        """Ranges and axes, for the file and its card."""

    @abstractmethod
    def described(self) -> str:
        """Slips, loads and soils as a user wrote them, for messages."""

    def inputs(self) -> dict[str, str]:
        """Context inputs of the graph, of all rows of a set: name -> unit."""
        return {}

    def limits(self) -> dict[str, list[float]]:
        """Least and largest value of each context input."""
        return {}

    def typical_errors(self) -> dict[str, float]:
        """Typical standard deviations of errors that all rows share, by `COMMON_ERROR_INPUTS`."""
        return TYPICAL_ERRORS

    def contact_changes(self, designs: Floats, x: Floats) -> Floats:
        """Changes of the channels (n, m, 3) where the rim touches the soil behind the axle too.

        That is with the effect `exit-angle` at its typical size.
        """
        touching = ExitAngle(**ExitAngle.about.reference)
        return self.responses(designs, x, touching) - self.responses(designs, x)

    def truth(self, x: Floats, scale: Sequence[Floats | float] = ()) -> Floats:
        """Estimated parameters (n, q) at coordinates x (n, p), times the scale of each."""
        values = [axis.value(x[:, i]) for i, axis in enumerate(self.axes[: self.targets])]
        return np.stack(
            [v * s for v, s in zip(values, scale or [1.0] * len(values), strict=True)], 1
        )


def run_patterns(count: int, rows: int, rng: np.random.Generator) -> Floats:
    """Random fractions of the range (count, rows).

    Half of the sets vary independently from row to row, a quarter takes three levels, and a quarter
    is constant.
    """
    independent = rng.random((count, rows))
    levels = rng.random((count, 3))[np.arange(count)[:, None], rng.integers(3, size=(count, rows))]
    constant = np.repeat(rng.random((count, 1)), rows, axis=1)
    pattern = rng.integers(4, size=(count, 1))
    return np.where(pattern < 2, independent, np.where(pattern == 2, levels, constant))


def typical_model_errors(unknown: Sequence[str], model: Model) -> dict[str, float]:
    """The typical errors, without those that the model has as unknowns or as effects.

    unknown: Unknowns by their dotted paths.
    model: Gear, which need not be a rigid wheel, and effects.
    """
    nil = without_errors(unknown, {effect.name for effect in model.effects}, [model.gear])
    if "cohesion" not in unknown:  # the change with the bearing modulus is not known then
        nil |= {"bearing", "bearing_by_slip", "bearing_by_load"}
    usual = USUAL_MODEL_ERRORS | LAW_ERRORS
    return {name: 0.0 if name in nil else std for name, std in usual.items()}
