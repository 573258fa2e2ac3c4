"""Tables and page of the benchmark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from soilml.io.text_tables import format_table
from soilml.quantities import QUANTITIES, SHEAR
from training.benchmark.acceptance import COHESION_RANGE, LARGEST_SET, Goal, goals
from training.benchmark.paired_results import PairedResult
from training.benchmark.table_format import (
    SHEAR_SYMBOLS,
    SHEAR_UNITS,
    columns_of_rows,
    format_number,
)


def csv_columns(results: Sequence[PairedResult]) -> dict[str, list[Any]]:
    """The CSV table, in SI units: one row per design, effect, method and parameter."""
    return columns_of_rows(_csv_row(r, k) for r in results for k in range(len(SHEAR)))


def _csv_row(r: PairedResult, k: int) -> dict[str, Any]:
    # with an unmodelled effect the posterior is no limit: no ratio to it
    ratio, ratio_std = (
        (float("nan"), float("nan")) if r.effect else (r.rmse_ratio[k], r.rmse_ratio_std[k])
    )
    return {
        "design": r.design.key,
        "rows_in_set": r.design.rows,
        "loads_in_set": r.design.loads,
        "unknown_effect": r.effect,
        "method": r.method,
        "inputs": r.inputs,
        "parameter": QUANTITIES[SHEAR[k]].column,
        "sets": r.sets,
        "failed": r.failed,
        "rmse": float(r.rmse[k]),
        "rmse_share_of_prior": float(r.rmse_over_prior[k]),
        "rmse_over_limit": float(ratio),
        "rmse_over_limit_std": float(ratio_std),
        "cover50": float(r.coverage50[k]),
        "cover90": float(r.coverage90[k]),
        "joint_cover90": r.joint_coverage90,
        "log_density": r.log_score,
        "flagged": r.flagged_fraction,
        "seconds_per_estimate": r.estimates.seconds,
    }


def format_tables(results: Sequence[PairedResult]) -> str:
    """A text table for each design, then those with an unmodelled effect."""
    blocks = []
    for same in _by_design([r for r in results if not r.effect]):
        blocks.append(f"{same[0].design.description} ({same[0].sets} sets)\n\n{_full_table(same)}")
        if same[0].design.rows == LARGEST_SET:
            blocks.append(_table_of_cohesion_range(same))
    for same in _by_design([r for r in results if r.effect]):
        first = same[0]
        title = f"{first.design.description}, simulated with {first.effect}, which no method models"
        blocks.append(f"{title} ({first.sets} sets)\n\n{_short_table(same)}")
    return "\n\n".join(blocks)


def _table_of_cohesion_range(same: Sequence[PairedResult]) -> str:
    """The same table of the sets whose true cohesion is in the range of a goal."""
    low, high = COHESION_RANGE
    truth = same[0].truth[:, SHEAR.index("cohesion")]
    inside = (truth >= low) & (truth <= high)
    if inside.sum() < 2:
        return f"fewer than two sets with c {low / 1e3:g} to {high / 1e3:g} kPa"
    title = f"of these, c {low / 1e3:g} to {high / 1e3:g} kPa ({int(inside.sum())} sets)"
    return f"{title}\n\n{_full_table([r.subset(inside) for r in same])}"


def format_goals(found: Sequence[Goal]) -> str:
    """The acceptance goals, each with the figure that was measured."""
    header = ["goal", "method", "measured", "std error", "Bayes limit", "result"]
    rows = [
        [g.criterion, g.method, g.measured, g.standard_error, g.limit, "met" if g.met else "MISSED"]
        for g in found
    ]
    return format_table(header, rows, text_columns=len(header))


def _by_design(results: Sequence[PairedResult]) -> list[list[PairedResult]]:
    groups: dict[tuple[str, str], list[PairedResult]] = {}
    for r in results:
        groups.setdefault((r.effect, r.design.key), []).append(r)
    return list(groups.values())


def _full_table(same: Sequence[PairedResult]) -> str:
    header = ["method"]
    for symbol, (_, unit) in zip(SHEAR_SYMBOLS, SHEAR_UNITS, strict=True):
        header += [f"{symbol} {unit}", "/prior", "/limit", "s.e.", "50 %", "90 %"]
    header += ["joint", "log p", "failed", "flagged", "ms"]
    rows = []
    for r in same:
        row = [r.method]
        for k, (factor, _) in enumerate(SHEAR_UNITS):
            row += [
                format_number(r.rmse[k] * factor, ".3g"),
                format_number(r.rmse_over_prior[k], ".3f"),
                format_number(r.rmse_ratio[k], ".3f"),
                format_number(r.rmse_ratio_std[k], ".3f"),
                format_number(r.coverage50[k], ".0%"),
                format_number(r.coverage90[k], ".0%"),
            ]
        row += [format_number(r.joint_coverage90, ".0%"), format_number(r.log_score, ".3g")]
        row += [str(r.failed or ""), f"{r.flagged_fraction:.1%}" if r.flagged_fraction else ""]
        rows.append([*row, format_number(1e3 * r.estimates.seconds, ".2g")])
    return format_table(header, rows)


def _short_table(same: Sequence[PairedResult]) -> str:
    header = ["method"]
    for symbol, (_, unit) in zip(SHEAR_SYMBOLS, SHEAR_UNITS, strict=True):
        header += [f"{symbol} {unit}", "90 %"]
    rows = []
    for r in same:
        row = [r.method]
        for k, (factor, _) in enumerate(SHEAR_UNITS):
            row += [
                format_number(r.rmse[k] * factor, ".3g"),
                format_number(r.coverage90[k], ".0%"),
            ]
        row += [format_number(r.joint_coverage90, ".0%"), str(r.failed or "")]
        rows.append([*row, f"{r.flagged_fraction:.0%}"])
    return format_table([*header, "joint", "failed", "flagged"], rows)


LEGEND = """\
`c kPa`, `phi deg`, `K mm`: RMSE of cohesion, friction angle and shear modulus over all sets; a
failed estimate counts as the prior's median, and estimates outside the prior are clipped to it.
`/prior`: RMSE over the prior's standard deviation. `/limit`: RMSE over that of the exact posterior
mean on the same sets, and `s.e.` its standard error (paired jackknife over sets). `50 %`, `90 %`:
coverage of the method's own 50 and 90 % intervals, of the sets answered. `joint`: coverage of the
90 % ellipsoid of its mean and covariance. `log p`: mean log posterior density at the truth (nat;
parameters as fractions of their priors, so that the prior has 0; in expectation no method exceeds
the limit). `failed`: number of sets without an estimate. `flagged`: sets whose estimate the method
itself reports as unreliable (readings out of range, or residuals larger than the noise explains).
`ms`: wall time of one estimate. `linear` fixes K and `newton` fixes c at the value of the recipe's
nominal soil, not at the truth; both read sinkage as well."""


def benchmark_page(results: Sequence[PairedResult]) -> str:
    """The Markdown page that accompanies table and figure."""
    caption = (
        "Figure: RMSE (upper rows, logarithmic) and coverage of 90 % intervals (lower rows; green: "
        "88 to 92 %) against the number of rows per set, at one load and at three. Black: the "
        "Bayes limit. Dotted: the prior. Dashed: analytic methods."
    )
    return (
        f"# Benchmark\n\n{LEGEND}\n\n![RMSE and coverage](benchmark.png)\n\n{caption}\n\n"
        f"## Acceptance goals\n\n```\n{format_goals(goals(results))}\n```\n\n## Tables\n\n"
        f"```\n{format_tables(results)}\n```\n"
    )
