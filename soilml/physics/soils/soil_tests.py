"""Plate and shear tests of a soil: what was measured, and what a soil predicts of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from soilml.arrays import Floats
from soilml.parameters import Parameter
from soilml.physics.soils import Soil

#: Least value, as a fraction of the measured one, that is compared with it: a soil without bearing
#: capacity or strength is as far off as one with this share of it.
LEAST_SHARE = 1e-6

#: Standard deviation of the logarithm of the quantity from place to place, and of the test.
Scatter = Annotated[float, Parameter("1", 1e-4, 3.0, "standard deviation of the logarithm")]


class SoilTest(ABC):
    """A quantity of the soil that was measured without a gear."""

    #: Name of the quantity and of the field that has its measured value, and its unit.
    quantity: ClassVar[str]
    unit: ClassVar[str] = "Pa"
    scatter: float

    @property
    def measured(self) -> float:
        """The measured value."""
        return float(getattr(self, self.quantity))

    @abstractmethod
    def predicted(self, soil: Mapping[str, Any]) -> Floats:
        """What a soil has, whose parameters (...) are given by name."""

    @abstractmethod
    def rates(self, soil: Mapping[str, Any]) -> dict[str, Floats]:
        """Derivatives of `predicted` by the soil's parameters, by name, (...) each."""

    @abstractmethod
    def label(self) -> str:
        """Quantity and circumstances in words."""

    def deviation(self, soil: Mapping[str, Any]) -> Floats:
        r"""How far a soil is from the test, in standard deviations, (...).

        .. math:: z = \ln(q / q_m) / \sigma
        """
        share = np.maximum(self.predicted(soil) / self.measured, LEAST_SHARE)
        return np.asarray(np.log(share) / self.scatter)

    def deviation_rates(self, soil: Mapping[str, Any]) -> dict[str, Floats]:
        """Derivatives of `deviation` by the soil's parameters, by name, (...) each."""
        predicted = np.maximum(self.predicted(soil), LEAST_SHARE * self.measured)
        return {name: rate / (predicted * self.scatter) for name, rate in self.rates(soil).items()}


@dataclass(frozen=True)
class PlatePressure(SoilTest):
    r"""Mean pressure under a plate at one sinkage, by :math:`p = (k_c / b + k_\varphi) z^n`.

    `plate_width` is b: the radius of a round plate, or the smaller side of a rectangular one.

    References: Bekker, Introduction to Terrain-Vehicle Systems, 1969.
    """

    quantity: ClassVar[str] = "pressure"
    plate_width: Annotated[float, Parameter("m", 1e-3, 10.0)]
    sinkage: Annotated[float, Parameter("m", 1e-5, 10.0)]
    pressure: Annotated[float, Parameter("Pa", 1.0, 1e9)]
    scatter: Scatter

    def predicted(self, soil: Mapping[str, Any]) -> Floats:
        """Pressure (Pa) under the plate."""
        modulus = soil["kc"] / self.plate_width + soil["kphi"]
        return np.asarray(modulus * self.sinkage ** soil["n"])

    def rates(self, soil: Mapping[str, Any]) -> dict[str, Floats]:
        """Derivatives of the pressure by kc, kphi and n."""
        power = np.asarray(self.sinkage ** np.asarray(soil["n"]))
        return {
            "kc": power / self.plate_width,
            "kphi": power,
            "n": self.predicted(soil) * np.log(self.sinkage),
        }

    def label(self) -> str:
        """Such as `pressure under a plate of 0.05 m at 0.02 m`."""
        return f"pressure under a plate of {self.plate_width:.3g} m at {self.sinkage:.3g} m"


@dataclass(frozen=True)
class ShearStrength(SoilTest):
    r"""Shear strength under one normal stress, by :math:`\tau = c + \sigma \tan\varphi`.

    References: Mohr-Coulomb.
    """

    quantity: ClassVar[str] = "strength"
    normal_stress: Annotated[float, Parameter("Pa", 1.0, 1e9)]
    strength: Annotated[float, Parameter("Pa", 1.0, 1e9)]
    scatter: Scatter

    def predicted(self, soil: Mapping[str, Any]) -> Floats:
        """Shear strength (Pa) under the normal stress."""
        return np.asarray(soil["cohesion"] + self.normal_stress * np.tan(soil["friction_angle"]))

    def rates(self, soil: Mapping[str, Any]) -> dict[str, Floats]:
        """Derivatives of the strength by cohesion and friction angle."""
        angle = np.asarray(soil["friction_angle"])
        return {
            "cohesion": np.ones(angle.shape),
            "friction_angle": self.normal_stress / np.cos(angle) ** 2,
        }

    def label(self) -> str:
        """Such as `strength under 8 kPa`."""
        return f"shear strength under {1e-3 * self.normal_stress:.3g} kPa"


def deviations(
    tests: Sequence[SoilTest], soil: Soil, names: Sequence[str], values: Floats
) -> Floats:
    """Deviations (..., t) of tests, for values (..., p) of the parameters `names`.

    Other parameters are those of `soil`; names that are no parameters of a soil do not matter.
    """
    known = _known(soil, names, values)
    shape = (*values.shape[:-1], 1)
    columns = [np.broadcast_to(t.deviation(known), shape[:-1])[..., None] for t in tests]
    return np.concatenate(columns, axis=-1) if columns else np.zeros((*shape[:-1], 0))


def deviation_rates(
    tests: Sequence[SoilTest], soil: Soil, names: Sequence[str], values: Floats
) -> Floats:
    """Derivatives (t, p) of the deviations by the parameters `names`, at values (p,)."""
    known = _known(soil, names, values)
    rates = [t.deviation_rates(known) for t in tests]
    return np.asarray([[float(r.get(name, 0.0)) for name in names] for r in rates]).reshape(
        len(tests), len(names)
    )


def _known(soil: Soil, names: Sequence[str], values: Floats) -> dict[str, Any]:
    own = {name: getattr(soil, name) for name in ("cohesion", "friction_angle", "kc", "kphi", "n")}
    return own | {name: values[..., i] for i, name in enumerate(names) if name in own}
