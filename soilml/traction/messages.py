"""What a user should know of a band of pull before trusting a vehicle to it, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import NOT_IDENTIFIED_ABOVE, WEAKLY_IDENTIFIED_ABOVE
from soilml.traction.pull_and_slope import Traction

Floats = NDArray[np.float64]

#: How far beyond the slips that were driven, and by which factor beyond the loads, is far.
FAR_SLIP, FAR_LOAD = 0.1, 1.25
#: Slope (rad) past which no vehicle stands.
TIPS = 0.7854
#: What no band holds, whatever was measured.
NEVER = (
    "bands hold what soil and noise leave open, not errors of the model; all wheels alike, no "
    "load transfer, no side slope"
)


@dataclass(frozen=True)
class DrivenRange:
    """Lowest and highest slip, lightest and heaviest load (N) of the rows."""

    slip: tuple[float, float]
    load: tuple[float, float]

    @staticmethod
    def of(slip: Floats, load: Floats) -> DrivenRange:
        """Those of rows (m,)."""
        ends = ((float(v.min()), float(v.max())) for v in (slip, load))
        return DrivenRange(*ends)


def warnings(known: Traction, left: tuple[float, float], driven: DrivenRange) -> Iterator[str]:
    """Everything to doubt of a prediction; `left` is the width of its bands over the prior's."""
    yield from _learned(left)
    yield from _beyond(known, driven)
    if known.sunk > 0.0:
        yield f"{known.sunk:.0%} of the soils and slips do not carry {known.load:.4g} N: left out"
    if np.nanmedian(known.steepest) > TIPS:
        yield "past 45 degrees the slope rests on cohesion under a light gear: vehicles tip before"
    if known.rising > 0.5:
        yield (
            f"the pull still rises at slip {known.slip[-1]:g}, the highest looked at: "
            "the gear may pull more beyond it"
        )


def _learned(left: tuple[float, float]) -> Iterator[str]:
    for name, share in zip(("largest pull", "steepest slope"), left, strict=True):
        wide = f"its band is {min(share, 1.0):.0%} as wide as the prior's"
        if share > NOT_IDENTIFIED_ABOVE:
            yield f"the {name} is not known: {wide}, the rows tell nothing of it; do not use it"
        elif share > WEAKLY_IDENTIFIED_ABOVE:
            yield f"the {name} is hardly known: {wide}"


def _beyond(known: Traction, driven: DrivenRange) -> Iterator[str]:
    model = "there the model alone speaks, and its error is not in the band"
    low, high = driven.slip
    if known.slip[-1] > high + FAR_SLIP:
        yield f"no slip above {high:.2g} was driven: {model}"
    if known.slip[0] < low - FAR_SLIP:
        yield f"no slip below {low:.2g} was driven: {model}"
    light, heavy = driven.load
    if known.load > FAR_LOAD * heavy:
        yield f"no load above {heavy:.3g} N was driven, asked is {known.load:.3g} N: {model}"
    if known.load < light / FAR_LOAD:
        yield f"no load below {light:.3g} N was driven, asked is {known.load:.3g} N: {model}"
