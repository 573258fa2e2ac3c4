"""What speaks for and against agreement: misfit, granted scatter, trends, what may hide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import Solution
from soilml.fitting.misfit import (
    declared_misfit,
    excess_residuals,
    excess_residuals_remark,
    misfit_limit,
)
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap.evidence.order_trend import TREND_LEVEL
from soilml.gap.report.results import NoiseAgreement, SoilTrend
from soilml.gap.verdict.decision import OUTSIDE_PRIORS
from soilml.inference.constants import PRESSED, SCATTER_UNITS
from soilml.inference.posterior import Posterior
from soilml.numerics.subspaces import project_out
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import channel_name, decimal, format_quantity

#: Sizes of effects, in usual ones, up to which they are plausible, and the normal quantile of the
#: power with which they are found, and score from which one is, among all of the catalogue.
PLAUSIBLE_SIZE, POWER_80, DETECTED = 3.0, 0.84, 3.0
#: Changes of pull (N) and sinkage (m) below which they are not stated.
NOTABLE_CHANGE = {"drawbar_pull": 0.01, "sinkage": 1e-5}


def noise_agreement(
    case: Case,
    readings: Readings,
    soil: Sequence[Coordinate],
    posterior: Posterior,
    alone: Solution,
) -> NoiseAgreement | None:
    """The misfit under the declared noise, and under noise and scatter, of the same readings.

    readings: All readings as declared; those that stray count in neither. None where no fit is
    possible.
    alone: The soil alone under noise and scatter.
    """
    kept = ~posterior.outliers
    found = declared_misfit(case, readings.subset(kept), soil, alone.x)
    if found is None:
        return None
    units = SCATTER_UNITS["friction_angle"], SCATTER_UNITS["bearing"]
    angle, bearing = posterior.terms.scatter(posterior.noise) * units
    left = max(int(kept.sum()) - len(soil), 1)
    return NoiseAgreement(
        declared=found.per_freedom,
        exceeds_noise=found.exceeds_noise,
        granted=alone.cost / left,
        friction_angle_std=float(angle),
        bearing_std=float(bearing),
        with_discrepancy=bool(case.discrepancy),
    )


def misfit_remarks(
    found: NoiseAgreement | None, case: Case, posterior: Posterior, alone: Solution
) -> list[Remark]:
    """Residuals beyond the declared noise that scatter does not account for.

    Where the noise that the residuals show, rough in slip, alone accounts for them, the priors are
    not doubted.
    """
    if found is None or not found.exceeds_noise:
        return []
    readings = posterior.terms.readings
    left = max(len(readings) - len(posterior.problem.soil), 1)
    if found.grants_scatter and found.granted <= misfit_limit(left):
        return []
    factor = float(np.sqrt(found.declared))
    scale = posterior.terms.noise_scale(posterior.noise)[readings.channel]
    noisier = found.declared / float(np.mean(scale**2)) <= misfit_limit(left)
    if not noisier and (pressed := pressed_priors(alone)):
        text = (
            f"{excess_residuals(factor, bool(case.discrepancy))} with "
            f"{'; '.join(pressed.values())}: widen these priors in [soil.prior], or the model "
            "lacks an effect, or the noise is understated"
        )
        return [Remark("soil-at-prior", text, tuple(pressed))]
    consequence = "no scatter from run to run accounts for them"
    return [excess_residuals_remark(factor, case, consequence)]


def pressed_priors(fit: Solution) -> dict[str, str]:
    """The soil parameters that a fit has at an end of their prior, by path, in words."""
    found = {}
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if not c.effect and min(x - c.lower, c.upper - x) < PRESSED:
            end, bound = ("lower", c.prior.lower) if x < 0.5 else ("upper", c.prior.upper)
            value = format_quantity(bound, c.unit)
            found[c.path] = f"{c.name.replace('_', ' ')} at {value}, the {end} end of its prior"
    return found


def opened_priors(posterior: Posterior) -> tuple[Remark, ...]:
    """That the likeliest explanation lies outside the priors of the soil, which forbids a name."""
    best = posterior.best
    if not best.hypothesis.wide_priors:
        return ()
    pressed = pressed_priors(posterior.soil.fit)
    why = "Within them, a large remainder is left"
    if pressed:
        why = f"The fit reached {'; '.join(pressed.values())}"
    text = f"the priors of the soil were opened. {why}"
    if best.hypothesis.effects:
        return (Remark("prior-opened", text, tuple(pressed)),)
    text += ". The soil alone then agrees with the rows"
    return (Remark(OUTSIDE_PRIORS, text, tuple(pressed)),)


def trend_remarks(trends: Sequence[SoilTrend]) -> list[Remark]:
    """That the soil may have changed, where residuals have a trend with the order."""
    where = {"runs": "from run to run", "rows": "along the rows of a run"}
    found = {}
    for trend in trends:
        if trend.p < TREND_LEVEL and trend.order not in found:
            text = f"the residuals drift {where[trend.order]}: the soil may have changed"
            found[trend.order] = Remark(f"drift-of-{trend.order}", text, (trend.parameter,))
    return list(found.values())


def hidden_effect(posterior: Posterior, soil: Solution) -> list[Remark]:
    """Of one channel: the effect that could hide in it and change the others most.

    At the size whose score is `DETECTED` with a probability of 80 %, and at most three usual sizes;
    the soil changes as far as it would to hide the effect.
    """
    problem, terms = posterior.problem, posterior.terms
    if len(terms.readings.channels) != 1:
        return []
    measured = terms.readings.channels[0]
    names = tuple(n for n in ("drawbar_pull", "sinkage") if n != measured)
    case, rates_at = soil.fitted(), (soil.case, soil.coordinates, soil.x)
    soil = soil.whitened_by(posterior.whiten)
    tested = {s.name: np.asarray(posterior.whiten @ s.column) for s in posterior.signatures}
    sizes = _undetected_sizes(posterior, soil, tested)
    rows = len(terms.readings.row_slip)
    others = Readings.of_every_row(terms.readings.at, names, std=np.full(rows * len(names), 1e-9))
    try:
        found, _ = effect_signatures(case, others, {n: problem.effects[n] for n in sizes})
    except InputError:
        return []
    rates = linearise(*rates_at, others).jacobian
    worst: tuple[float, str, dict[str, float]] = (0.0, "", {})
    for s in found:
        change = s.column
        if s.name in tested:
            white = soil.jacobian.T @ tested[s.name]
            change = change - rates @ np.linalg.solve(soil.information, white)
        change = np.abs(sizes[s.name] * np.nan_to_num(change))
        share = float((change / others.load)[others.channel == 0].max())
        if share > 1.0:  # no wheel pulls more than its load
            change, sizes[s.name], share = change / share, sizes[s.name] / share, 1.0
        if share > worst[0]:
            by_channel = {n: float(change[others.channel == i].max()) for i, n in enumerate(names)}
            worst = share, s.name, by_channel
    _, name, by_channel = worst
    if not name or max(by_channel[n] / NOTABLE_CHANGE[n] for n in names) < 1.0:
        return []
    changes = " and ".join(
        f"{channel_name(column(n))} by {decimal(1e3 * x, 2)} mm"
        if n == "sinkage"
        else f"{channel_name(column(n))} by {decimal(x, 2)} N"
        for n, x in by_channel.items()
        if x > NOTABLE_CHANGE[n]
    )
    text = (
        f"only {channel_name(column(measured))} was measured: {name} at {decimal(sizes[name], 2)} "
        f"times its usual size would not show, and would change {changes}"
    )
    return [Remark("hidden-effect", text, (name,), "note")]


def _undetected_sizes(
    posterior: Posterior, soil: Solution, tested: dict[str, Floats]
) -> dict[str, float]:
    """Sizes of the effects of soil and gear, in usual ones, that are found in 4 of 5 sets."""
    untestable, effects = posterior.untestable, posterior.problem.effects
    sizes = {n: PLAUSIBLE_SIZE for n, r in untestable.items() if r.code == "no-change"}
    for name, white in tested.items():
        norm = float(np.linalg.norm(project_out(white[:, None], soil.jacobian)))
        sizes[name] = min((DETECTED + POWER_80) / max(norm, 1e-300), PLAUSIBLE_SIZE)
    kinds = {n: effects[n].about.kind for n in sizes if n in effects}
    return {n: size for n, size in sizes.items() if kinds.get(n) not in (None, "sensor", "rig")}
