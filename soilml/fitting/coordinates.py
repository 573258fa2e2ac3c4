"""Coordinates of a fit: parameters of soil, gear and effects in one vector, with their priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError, did_you_mean
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.effects.base import Effect, SlipLoadScaling
from soilml.physics.gears.rigid_wheel import RigidWheel
from soilml.quantities import SHEAR

#: Ranges of natural soils, for parameters without a prior.
_DEFAULT_PRIORS = {
    "cohesion": Prior(0.0, 10000.0),
    "friction_angle": Prior(0.17, 0.96),
    "shear_modulus": Prior(0.001, 0.1, log=True),
    "n": Prior(0.3, 1.8),
}
#: An upper bound beyond this multiple of the value is too wide to search, two decades; the prior is
#: then this factor to either side of the value, three decades in all.
WIDE_BOUND, ASSUMED_FACTOR = 100.0, 30.0
#: Prior standard deviations of an effect's shape coefficients, in their own units.
SHAPE_STD = {"slip_power": 1.0, "by_slip": 3.0, "by_load": 1.0}


@dataclass(frozen=True)
class Coordinate:
    """One coordinate x of a fit: its bounds, and how it maps to the value of a parameter.

    The x of a parameter of `select_free`, also of an effect, is its cumulative probability under
    the prior, from 0 to 1. In an analysis of gaps the size of an effect has x in reference sizes,
    and a shape coefficient is its own x: `prior` is then a scale alone, from the value at x = 0 to
    the one at x = 1.
    """

    path: str  # as in `Case.parameters`: `cohesion`, `slip-sinkage.n1`, `grousers@lugged.height`
    unit: str  # SI unit of its values
    prior: Prior  # maps x to the value: the case's prior, the one that is assumed, or a scale
    nominal: float = 0.0  # value that the case gives it
    assumed: bool = False  # whether the case has no prior for it
    #: Standard deviation of a normal density of the value about zero that is to be multiplied with
    #: that of the prior; None where there is none
    normal_std: float | None = None
    lower: float = 0.0  # bounds of x
    upper: float = 1.0
    is_shape: bool = False  # whether it is a shape coefficient of an effect's law
    of_candidate: bool = False  # whether it is of an effect that a hypothesis adds

    @property
    def effect(self) -> str:
        """Name of the effect, or of the part of the case, that has the parameter; "" for soil."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """Name of the parameter within its soil or effect."""
        return self.path.rpartition(".")[2]

    @property
    def std(self) -> float:
        """Standard deviation of x by the normal density about zero; infinite without one."""
        if self.normal_std is None:
            return float("inf")
        return self.normal_std / abs(self.prior.upper - self.prior.lower)

    @property
    def reference_size(self) -> float:
        """The value at x = 1: of an effect's size in an analysis of gaps, its reference size."""
        return self.prior.upper

    @property
    def fraction_precision(self) -> float:
        """Precision of the normal distribution, in fractions, that stands for prior and density."""
        return self.prior.fraction_precision if self.normal_std is None else self.std**-2

    def value(self, x: Floats) -> Floats:
        """Values of the parameter at coordinates x (...)."""
        return self.prior.at(x)

    def rate(self, x: Floats) -> Floats:
        """Derivatives of the value by x, at x (...)."""
        return self.prior.rate(x)


def select_free(case: Case, names: Sequence[str] | None) -> list[Coordinate]:
    """The named parameters, by default those with a prior; `InputError` for an unknown name."""
    known = case.parameters()
    paths = list(case.prior) if names is None else list(dict.fromkeys(names))
    if not paths:
        raise InputError(
            "nothing to identify: give [soil.prior] in the model file, or --free cohesion,..."
        )
    free = []
    for path in paths:
        if path not in known:
            raise InputError(
                f"--free {path!r}: no such parameter; {did_you_mean(path, known)}this model has: "
                f"{', '.join(known)}"
            )
        parameter, nominal = known[path]
        prior = case.prior.get(path) or _DEFAULT_PRIORS.get(path)
        if prior is None and 0.0 < nominal < parameter.upper / WIDE_BOUND:
            lower = max(nominal / ASSUMED_FACTOR, parameter.lower)
            prior = Prior(float(lower), float(nominal * ASSUMED_FACTOR), log=True)
        prior = prior or Prior(parameter.lower, parameter.upper)
        free.append(Coordinate(path, parameter.unit, prior, float(nominal), path not in case.prior))
    return free


def free_soil_parameters(case: Case, free: Sequence[str] | None) -> list[Coordinate]:
    """The soil parameters to fit: those named, else those with a prior, else the shear parameters.

    Raises `InputError` where a named parameter is one of the gear or of an effect.
    """
    selected = select_free(case, free if free is not None or case.prior else SHEAR)
    other = [c.path for c in selected if c.effect]
    if free is not None and other:
        raise InputError(f"--free {other[0]} is not a soil parameter; only those can be freed here")
    return [c for c in selected if not c.effect]


def fixed_parameters(case: Case, free: Sequence[Coordinate]) -> list[str]:
    """Soil and gear parameters that were fixed at the values of the model file.

    Beside a free kphi, kc matters with gears of several widths alone.
    """
    freed = {c.path for c in free}
    bearing = ("kphi", "n") if "kphi" in freed and not case.gears else ("kphi", "kc", "n")
    stress = ("a0", "a1") if isinstance(case.model.gear, RigidWheel) else ()
    soil = [name for name in (*SHEAR, *bearing, *stress) if name not in freed]
    return [*soil, *(path for path in case.parameters() if path.startswith(("gear.", "gears.")))]


def size_coordinate(effect: type[Effect], calibration: float | None) -> Coordinate:
    """The coordinate of an effect's size.

    `calibration` is the prior standard deviation of the size in its own unit; None: no prior.
    """
    size = effect.about.size
    parameter, unit = declared(effect)[size], effect.about.reference[size]
    lower, upper = sorted((parameter.lower / unit, parameter.upper / unit))
    own = Coordinate(f"{effect.name}.{size}", parameter.unit, Prior(0.0, unit), of_candidate=True)
    return replace(own, normal_std=calibration, lower=lower, upper=upper)


def shape_coordinates(effect: type[Effect]) -> list[Coordinate]:
    """The coordinates of an effect's shape coefficients; none where its law has no uncertainty."""
    coordinates = []
    for name in effect.law_terms if issubclass(effect, SlipLoadScaling) else ():
        std, path = SHAPE_STD[name], f"{effect.name}.{name}"
        most = min(declared(effect)[name].upper, 4.0 * std)
        scale = Coordinate(path, "1", Prior(0.0, 1.0), normal_std=std, lower=-most, upper=most)
        coordinates.append(replace(scale, is_shape=True, of_candidate=True))
    return coordinates


def values_at(coordinates: Sequence[Coordinate], x: Floats) -> Floats:
    """Values (..., p) of all parameters at coordinates x (..., p)."""
    each = [c.value(x[..., i]) for i, c in enumerate(coordinates)]
    return np.stack(each, axis=-1) if each else np.zeros((*x.shape[:-1], 0))


def rates_at(coordinates: Sequence[Coordinate], x: Floats) -> Floats:
    """Derivatives (p,) of the values by the coordinates, at x (p,)."""
    each = [float(c.rate(x[i : i + 1])[0]) for i, c in enumerate(coordinates)]
    return np.asarray(each, dtype=np.float64)
