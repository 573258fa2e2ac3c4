"""Notes on a fit: estimates at a bound, effects of an unusual size, noise that is too large."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from soilml.fitting.coordinates import Coordinate
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.repeats import SIGNIFICANCE, chi_square_tail
from soilml.inference.constants import LARGEST_SIZE
from soilml.inference.posterior import Posterior
from soilml.numerics.prior import Prior
from soilml.numerics.subspaces import ROUNDING, column_space
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal, format_quantity

#: Distance from a bound, as a fraction of the range, at which an estimate counts as at the bound.
AT_BOUND = 1e-3


def bound_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[Remark]:
    """Notes on what model.toml has at the end of a prior, with the effects that it contains."""
    effects = dict.fromkeys(c.effect for c in coordinates if c.effect)
    of_model = f"in model.toml ({' + '.join(effects) or 'the soil alone'})"
    at_bound = [
        c.path
        for c, value in zip(coordinates, x, strict=True)
        if not c.effect and min(value, 1.0 - value) < AT_BOUND
    ]
    several = len(at_bound) > 1
    verb, its = ("are", "their") if several else ("is", "its")
    prior, interval = ("priors", "intervals") if several else ("prior", "interval")
    text = (
        f"{', '.join(at_bound)} {of_model} {verb} at a bound of {its} {prior}: soilml identify has "
        f"{its} {interval}"
    )
    notes = [Remark("at-bound", text, tuple(at_bound))] if at_bound else []
    for c, size in zip(coordinates, x, strict=True):
        if c.effect and size > c.upper - AT_BOUND * (c.upper - c.lower):
            notes.append(
                Remark("at-bound", f"{c.path} {of_model} is at its upper bound", (c.path,))
            )
    return notes


def beyond_priors_notes(given: Mapping[str, Prior], fit: Solution) -> list[Remark]:
    """A note on a soil in model.toml that the given priors, by path, exclude."""
    values, beyond = fit.values(), {}
    for c in fit.coordinates:
        value, prior = values[c.path], given.get(c.path)
        if c.effect or (prior is not None and prior.lower <= value <= prior.upper):
            continue
        where = f"given as {format_quantity(c.nominal, c.unit)}"
        if prior is not None:
            ends = (format_quantity(end, c.unit) for end in (prior.lower, prior.upper))
            where = f"prior {' to '.join(ends)}"
        beyond[c.path] = f"{c.name.replace('_', ' ')} {format_quantity(value, c.unit)} ({where})"
    text = f"the soil in model.toml is outside the given priors: {', '.join(beyond.values())}"
    return [Remark("beyond-priors", text, tuple(beyond))] if beyond else []


def size_notes(coordinates: Sequence[Coordinate], x: Sequence[float]) -> list[Remark]:
    """Notes on effects that would have to be far larger than they usually are."""
    notes = []
    for c, size in zip(coordinates, x, strict=True):
        if c.effect and not c.is_shape and abs(size) > LARGEST_SIZE:
            value, usual = c.prior.at(np.asarray([size, 1.0]))
            text = (
                f"{c.name} of {c.effect} would have to be {format_quantity(value, c.unit)}, "
                f"{abs(size):.3g} times its usual size ({format_quantity(usual, c.unit)})"
            )
            notes.append(Remark("implausible-size", text, (c.effect,)))
    return notes


def large_noise_notes(posterior: Posterior, soil: Solution) -> list[Remark]:
    r"""Notes on channels whose residuals about the soil alone are too small for their noise.

    With the residuals r in standard deviations of the readings and :math:`A = I - H`, the
    projection out of what the soil explains, the squares of channel c are, under that noise, nearly
    a multiple of chi-squared,

    .. math::
        r_c^T r_c \sim \frac{\mathrm{tr} A_{cc}^2}{\mathrm{tr} A_{cc}} \chi^2_k, \quad
        k = \frac{(\mathrm{tr} A_{cc})^2}{\mathrm{tr} A_{cc}^2}

    A gap, or scatter of the soil, makes them larger. None are made where neighbouring samples are
    correlated, for such noise is in part explained by the soil.

    References: Satterthwaite, Biometrics Bulletin 2, 1946.
    """
    readings = posterior.terms.readings
    if posterior.noise.autocorrelation > 0.0:
        return []
    std = readings.std
    basis = column_space(soil.derivatives / std[:, None], relative_tolerance=ROUNDING)
    residual = (readings.measured - soil.prediction) / std
    residual = residual - basis @ (basis.T @ residual)
    notes = []
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        projection = np.eye(int(own.sum())) - basis[own] @ basis[own].T
        expected, spread = float(np.trace(projection)), float(np.sum(projection**2))
        squares = float(np.sum(residual[own] ** 2))
        if squares <= 0.0 or spread <= 0.0:
            continue
        by_chance = 1.0 - chi_square_tail(squares * expected / spread, expected**2 / spread)
        if by_chance < SIGNIFICANCE / len(readings.channels):
            text = (
                f"the noise of {column(name)}, with that of slip and load, is declared "
                f"{decimal(np.sqrt(expected / squares), 2)} times too large for these rows, which "
                "hides small gaps"
            )
            notes.append(Remark("noise-too-large", text, (column(name),)))
    return notes
