"""The result of plate and shear tests."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from numpy.typing import NDArray

from soilml.identification.bevameter.estimate import SpreadEstimate
from soilml.identification.bevameter.pressure_sinkage import PressureSinkageFit
from soilml.identification.bevameter.shear_strength import ShearFit
from soilml.numerics.prior import Prior
from soilml.physics.soils.soil_tests import SoilTest


@dataclass(frozen=True)
class BevameterResult:
    """What plate and shear tests say of a soil, made by `bevameter`.

    Attributes
    ----------
    plates, shear
        The fits; None where there were no such tests.
    soil
        Values for [soil] of a model file, by name.
    prior
        Ranges for [soil.prior], by name: 95 % at another place of the soil, or wider where the
        tests leave a parameter open.
    remarks
        What the tests cannot tell, how far repeats differ, and where a law does not fit.
    tests
        For [[soil.test]]: what the tests determine best, the pressure at one depth and the strength
        under one normal stress, with the scatter from place to place.
    """

    plates: PressureSinkageFit | None
    shear: ShearFit | None
    soil: dict[str, float]
    prior: dict[str, Prior]
    remarks: tuple[str, ...]
    tests: tuple[SoilTest, ...] = ()

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine, by name; `k` is kc / b + kphi for the one width tested."""
        found: dict[str, SpreadEstimate] = {}
        for fit in (self.plates, self.shear):
            found |= fit.estimates() if fit is not None else {}
        return found

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw pressure against sinkage, shear curves, and strengths with their line.

        Dots are measured, thin lines fitted to each test, thick lines the law of the result.

        Parameters
        ----------
        ax
            Axes of matplotlib: one for plate tests and two for shear tests; by default a new
            figure.

        Returns
        -------
        ndarray of Axes, shape (panels,)

        Raises
        ------
        InputError
            For another number of axes.
        """
        from soilml.identification.bevameter.plot import plot_tests

        return plot_tests(self, ax)

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml bevameter --json` writes."""
        return {
            "estimates": {name: e.as_json() for name, e in self.estimates().items()},
            "soil": self.soil,
            "prior": {name: prior.as_setting() for name, prior in self.prior.items()},
            "tests": [asdict(test) for test in self.tests],  # type: ignore[call-overload]
            "remarks": list(self.remarks),
            "plate_tests": [] if self.plates is None else _plate_entries(self.plates),
            "shear_tests": [] if self.shear is None else _shear_entries(self.shear),
        }


def _plate_entries(fit: PressureSinkageFit) -> list[dict[str, Any]]:
    return [
        {
            "test": test.name,
            "plate_m": test.size,
            "n": curve.exponent,
            "k": math.exp(curve.log_pressure) * fit.depth**-curve.exponent,
            "misfit": curve.misfit,
        }
        for test, curve in zip(fit.tests, fit.curves, strict=True)
    ]


def _shear_entries(fit: ShearFit) -> list[dict[str, Any]]:
    return [
        {
            "test": test.name,
            "normal_stress_Pa": test.normal_stress,
            "strength_Pa": curve.strength,
            "shear_modulus_m": curve.modulus,
            "misfit": curve.misfit,
        }
        for test, curve in zip(fit.tests, fit.curves, strict=True)
    ]
