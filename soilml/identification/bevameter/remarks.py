"""What plate and shear tests leave open, how far repeats differ, and where a law does not fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from soilml.identification.bevameter.laws import PressureSinkageFit, ShearFit
from soilml.remarks import Remark

#: Change of the exponent between the shallower and the deeper half of a curve from which the law is
#: said not to fit: the law's pressure is then wrong by 10 % within a factor of three in depth.
NOTABLE_BEND = 0.2
NOTABLE_MISFIT = 0.1  # Relative residual of a law from which it is said not to fit
#: Ratio of peak to end from which a shear curve is said to have a peak; and mobilised fraction of
#: the strength at the end below which a curve is said to rise still.
NOTABLE_PEAK, NOTABLE_RISE = 1.1, 0.9
#: Ratio of the end of a shear curve to the fitted one from which it is said to rise still.
NOTABLE_END = 1.05
#: Ratio of shear strength to normal stress, and pressure (Pa), that suggest a wrong unit; and what
#: no soil of the catalogue comes near: cohesion (Pa) and shear modulus (m).
ODD_RATIO, ODD_PRESSURE = 6.0, 500.0
ODD_COHESION, ODD_MODULUS = 3e5, 0.2
LISTED = 4  # Names that a remark lists


def _kpa(stress: float) -> str:
    """A stress in Pa as a number in kPa."""
    return f"{1e-3 * stress:.3g}"


def plate_remarks(fit: PressureSinkageFit) -> Iterator[Remark]:
    """Remarks on plate tests."""
    largest = max(float(test.stress.max()) for test in fit.tests)
    if largest < ODD_PRESSURE:
        text = f"the largest pressure is {largest:.3g} Pa, which is very little: check that it is "
        yield Remark("doubtful-unit", f"{text}in Pa, not in kPa", ("pressure_Pa",))
    deepest = max(float(test.x[-1]) for test in fit.tests)
    text = "n and the moduli trade off, so each range alone is wide; they hold down to "
    text += f"{deepest:.3g} m, the deepest test"
    yield Remark("parameters-correlated", text, ("kc", "kphi", "n"), "note")
    if not fit.several_sizes:
        size = f"{fit.sizes[0]:.3g} m"
        text = (
            f"one plate size ({size}): kc and kphi are not identifiable, only k = kc / b + kphi "
            f"for b = {size}; for another width it may differ"
        )
        yield Remark("one-plate-size", text, ("kc", "kphi"))
    elif fit.estimates()["kc"].mean_95[0] < 0.0 < fit.estimates()["kc"].mean_95[1]:
        sizes = ", ".join(f"{b:.3g}" for b in fit.sizes)
        text = (
            f"kc may be below or above zero: plates of {sizes} m "
            "differ by no more than repeats do; use kc and kphi together, at widths between these"
        )
        yield Remark("sign-uncertain", text, ("kc",))
    elif fit.moduli[0] < 0.0:
        text = (
            "kc is below zero: larger plates carry more pressure; do not use it for widths below "
        )
        yield Remark("below-zero", f"{text}{fit.sizes[0]:.3g} m", ("kc",))
    if len(fit.tests) == len(fit.sizes):
        text = "no plate test was repeated: a usual scatter of 15 % in pressure is assumed"
        yield Remark("not-repeated", text)
    halves = np.asarray([c.halves for c in fit.curves if np.isfinite(c.halves).all()])
    if halves.size and abs(np.diff(halves.mean(axis=0))[0]) > NOTABLE_BEND:
        shallow, deep = halves.mean(axis=0)
        text = (
            "the logarithms of pressure and sinkage are not on a straight line: the exponent is "
            f"{shallow:.2f} in the shallower and {deep:.2f} in the deeper half, so n depends on "
            "the depth; its range contains both"
        )
        yield Remark("exponent-depends-on-depth", text, ("n",))
    yield from _poor_fits([(t.name, c.misfit) for t, c in zip(fit.tests, fit.curves, strict=True)])
    if omitted := sum(test.omitted for test in fit.tests):
        text = f"{omitted} samples without pressure, or less deep than an earlier one, are left out"
        yield Remark("samples-omitted", text, severity="note")


def shear_remarks(fit: ShearFit) -> Iterator[Remark]:
    """Remarks on shear tests."""
    pairs = list(zip(fit.tests, fit.curves, strict=True))
    stresses = ("shear_stress_Pa", "normal_stress_Pa")
    ratio = max(c.strength / t.level for t, c in pairs)
    if ratio > ODD_RATIO:
        text = f"the shear strength is {ratio:.3g} times the normal stress: check that both are "
        yield Remark("doubtful-unit", f"{text}in Pa", stresses)
    found = fit.estimates()
    if "shear_modulus" not in found:
        text = "the tests have strengths alone, no stress over displacement: K is not measured"
        yield Remark("not-measured", text, ("shear_modulus",))
    elif found["shear_modulus"].value > ODD_MODULUS:
        text = f"K is {1e3 * found['shear_modulus'].value:.3g} mm, more than that of any soil: "
        text += "check the unit of the shear displacement"
        yield Remark("doubtful-unit", text, ("shear_displacement_m",))
    if "cohesion" not in found:
        text = (
            f"one normal stress ({_kpa(fit.stresses[0])} kPa): cohesion and friction angle are "
            f"not identifiable, only c + sigma tan(phi) = {_kpa(fit.strength.value)} kPa there"
        )
        yield Remark("one-normal-stress", text, ("cohesion", "friction_angle"))
    elif found["cohesion"].value == 0.0:
        text = "the failure line meets the axis below zero: cohesion is set to zero"
        yield Remark("below-zero", text, ("cohesion",))
    elif found["cohesion"].value > ODD_COHESION:
        text = f"the cohesion is {_kpa(found['cohesion'].value)} kPa, more than that of any soil: "
        yield Remark("doubtful-unit", f"{text}check the unit of the stresses", stresses)
    if len(fit.tests) == len(fit.stresses):
        text = (
            "no shear test was repeated: the scatter is that of the tests about the line, and a "
            "usual one of 8 % in strength"
        )
        yield Remark("not-repeated", text)
    if fit.halves:
        low, high = (
            f"{_kpa(c)} kPa and phi = {math.degrees(phi):.1f} deg" for c, phi in fit.halves
        )
        text = (
            "the failure line is curved: cohesion and friction angle depend on the normal stress, "
            f"c = {low} in the lighter half of the tests, c = {high} in the heavier; the ranges "
            "contain both"
        )
        yield Remark("curved-failure-line", text, ("cohesion", "friction_angle"))
    falls = {
        t.name: f"{t.name} {_kpa(c.peak)} to {_kpa(c.end)} kPa"
        for t, c in pairs
        if c.peak > NOTABLE_PEAK * c.end
    }
    if falls:
        text = (
            "the stress passes a peak and falls to a residual "
            f"({', '.join(list(falls.values())[:LISTED])}); the curve of Janosi and "
            "Hanamoto has none: its strength lies between. The effect shear-softening describes it"
        )
        yield Remark("peak", text, tuple(falls))
    rising = [
        t.name
        for t, c in pairs
        if c.mobilised < NOTABLE_RISE or c.end > NOTABLE_END * c.mobilised * c.strength
    ]
    if rising:
        text = (
            f"the stress still rises at the end of {_list(rising)}: strength and K depend on how "
        )
        yield Remark("still-rising", f"{text}far the test goes", tuple(rising))
    yield from _poor_fits([(t.name, c.misfit) for t, c in pairs])


def _poor_fits(misfits: Sequence[tuple[str, float]]) -> Iterator[Remark]:
    poor = {name: f"{name} ({m:.0%})" for name, m in misfits if m > NOTABLE_MISFIT}
    if poor:
        text = f"the law fits poorly, by its relative residual: {_list(list(poor.values()))}"
        yield Remark("poor-fit", text, tuple(poor))


def _list(names: Sequence[str]) -> str:
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more
