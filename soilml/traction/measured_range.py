"""Slips and loads that were measured, those asked for, and what the bands there include."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.quantities import QUANTITIES
from soilml.remarks import Remark
from soilml.report.numbers import format_quantity
from soilml.traction.draws import DrawnErrors

#: Extrapolation beyond the measured slips (difference) and loads (factor) that is reported.
SLIP_MARGIN, LOAD_FACTOR = 0.1, 1.25
#: Relative difference up to which loads of rows count as equal: noise of a nominal load.
SAME_LOAD = 0.1
MOST_LOADS = 3  # Number of loads predicted by default: the lightest, one between, the heaviest
#: Default highest slip where no row has a higher one, and number of slips of a curve.
DEFAULT_SLIP_LIMIT, SLIPS = 0.6, 12


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


def band_content(before: DrawnErrors | None, beside: str) -> Remark:
    """What the bands include, with the errors `before` any reading, and what they do not.

    >>> print(band_content(None, "no side slope"))
    bands include the uncertainty of the soil and the noise, not errors of the model; no side slope
    """
    included = "the uncertainty of the soil and the noise, not errors of the model"
    if before is not None:
        names = list(dict.fromkeys(name for name, _ in before.functions))
        sizes = [format_quantity(before.amplitude(n), QUANTITIES[n].unit, digits=3) for n in names]
        said = [f"{n.replace('_', ' ')} {size}" for n, size in zip(names, sizes, strict=True)]
        included = (
            "the uncertainty of the soil, the noise and errors of the model "
            f"({', '.join(said)} before any reading)"
        )
    return Remark("band-content", f"bands include {included}; {beside}", severity="note")


def extrapolations(
    slip: Floats, load: Floats, measured: MeasuredRange, error_included: bool
) -> Iterator[Remark]:
    """Remarks on slips and loads (N) of a prediction beyond those of the rows."""
    error = "may be larger here than stated" if error_included else "is not in the band"
    (low, high), (light, heavy) = measured.slip, measured.load
    for what, unit, asked, ends, (least, most) in (
        ("slip", "", slip, measured.slip, (low - SLIP_MARGIN, high + SLIP_MARGIN)),
        ("load", " N", load, measured.load, (light / LOAD_FACTOR, heavy * LOAD_FACTOR)),
    ):
        lowest, highest = float(np.min(asked)), float(np.max(asked))
        for outside, word, end, value in (
            (highest > most, "above", ends[1], highest),
            (lowest < least, "below", ends[0], lowest),
        ):
            if outside:
                text = (
                    f"no {what} {word} {end:.3g}{unit} was measured, predicted is "
                    f"{value:.3g}{unit}: extrapolated by the model, whose error {error}"
                )
                yield Remark("extrapolated", text)


def measured_loads(load: Floats) -> list[float]:
    """The loads (N) of rows, groups of equal ones as their mean, at most `MOST_LOADS`."""
    ordered = np.sort(load)
    groups = np.split(ordered, 1 + np.flatnonzero(np.diff(ordered) > SAME_LOAD * ordered[1:]))
    means = [float(group.mean()) for group in groups]
    index = np.linspace(0, len(means) - 1, min(len(means), MOST_LOADS)).round().astype(int)
    return [means[i] for i in index]


def slip_grid(limit: float | None, measured: MeasuredRange) -> Floats:
    """Slips (m,) up to a limit; by default to the highest measured slip, at least to 0.6.

    Raises `InputError` for a limit that is not between 0 and 1.
    """
    if limit is not None and not 0.0 < limit < 1.0:
        raise InputError(f"slip limit {limit:g}; needed is a slip between 0 and 1")
    top = max(DEFAULT_SLIP_LIMIT, measured.slip[1]) if limit is None else limit
    return np.asarray(top * np.arange(1, SLIPS + 1) / SLIPS)
