"""The benchmark's tables and page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from soilml.io.text_tables import aligned
from soilml.quantities import QUANTITIES, SHEAR
from training.benchmark.acceptance import COHESIONS, EIGHTEEN, SHOWN, SYMBOLS, Goal, goals
from training.benchmark.paired_results import Result


def columns(results: Sequence[Result]) -> dict[str, list[Any]]:
    """The table for programs: one row for each design, effect, method and parameter."""
    found: dict[str, list[Any]] = {}
    for r in results:
        figures = (r.rmse, r.relative, r.ratio, r.ratio_std, r.cover50, r.cover90)
        shares = (r.joint90, r.log_density, r.flagged)
        for k, name in enumerate(SHEAR):
            row = {
                "design": r.design.key,
                "rows_in_set": r.design.rows,
                "loads_in_set": r.design.loads,
                "unknown_effect": r.effect,
                "method": r.method,
                "inputs": r.inputs,
                "parameter": QUANTITIES[name].column,
                "sets": r.sets,
                "failed": r.failed,
            }
            keys = ("rmse", "rmse_share_of_prior", "rmse_over_limit", "rmse_over_limit_std")
            values = [float(figure[k]) for figure in figures]
            if r.effect:  # what lacks the effect is no limit
                values[2:4] = [float("nan")] * 2
            row |= dict(zip((*keys, "cover50", "cover90"), values, strict=True))
            row |= dict(zip(("joint_cover90", "log_density", "flagged"), shares, strict=True))
            row["seconds_per_estimate"] = r.answers.seconds
            for key, value in row.items():
                found.setdefault(key, []).append(value)
    return found


def tables(results: Sequence[Result]) -> str:
    """A table for people for each design, then those with an effect that no method knows."""
    blocks = []
    for same in _groups([r for r in results if not r.effect]):
        blocks.append(f"{same[0].design.text} ({same[0].sets} sets)\n\n{_full(same)}")
        if same[0].design.rows == EIGHTEEN:
            blocks.append(_narrower(same))
    for same in _groups([r for r in results if r.effect]):
        first = same[0]
        title = f"{first.design.text}, driven with {first.effect}, which no method knows"
        blocks.append(f"{title} ({first.sets} sets)\n\n{_short(same)}")
    return "\n\n".join(blocks)


def _narrower(same: Sequence[Result]) -> str:
    """The same table of the sets whose cohesion is in a range."""
    low, high = COHESIONS
    truth = same[0].truth[:, SHEAR.index("cohesion")]
    inside = (truth >= low) & (truth <= high)
    if inside.sum() < 2:
        return f"no two sets with c {low / 1e3:g} to {high / 1e3:g} kPa"
    title = f"of these, c {low / 1e3:g} to {high / 1e3:g} kPa ({int(inside.sum())} sets)"
    return f"{title}\n\n{_full([r.where(inside) for r in same])}"


def goal_table(found: Sequence[Goal]) -> str:
    """The goals, each with what was measured."""
    header = ["goal", "method", "measured", "std error", "limit's own", "met"]
    rows = [
        [g.what, g.method, g.measured, g.error, g.limit, "met" if g.met else "MISSED"]
        for g in found
    ]
    return aligned(header, rows, text_columns=len(header))


def _groups(results: Sequence[Result]) -> list[list[Result]]:
    found: dict[tuple[str, str], list[Result]] = {}
    for r in results:
        found.setdefault((r.effect, r.design.key), []).append(r)
    return list(found.values())


def _full(same: Sequence[Result]) -> str:
    header = ["method"]
    for symbol, (_, unit) in zip(SYMBOLS, SHOWN, strict=True):
        header += [f"{symbol} {unit}", "/prior", "/limit", "+-", "50 %", "90 %"]
    header += ["joint", "log p", "failed", "flagged", "ms"]
    rows = []
    for r in same:
        row = [r.method]
        for k, (factor, _) in enumerate(SHOWN):
            row += [
                _cell(r.rmse[k] * factor, ".3g"),
                _cell(r.relative[k], ".3f"),
                _cell(r.ratio[k], ".3f"),
                _cell(r.ratio_std[k], ".3f"),
                _cell(r.cover50[k], ".0%"),
                _cell(r.cover90[k], ".0%"),
            ]
        row += [_cell(r.joint90, ".0%"), _cell(r.log_density, ".3g")]
        row += [str(r.failed or ""), f"{r.flagged:.1%}" if r.flagged else ""]
        rows.append([*row, _cell(1e3 * r.answers.seconds, ".2g")])
    return aligned(header, rows)


def _short(same: Sequence[Result]) -> str:
    header = ["method"]
    for symbol, (_, unit) in zip(SYMBOLS, SHOWN, strict=True):
        header += [f"{symbol} {unit}", "90 %"]
    rows = []
    for r in same:
        row = [r.method]
        for k, (factor, _) in enumerate(SHOWN):
            row += [_cell(r.rmse[k] * factor, ".3g"), _cell(r.cover90[k], ".0%")]
        rows.append([*row, _cell(r.joint90, ".0%"), str(r.failed or ""), f"{r.flagged:.0%}"])
    return aligned([*header, "joint", "failed", "flagged"], rows)


def _cell(value: float, form: str) -> str:
    return "" if np.isnan(value) else format(value, form)


WORDS = """\
RMSE is over all sets; a failed answer counts as the prior's middle, and values outside the prior
are moved to its edge. `/limit` is RMSE over that of the exact posterior's mean on the same sets,
`+-` its standard error (jackknife). `50 %` and `90 %`: share of truths inside the method's own
intervals, of the sets answered; `joint`: inside the 90 % ellipsoid of its mean and covariance.
`log p` is the mean logarithm of the density that the method gave the truth (parameters as
fractions of their priors; the prior has 0, and no method more than the limit on average).
`failed`: sets without an answer; `flagged`: sets that the method itself says not to believe (out
of range, or residuals beyond the noise). `ms` is the time of one answer. `linear` is given K and
`newton` c, as the recipe's nominal soil has them and not as the truth; both read sinkage too."""


def page(results: Sequence[Result], limit: str) -> str:
    """The page that stands beside table and picture."""
    return (
        f"# Benchmark\n\n{WORDS}\n\n![benchmark](benchmark.png)\n\n## Goals\n\n"
        f"```\n{goal_table(goals(results, limit))}\n```\n\n## Tables\n\n"
        f"```\n{tables(results)}\n```\n"
    )
