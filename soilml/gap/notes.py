"""Notes on an analysis: outliers, bounds, noise, and what these runs cannot tell apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from soilml.fitting.least_squares import Solution
from soilml.gap.results import GapReport
from soilml.gap.sentences import outliers_in_words
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import decimal

LISTED_OUTLIERS = 6  # Outliers that a note lists by name
NOTABLE_NOISE_SCALE = 1.25  # Factor on the declared noise above which a note is made
#: Probability by chance below which residuals are too small for their noise.
SIGNIFICANCE = 0.01
#: Distance from a bound, as a fraction of the range, at which an estimate counts as at the bound.
AT_BOUND = 1e-3
#: Change of the readings by an effect of usual size, in sigma, from which it is visible on a known
#: soil, and what another soil leaves of it, below which it is not.
VISIBLE, UNSEEN = 6.0, 2.0


def analysis_notes(
    posterior: Posterior, alone: Solution, written: Explanation, place: Callable[[int], str]
) -> Iterator[Remark]:
    """Notes on outliers, tests, estimates at a bound and noise.

    alone: The soil alone, fitted under noise and scatter.
    written: What model.toml contains.
    place: The file and line of a row.
    """
    readings, terms = posterior.terms.readings, posterior.terms
    if names := outlier_names(posterior, place):
        text = f"{outliers_in_words(len(names))} excluded: {', '.join(names[:LISTED_OUTLIERS])}"
        yield Remark("outliers", text, names)
    for text in (
        disagreeing_soil_tests(alone.case, alone.values()) if posterior.no_gap < 0.5 else ()
    ):
        yield Remark(
            "soil-test",
            f"with the soil alone, the rows disagree with a test of the soil: {text}; part of the "
            "gap lies there, unless the test was made on another soil",
        )
    pairs = zip(written.fit.coordinates, written.fit.x, strict=True)
    ends = [c.path for c, x in pairs if not c.effect and min(x, 1.0 - x) < AT_BOUND]
    if ends:
        effects = " + ".join(written.hypothesis.effects) or "the soil alone"
        text = f"in model.toml ({effects}), {', '.join(ends)} at a bound of the prior: soilml "
        yield Remark("at-bound", f"{text}identify has the interval", tuple(ends))
    for name, scale in zip(readings.channels, terms.noise_scale(posterior.noise), strict=True):
        if scale > NOTABLE_NOISE_SCALE:
            text = (
                f"residuals of {column(name)} about the likeliest explanation, beside smooth "
                f"functions, are {scale:.2g} times the declared noise: noise, or a law that "
                "changes fast with slip"
            )
            yield Remark("noise-scaled", text, (column(name),))
    if (rho := posterior.noise.autocorrelation) == 0.0:
        yield from _large_noise(posterior, alone)
    else:
        text = f"noise of neighbouring samples of a run is correlated ({rho:.2g}): they weigh less"
        yield Remark("autocorrelated", text, severity="note")


def outlier_names(posterior: Posterior, place: Callable[[int], str]) -> tuple[str, ...]:
    """The readings that stray, by channel and place."""
    readings = posterior.terms.readings
    return tuple(
        f"{column(readings.channels[readings.channel[i]])} at {place(int(readings.row[i]))}"
        for i in np.flatnonzero(posterior.outliers)
    )


def _large_noise(posterior: Posterior, soil: Solution) -> Iterator[Remark]:
    """Notes on channels whose residuals about the soil alone are too small for their noise.

    Their squares are nearly chi-squared, with the channel's share of the degrees of freedom: a gap,
    or scatter of the soil, only makes them larger.
    """
    from scipy.special import chdtr

    readings = posterior.terms.readings
    left = 1.0 - len(soil.x) / len(readings)
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        residual = (readings.measured - soil.prediction)[own] / readings.std[own]
        squares, freedom = float(residual @ residual), left * float(own.sum())
        by_chance = float(chdtr(freedom, squares))
        if squares > 0.0 and by_chance < SIGNIFICANCE / len(readings.channels):
            text = (
                f"the noise of {column(name)}, with that of slip and load, is declared "
                f"{decimal(np.sqrt(freedom / squares), 2)} times too large for these rows, which "
                "hides small gaps"
            )
            yield Remark("noise-too-large", text, (column(name),))


def indistinct(report: GapReport, posterior: Posterior, fixed: Sequence[str]) -> list[Remark]:
    """Conclusions that these runs do not support, since something else would look the same.

    fixed: Names of parameters that were fixed.
    """
    found = like_another_soil(posterior, posterior.soil.fit)
    found += like_another_force(posterior, report.first)
    if fixed and report.status not in ("no-gap", "undecided"):
        text = (
            f"that {', '.join(fixed)} in the model file are correct: they were fixed. An error in "
            "them appears as an effect: free them with a prior or with --free"
        )
        found.append(Remark("fixed-parameters", text, tuple(fixed)))
    return found


def like_another_soil(posterior: Posterior, soil: Solution) -> list[Remark]:
    r"""The effects of usual size that a change of the soil imitates.

    .. math:: \Delta x = (X^T V^{-1} X + P)^{-1} X^T V^{-1} s

    with the signature s, the Jacobian X of the soil and its prior precision P: what is left, in
    sigma, is the norm of :math:`s - X \Delta x`. References: omitted variables; Greene,
    Econometric Analysis, 7th ed., section 4.3.2.
    """
    soil, alike = soil.whitened_by(posterior.whiten), []
    for s in posterior.search.signatures.get((), []):
        whole = np.asarray(posterior.whiten @ s.column)
        change = np.linalg.solve(soil.information, soil.jacobian.T @ whole)
        left = float(np.linalg.norm(whole - soil.jacobian @ change))
        if float(np.linalg.norm(whole)) >= VISIBLE and left < UNSEEN:
            alike.append(s.name)
    if not alike:
        return []
    text = f"that there is no {' or '.join(alike)}: at usual size, another soil would look the same"
    return [Remark("like-another-soil", text, tuple(alike))]


def like_another_force(posterior: Posterior, names: Sequence[str]) -> list[Remark]:
    """Of the effects of a cause, those that change the drawbar pull alone, where more was measured.

    Any force along the travel direction has such a signature, by whatever law it grows.
    """
    if len(posterior.terms.readings.channels) == 1:
        return []
    text = (
        "that {} is the force that is missing: it changes the drawbar pull alone, as the drag of a "
        "cable or of the carriage does"
    )
    return [
        Remark("like-another-force", text.format(name), (name,))
        for name in names
        if posterior.only_channel.get(name) == "drawbar_pull"
        and posterior.problem.effects[name].about.kind != "sensor"
    ]
