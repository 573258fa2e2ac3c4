"""Pictures of plate and shear tests with the fitted laws."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.identification.bevameter.pressure_sinkage import PressureSinkageFit
from soilml.identification.bevameter.result import BevameterResult
from soilml.identification.bevameter.shear_strength import ShearFit
from soilml.io.atomic_files import atomic_output
from soilml.report.figure_style import save_png, short_label, take_axes

#: Tests that a legend lists.
LISTED = 6


def save_picture(path: str | os.PathLike[str], result: BevameterResult) -> None:
    """Write a PNG file: pressure against sinkage, shear curves, and strengths with their line.

    Dots are measured, thin lines fitted to each test, thick lines the law of the result.
    """
    with atomic_output(path) as part:
        save_png(partial(plot_tests, result), 1, _panels(result), _size(result), part)


def plot_tests(result: BevameterResult, ax: Any) -> NDArray[Any]:
    """Draw the tests into axes (panels,); see `BevameterResult.plot`."""
    axes = take_axes(ax, 1, _panels(result), _size(result))[0]
    panels = list(axes)
    if result.plates is not None:
        _draw_plates(panels.pop(0), result.plates)
    if result.shear is not None:
        _draw_curves(panels[0], result.shear)
        _draw_strengths(panels[1], result.shear)
    return np.asarray(axes)


def _panels(result: BevameterResult) -> int:
    return (result.plates is not None) + 2 * (result.shear is not None)


def _size(result: BevameterResult) -> tuple[float, float]:
    return 4.6 * _panels(result), 3.9


def _draw_plates(panel: Any, fit: PressureSinkageFit) -> None:
    kc, kphi = fit.moduli
    for test, curve in zip(fit.tests, fit.curves, strict=True):
        (dots,) = panel.loglog(
            1e3 * test.sinkage, 1e-3 * test.pressure, ".", label=short_label(test.name)
        )
        own = np.exp(curve.log_pressure) * (test.sinkage / fit.depth) ** curve.exponent
        panel.loglog(1e3 * test.sinkage, 1e-3 * own, color=dots.get_color(), linewidth=0.8)
    depth = np.geomspace(
        min(t.sinkage[0] for t in fit.tests), max(t.sinkage[-1] for t in fit.tests)
    )
    for size in fit.sizes:
        law = (kc / size + kphi) * depth**fit.exponent
        panel.loglog(1e3 * depth, 1e-3 * law, color="black", linewidth=2.0, alpha=0.6)
    panel.set_xlabel("sinkage, mm")
    panel.set_ylabel("pressure, kPa")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("")
    _finish(panel, len(fit.tests))


def _draw_curves(panel: Any, fit: ShearFit) -> None:
    for test, curve in zip(fit.tests, fit.curves, strict=True):
        shown = np.isfinite(test.displacement)
        j = test.displacement[shown]
        (dots,) = panel.plot(1e3 * j, 1e-3 * test.stress[shown], ".", label=short_label(test.name))
        grid = np.linspace(0.0, float(j.max()), 200)
        own = curve.strength * -np.expm1(-grid / curve.modulus)
        panel.plot(1e3 * grid, 1e-3 * own, color=dots.get_color(), linewidth=0.8)
    panel.set_xlabel("shear displacement, mm")
    panel.set_ylabel("shear stress, kPa")
    _finish(panel, len(fit.tests))


def _draw_strengths(panel: Any, fit: ShearFit) -> None:
    sigma = np.asarray([test.normal_stress for test in fit.tests])
    strength = np.asarray([curve.strength for curve in fit.curves])
    panel.plot(1e-3 * sigma, 1e-3 * strength, "o", label="strength of each test")
    if fit.cohesion is not None and fit.friction_angle is not None:
        grid = np.linspace(0.0, 1.05 * float(sigma.max()), 50)
        line = fit.cohesion.value + grid * np.tan(fit.friction_angle.value)
        panel.plot(1e-3 * grid, 1e-3 * line, color="black", linewidth=2.0, alpha=0.6)
    panel.set_xlim(left=0.0)
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("normal stress, kPa")
    panel.set_ylabel("shear strength, kPa")
    _finish(panel, 1)


def _finish(panel: Any, tests: int) -> None:
    panel.grid(alpha=0.3)
    if tests <= LISTED:
        panel.legend(fontsize=8)
