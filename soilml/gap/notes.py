"""Notes on an analysis: outliers, estimates at a bound, noise, what one channel may hide."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from soilml.errors import InputError
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import Solution
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap.scores import chi_square_tail
from soilml.gap.sentences import outliers_in_words
from soilml.identification.fit import disagreeing_soil_tests
from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Posterior
from soilml.numerics.prior import Prior
from soilml.numerics.subspaces import project_out
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import channel_name, decimal, format_quantity

LISTED_OUTLIERS = 6  # Outliers that a note lists by name
NOTABLE_NOISE_SCALE = 1.25  # Factor on the declared noise above which a note is made
#: Probability by chance below which residuals are too small for their noise.
SIGNIFICANCE = 0.01
#: Distance from a bound, as a fraction of the range, at which an estimate counts as at the bound.
AT_BOUND = 1e-3
#: Sizes of effects, in usual ones, up to which they are plausible, and the normal quantile of the
#: power with which they are found, and score from which one is, among all of the catalogue.
PLAUSIBLE_SIZE, POWER_80, DETECTED = 3.0, 0.84, 3.0
#: Changes of pull (N) and sinkage (m) below which they are not stated.
NOTABLE_CHANGE = {"drawbar_pull": 0.01, "sinkage": 1e-5}


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
    if written.hypothesis.wide_priors:
        yield from _beyond_priors(posterior.problem.case.prior, written.fit)
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


def _beyond_priors(given: Mapping[str, Prior], fit: Solution) -> Iterator[Remark]:
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
    if beyond:
        text = f"the soil in model.toml is outside the given priors: {', '.join(beyond.values())}"
        yield Remark("beyond-priors", text, tuple(beyond))


def _large_noise(posterior: Posterior, soil: Solution) -> Iterator[Remark]:
    """Notes on channels whose residuals about the soil alone are too small for their noise.

    Their squares are nearly chi-squared, with the channel's share of the degrees of freedom: a gap,
    or scatter of the soil, only makes them larger.
    """
    readings = posterior.terms.readings
    left = 1.0 - len(soil.x) / len(readings)
    for i, name in enumerate(readings.channels):
        own = readings.channel == i
        residual = (readings.measured - soil.prediction)[own] / readings.std[own]
        squares, freedom = float(residual @ residual), left * float(own.sum())
        by_chance = 1.0 - chi_square_tail(squares, freedom)
        if squares > 0.0 and by_chance < SIGNIFICANCE / len(readings.channels):
            text = (
                f"the noise of {column(name)}, with that of slip and load, is declared "
                f"{decimal(np.sqrt(freedom / squares), 2)} times too large for these rows, which "
                "hides small gaps"
            )
            yield Remark("noise-too-large", text, (column(name),))


def hidden_effect(posterior: Posterior, soil: Solution) -> Iterator[Remark]:
    """Of one channel: the effect of soil or gear that could hide in it and change the others most.

    At the size whose score is `DETECTED` with a probability of 80 %, and at most three usual sizes;
    the soil changes as far as it would to hide the effect.
    """
    effects, readings = posterior.problem.effects, posterior.terms.readings
    if len(readings.channels) != 1:
        return
    measured = readings.channels[0]
    names = tuple(n for n in ("drawbar_pull", "sinkage") if n != measured)
    white = soil.whitened_by(posterior.whiten)
    tested = {s.name: np.asarray(posterior.whiten @ s.column) for s in posterior.signatures}
    unseen = [n for n, why in posterior.untestable.items() if why.code == "no-change"]
    sizes = dict.fromkeys(unseen, PLAUSIBLE_SIZE)
    for name, own in tested.items():
        norm = float(np.linalg.norm(project_out(own[:, None], white.jacobian)))
        sizes[name] = min((DETECTED + POWER_80) / max(norm, 1e-300), PLAUSIBLE_SIZE)
    kept = {n: e for n, e in effects.items() if n in sizes and e.about.kind in ("soil", "wheel")}
    std = np.full(len(readings.row_slip) * len(names), 1e-9)
    others = Readings.of_every_row(readings.at, names, std=std)
    try:
        found, _ = effect_signatures(soil.fitted(), others, kept)
    except InputError:
        return
    rates = linearise(soil.case, soil.coordinates, soil.x, others).jacobian
    most, worst, change = 0.0, "", np.zeros(len(names))
    for s in found:
        own = s.column
        if s.name in tested:
            moved = np.linalg.solve(white.information, white.jacobian.T @ tested[s.name])
            own = own - rates @ moved
        own = np.abs(sizes[s.name] * np.nan_to_num(own))
        share = float((own / others.load)[others.channel == 0].max())
        cap = max(share, 1.0)  # no wheel pulls more than its load
        sizes[s.name] /= cap
        if share / cap > most:
            largest = [own[others.channel == i].max() / cap for i in range(len(names))]
            most, worst, change = share / cap, s.name, np.asarray(largest)
    told = [
        f"{channel_name(column(n))} by {decimal(1e3 * x if n == 'sinkage' else x, 2)} "
        f"{'mm' if n == 'sinkage' else 'N'}"
        for n, x in zip(names, change, strict=True)
        if x > NOTABLE_CHANGE[n]
    ]
    if told:
        text = (
            f"only {channel_name(column(measured))} was measured: {worst} at "
            f"{decimal(sizes[worst], 2)} times its usual size would not show, and would change "
            f"{' and '.join(told)}"
        )
        yield Remark("hidden-effect", text, (worst,), "note")
