"""Warnings about predicted bands of pull and slope."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.remarks import Remark
from soilml.traction.pull_and_slope import Traction

Floats = NDArray[np.float64]

#: Extrapolation beyond the measured slips (difference) and loads (factor) that is reported.
SLIP_MARGIN, LOAD_FACTOR = 0.1, 1.25
#: Slope, rad (45 degrees), beyond which vehicles overturn.
OVERTURNING_SLOPE = 0.7854
#: What no band includes.
_NOT_INCLUDED = "all wheels equal, no load transfer, no side slope"


@dataclass(frozen=True)
class MeasuredRange:
    """Lowest and highest slip, lightest and heaviest load (N) of the rows."""

    slip: tuple[float, float]
    load: tuple[float, float]

    @staticmethod
    def of(slip: Floats, load: Floats) -> MeasuredRange:
        """Those of rows (m,)."""
        ends = ((float(v.min()), float(v.max())) for v in (slip, load))
        return MeasuredRange(*ends)


def limitations(pull_error: float | None) -> Remark:
    """What the bands include; `pull_error` is the declared error of the pull, N, if there is one.

    >>> print(limitations(0.4))
    bands include the uncertainty of the soil, the noise and errors of the model (drawbar pull 0.4 N
    before any reading); all wheels equal, no load transfer, no side slope
    """
    if pull_error is None:
        included = "the uncertainty of the soil and the noise, not errors of the model"
    else:
        error = f"drawbar pull {pull_error:.3g} N before any reading"
        included = f"the uncertainty of the soil, the noise and errors of the model ({error})"
    return Remark("band-content", f"bands include {included}; {_NOT_INCLUDED}", severity="note")


def prediction_warnings(
    prediction: Traction,
    remaining_fraction: tuple[float, float],
    measured: MeasuredRange,
    *,
    error_included: bool = False,
) -> Iterator[Remark]:
    """Warnings about a prediction; `remaining_fraction` as in `LoadPrediction`.

    `error_included` is whether the draws include a declared error of the pull.
    """
    yield from _identifiability(remaining_fraction)
    yield from _extrapolation(prediction, measured, error_included)
    failed, load = prediction.failed_fraction, prediction.load
    if failed > 0.0:
        text = f"{failed:.0%} of the soils and slips do not carry {load:.4g} N and are excluded"
        yield Remark("not-carried", text)
    if np.nanmedian(prediction.steepest_slope) > OVERTURNING_SLOPE:
        yield Remark(
            "overturning",
            "slopes beyond 45 degrees are due to cohesion under a light load: vehicles overturn "
            "earlier",
        )
    if prediction.rising_fraction > 0.5:
        yield Remark(
            "still-rising",
            f"the pull still increases at slip {prediction.slip[-1]:g}, the highest evaluated: it "
            "may be larger beyond",
        )


def _identifiability(remaining_fraction: tuple[float, float]) -> Iterator[Remark]:
    for name, fraction in zip(("largest pull", "steepest slope"), remaining_fraction, strict=True):
        width = f"its band is {min(fraction, 1.0):.0%} as wide as the prior's"
        if fraction > NOT_IDENTIFIED_ABOVE:
            text = f"the {name} is not identified by these rows: {width}; do not use it"
            yield Remark("not-identified", text, (name,))
        elif fraction > WEAKLY_IDENTIFIED_ABOVE:
            yield Remark("weakly-identified", f"the {name} is weakly identified: {width}", (name,))


def _extrapolation(
    prediction: Traction, measured: MeasuredRange, error_included: bool
) -> Iterator[Remark]:
    error = "may be larger here than [discrepancy] says" if error_included else "is not in the band"
    note = f"extrapolated by the model, whose error {error}"
    low, high = measured.slip
    if prediction.slip[-1] > high + SLIP_MARGIN:
        text = f"no slip above {high:.2g} was measured: {note}"
        yield Remark("extrapolated", text)
    if prediction.slip[0] < low - SLIP_MARGIN:
        text = f"no slip below {low:.2g} was measured: {note}"
        yield Remark("extrapolated", text)
    load, (light, heavy) = prediction.load, measured.load
    if load > LOAD_FACTOR * heavy:
        text = f"no load above {heavy:.3g} N was measured, predicted is {load:.3g} N: {note}"
        yield Remark("extrapolated", text)
    if load < light / LOAD_FACTOR:
        text = f"no load below {light:.3g} N was measured, predicted is {load:.3g} N: {note}"
        yield Remark("extrapolated", text)
