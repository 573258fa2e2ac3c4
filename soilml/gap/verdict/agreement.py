"""What speaks for and against agreement: misfit, granted scatter, trends, what may hide."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.misfit import (
    declared_misfit,
    excess_residuals,
    excess_residuals_remark,
    misfit_limit,
)
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.gap.evidence.order_trend import TREND_LEVEL
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.report.results import NoiseAgreement, SoilTrend
from soilml.gap.search.opened_priors import pressed_priors
from soilml.gap.search.passes import Analysis
from soilml.gap.search.stepwise import GAP_LEVEL, SearchResult
from soilml.quantities import column
from soilml.remarks import Remark
from soilml.report.numbers import channel_name, decimal

#: Sizes of effects, in usual ones, up to which they are plausible, and the normal quantile of the
#: power with which the test finds them.
PLAUSIBLE_SIZE, POWER_80 = 3.0, 0.84
#: Changes of pull (N) and sinkage (m) below which they are not stated.
NOTABLE_CHANGE = {"drawbar_pull": 0.01, "sinkage": 1e-5}


def noise_agreement(
    case: Case, readings: Readings, soil: Sequence[Coordinate], analysis: Analysis
) -> NoiseAgreement | None:
    """The misfit under the declared noise, and under noise and scatter, of the same readings.

    readings: All readings; those that the analysis excluded count in neither. None where no fit is
    possible.
    """
    if analysis.excluded is not None:
        readings = readings.subset(~analysis.excluded)
    within = analysis.within_priors or analysis.result.soil
    found = declared_misfit(case, readings, soil, within.x)
    if found is None:
        return None
    problem, components = analysis.problem, analysis.problem.covariance.components
    left = max(len(problem.readings) - len(problem.soil), 1)
    return NoiseAgreement(
        declared=found.per_freedom,
        exceeds_noise=found.exceeds_noise,
        granted=analysis.result.soil.cost / left,
        friction_angle_std=components.friction_angle_std,
        bearing_std=components.bearing_std,
        with_discrepancy=bool(case.discrepancy),
    )


def misfit_remarks(found: NoiseAgreement | None, case: Case, analysis: Analysis) -> list[Remark]:
    """Residuals beyond the declared noise that scatter does not account for.

    The score test does not see those that another soil beyond the priors would explain. Where the
    noise that the residuals show, rough in slip, alone accounts for them, the priors are not
    doubted.
    """
    if found is None or not found.exceeds_noise:
        return []
    left = max(len(analysis.problem.readings) - len(analysis.problem.soil), 1)
    if found.grants_scatter and found.granted <= misfit_limit(left):
        return []
    factor = float(np.sqrt(found.declared))
    problem = analysis.problem
    scale = problem.covariance.components.noise_scale[problem.readings.channel]
    noisier = found.declared / float(np.mean(scale**2)) <= misfit_limit(left)
    if not noisier and (pressed := pressed_priors(analysis.result.soil)):
        text = (
            f"{excess_residuals(factor, bool(case.discrepancy))} with "
            f"{'; '.join(pressed.values())}: widen these priors in [soil.prior], or the model "
            "lacks an effect, or the noise is understated"
        )
        return [Remark("soil-at-prior", text, tuple(pressed))]
    consequence = "no scatter from run to run accounts for them"
    return [excess_residuals_remark(factor, case, consequence)]


def trend_remarks(trends: Sequence[SoilTrend]) -> list[Remark]:
    """That the soil may have changed, where residuals have a trend with the order."""
    where = {"runs": "from run to run", "rows": "along the rows of a run"}
    found = {}
    for trend in trends:
        if trend.p < TREND_LEVEL and trend.order not in found:
            text = f"the residuals drift {where[trend.order]}: the soil may have changed"
            found[trend.order] = Remark(f"drift-of-{trend.order}", text, (trend.parameter,))
    return list(found.values())


def hidden_effect(problem: FitProblem, result: SearchResult) -> list[Remark]:
    """Of one channel: the effect that could hide in it and change the others most.

    At the size that the score test finds with a probability of 80 %, and at most three usual sizes;
    the soil changes as far as it would to hide the effect.
    """
    if len(problem.readings.channels) != 1:
        return []
    measured = problem.readings.channels[0]
    names = tuple(n for n in ("drawbar_pull", "sinkage") if n != measured)
    sizes = _undetected_sizes(problem, result)
    tested = {s.name: s.column for s in result.soil_test.signatures}
    soil = result.soil.whitened_by(problem.covariance.whiten)
    rows = len(problem.readings.row_slip)
    others = Readings.of_every_row(problem.readings.at, names, std=np.full(rows * len(names), 1e-9))
    case = result.soil.fitted()
    try:
        found, _ = effect_signatures(case, others, {n: problem.effects[n] for n in sizes})
    except InputError:
        return []
    rates = linearise(result.soil.case, result.soil.coordinates, result.soil.x, others).jacobian
    worst: tuple[float, str, dict[str, float]] = (0.0, "", {})
    for s in found:
        change = s.column
        if s.name in tested:
            white = problem.covariance.whiten @ tested[s.name]
            change = change - rates @ np.linalg.solve(soil.information, soil.jacobian.T @ white)
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


def _undetected_sizes(problem: FitProblem, result: SearchResult) -> dict[str, float]:
    """Sizes of the effects of soil and gear, in usual ones, that the test finds in 4 of 5 sets."""
    test = result.soil_test.test
    needed = float(np.quantile(test.null_maxima, 1.0 - GAP_LEVEL)) + POWER_80
    sizes = {n: PLAUSIBLE_SIZE for n, r in result.untestable.items() if r.code == "no-change"}
    for s, norm in zip(result.soil_test.signatures, test.projected_norm, strict=False):
        sizes[s.name] = min(needed / max(float(norm), 1e-300), PLAUSIBLE_SIZE)
    kinds = {n: problem.effects[n].about.kind for n in sizes if n in problem.effects}
    return {n: size for n, size in sizes.items() if kinds.get(n) not in (None, "sensor", "rig")}
