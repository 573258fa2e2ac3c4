"""The result of plate and shear tests, and its picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from soilml.identification.bevameter.laws import PressureSinkageFit, ShearFit
from soilml.identification.bevameter.scatter import SpreadEstimate
from soilml.numerics.prior import Prior
from soilml.physics.soils.soil_tests import SoilTest
from soilml.remarks import Remark
from soilml.report.figure_style import short_label
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result

LISTED = 6  # Tests that a legend lists


@dataclass(frozen=True, repr=False)
class BevameterResult(Result):
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
    remarks: tuple[Remark, ...]
    tests: tuple[SoilTest, ...] = ()

    def estimates(self) -> dict[str, SpreadEstimate]:
        """What the tests determine, by name; `k` is kc / b + kphi for the one width tested."""
        found: dict[str, SpreadEstimate] = {}
        for fit in (self.plates, self.shear):
            found |= fit.estimates() if fit is not None else {}
        return found

    def report(self) -> Report:
        """What the tests determine, with ranges, beside their curves."""
        found = self.estimates()
        values, units = [e.value for e in found.values()], [e.unit for e in found.values()]
        mean = [e.mean_95 for e in found.values()]
        place = [e.another_place_95 for e in found.values()]
        columns = [
            Column("parameter", list(found)),
            Column("value", values, units, digits=3),
            Column.of_ranges("95 % of the mean", mean, units, values),
            Column.of_ranges("95 % elsewhere", place, units, values),
        ]
        tests = sum(len(fit.tests) for fit in (self.plates, self.shear) if fit is not None)
        names = ", ".join(name.replace("_", " ") for name in found)
        open_ = self.shear is not None and self.shear.shear_modulus is None
        verdict = f"{tests} tests determine {names}."
        drawings: list[Callable[[Any], None]] = []
        if self.plates is not None:
            drawings.append(partial(_draw_plates, fit=self.plates))
        if self.shear is not None:
            drawings += [] if open_ else [partial(_draw_curves, fit=self.shear)]
            drawings.append(partial(_draw_strengths, fit=self.shear))
        count, size = len(drawings), (4.6 * len(drawings), 3.9)
        return Report(
            kind="bevameter",
            verdict=verdict,
            lines=["The shear modulus was not measured."] if open_ else [],
            tables=[ReportTable("Soil by tests", columns, "Elsewhere: another place.")],
            pictures=[
                Picture(
                    "Tests", partial(_draw, drawings), 1, count, size, verdict,
                    "Dots: measured. Thin lines: fitted to each test. Thick lines: the result.",
                )
            ],
            remarks=self.remarks,
            title="Soil of plate and shear tests",
        )  # fmt: skip

    def frame_columns(self) -> dict[str, Any]:
        """A row for each parameter: value, unit, 95 % of the mean and at another place."""
        found = self.estimates()
        return {
            "parameter": list(found),
            "value": [e.value for e in found.values()],
            "unit": [e.unit for e in found.values()],
        } | {
            f"{name}_{end}": [getattr(e, f"{name}_95")[i] for e in found.values()]
            for name in ("mean", "another_place")
            for i, end in enumerate(("p025", "p975"))
        }

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml bevameter --out FILE.json` writes."""
        return {
            "estimates": {name: e.as_json() for name, e in self.estimates().items()},
            "soil": self.soil,
            "prior": {name: prior.as_setting() for name, prior in self.prior.items()},
            "tests": [asdict(test) for test in self.tests],  # type: ignore[call-overload]
            "remarks": [remark.as_json() for remark in self.remarks],
            "plate_tests": [
                {
                    "test": test.name,
                    "plate_m": test.level,
                    "n": curve.exponent,
                    "k": math.exp(curve.log_pressure) * plates.depth**-curve.exponent,
                    "misfit": curve.misfit,
                }
                for plates in filter(None, [self.plates])
                for test, curve in zip(plates.tests, plates.curves, strict=True)
            ],
            "shear_tests": [
                {
                    "test": test.name,
                    "normal_stress_Pa": test.level,
                    "strength_Pa": curve.strength,
                    "shear_modulus_m": curve.modulus if test.has_curve else None,
                    "misfit": curve.misfit,
                }
                for shear in filter(None, [self.shear])
                for test, curve in zip(shear.tests, shear.curves, strict=True)
            ],
        }


def _draw(drawings: Sequence[Callable[[Any], None]], axes: Any) -> None:
    for panel, drawing in zip(np.ravel(axes), drawings, strict=True):
        drawing(panel)
        if len(panel.get_legend_handles_labels()[1]) <= LISTED:
            panel.legend()


def _draw_plates(panel: Any, fit: PressureSinkageFit) -> None:
    kc, kphi = fit.moduli
    for test, curve in zip(fit.tests, fit.curves, strict=True):
        (dots,) = panel.loglog(1e3 * test.x, 1e-3 * test.stress, ".", label=short_label(test.name))
        own = np.exp(curve.log_pressure) * (test.x / fit.depth) ** curve.exponent
        panel.loglog(1e3 * test.x, 1e-3 * own, color=dots.get_color(), linewidth=0.8)
    depth = np.geomspace(min(t.x[0] for t in fit.tests), max(t.x[-1] for t in fit.tests))
    for size in fit.sizes:
        law = (kc / size + kphi) * depth ** fit.draws.value[2]
        panel.loglog(1e3 * depth, 1e-3 * law, color="black", linewidth=2.0, alpha=0.6)
    panel.set_xlabel("sinkage, mm")
    panel.set_ylabel("pressure, kPa")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")


def _draw_curves(panel: Any, fit: ShearFit) -> None:
    for test, curve in zip(fit.tests, fit.curves, strict=True):
        shown = np.isfinite(test.x)
        if not shown.any():
            continue
        j = test.x[shown]
        (dots,) = panel.plot(1e3 * j, 1e-3 * test.stress[shown], ".", label=short_label(test.name))
        grid = np.linspace(0.0, float(j.max()), 200)
        own = curve.strength * -np.expm1(-grid / curve.modulus)
        panel.plot(1e3 * grid, 1e-3 * own, color=dots.get_color(), linewidth=0.8)
    panel.set_xlabel("shear displacement, mm")
    panel.set_ylabel("shear stress, kPa")


def _draw_strengths(panel: Any, fit: ShearFit) -> None:
    sigma = np.asarray([test.level for test in fit.tests])
    strength = np.asarray([curve.strength for curve in fit.curves])
    panel.plot(1e-3 * sigma, 1e-3 * strength, "o", label="strength of each test")
    if fit.several_stresses:
        grid = np.linspace(0.0, 1.05 * float(sigma.max()), 50)
        line = fit.draws.value[0] + grid * fit.draws.value[1]
        panel.plot(1e-3 * grid, 1e-3 * line, color="black", linewidth=2.0, alpha=0.6)
    panel.set_xlim(left=0.0)
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("normal stress, kPa")
    panel.set_ylabel("shear strength, kPa")
