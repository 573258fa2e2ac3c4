"""Acceptance goals of the benchmark, each with the figure that was measured.

Which goals a method has follows from its `MethodKind` alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.quantities import QUANTITIES, SHEAR
from soilml.report.numbers import shown_unit
from training.benchmark.methods import MethodKind
from training.benchmark.paired_results import NOMINAL, PairedResult

#: Display units and symbols of the shear parameters: cohesion, friction angle, shear modulus.
SHEAR_UNITS = tuple(shown_unit(QUANTITIES[name].unit) for name in SHEAR)
SHEAR_SYMBOLS = ("c", "phi", "K")

#: Largest accepted RMSE over that of the Bayes limit: of one row, and of every size of set.
MAX_RATIO_ONE_ROW, MAX_RATIO = 1.01, 1.05
COVERAGE_RANGE = (0.88, 0.92)  # Accepted coverage of 90 % intervals and regions
#: Rows of the largest sets, and the RMSE of SHEAR (Pa, rad, m) accepted there, for true cohesions
#: (Pa) in a range.
LARGEST_SET = 18
MAX_RMSE = (90.0, float(np.radians(0.8)), 0.0009)
COHESION_RANGE = (100.0, 2000.0)
#: Kinds with the goals of all set sizes, and the kind with the goal of one row.
SET_METHODS = (MethodKind.SET_POSTERIOR, MethodKind.USER_FUNCTION)
ONE_ROW_METHODS = (MethodKind.REGRESSION,)


@dataclass(frozen=True)
class Goal:
    """One acceptance goal of one method.

    `measured` is the method's figure, `standard_error` its standard error where known (else
    blank), and `limit` the same figure of the Bayes limit.
    """

    criterion: str
    method: str
    measured: str
    standard_error: str
    limit: str
    met: bool


def goals(results: Sequence[PairedResult]) -> list[Goal]:
    """The acceptance goals of all methods, computed from their results.

    Sets with an unmodelled effect are left out. Goals follow from the kind of a method:

    - set posteriors of model files, and functions of the caller: RMSE within 5 % of the Bayes limit
      at every set size, 88 to 92 % coverage of 90 % intervals overall and in each third of the
      prior, and an absolute RMSE at 18 rows;
    - model files with a nonlinear regressor and no set posterior: RMSE within 1 % of the limit at
      one row;
    - the Bayes limit itself: 88 to 92 % coverage of 90 % highest-density regions;
    - the prior, analytic methods and linear regression are baselines without a goal.

    results: What `benchmark` returns; it must contain the results of the Bayes limit.

    Returns: First the check of the limit, then the goals by method.
    """
    modelled = [r for r in results if not r.effect]
    limit = [r for r in modelled if r.kind is MethodKind.BAYES_LIMIT]
    found = [_limit_calibration(limit)]
    for label in dict.fromkeys(r.method for r in modelled):
        own = [r for r in modelled if r.method == label]
        if own[0].kind in ONE_ROW_METHODS:
            one_row = [r for r in own if r.design.rows == 1]
            found += _rmse_ratio(
                one_row, f"1 row: RMSE / limit <= {MAX_RATIO_ONE_ROW}", MAX_RATIO_ONE_ROW
            )
        elif own[0].kind in SET_METHODS:
            found += _rmse_ratio(own, f"every size: RMSE / limit <= {MAX_RATIO}", MAX_RATIO)
            found += _interval_coverage(own, limit)
            found += _largest_set_rmse(own, limit)
    return found


def _limit_calibration(limit: Sequence[PairedResult]) -> Goal:
    """Coverage of the 90 % highest-posterior-density regions of the exact posteriors."""
    inside = np.concatenate([r.hpd_levels for r in limit]) < NOMINAL
    low, high = COVERAGE_RANGE
    return Goal(
        criterion=f"coverage of 90 % highest-density regions: {low:.0%} to {high:.0%}",
        method=limit[0].method,
        measured=f"{inside.mean():.1%}",
        standard_error=f"{np.sqrt(0.09 / inside.size):.1%}",
        limit="",
        met=bool(low <= inside.mean() <= high),
    )


def _rmse_ratio(results: Sequence[PairedResult], criterion: str, most: float) -> Iterator[Goal]:
    """The largest RMSE ratio over designs and parameters."""
    if not results:
        return
    worst = max(results, key=lambda r: float(np.nan_to_num(r.rmse_ratio, nan=np.inf).max()))
    ratio, std = worst.rmse_ratio, worst.rmse_ratio_std
    k = int(np.argmax(np.nan_to_num(ratio, nan=np.inf)))
    symbol = SHEAR_SYMBOLS[k]
    where = f"{symbol}, {worst.design.description}" if len(results) > 1 else symbol
    measured = f"{ratio[k]:.3f} ({where})"
    yield Goal(
        criterion=criterion,
        method=worst.method,
        measured=measured,
        standard_error=f"{std[k]:.3f}",
        limit="1",
        met=bool(ratio[k] <= most),
    )


def coverage_by_third(result: PairedResult) -> Floats:
    """Coverage (3, q) of 90 % intervals by the third of the prior that the truth lies in."""
    coverage = np.full((3, len(result.priors)), np.nan)
    for k, prior in enumerate(result.priors):
        ends = prior.at(np.asarray([0.0, 1 / 3, 2 / 3, 1.0]))
        for third in range(3):
            truth = result.truth[:, k]
            inside = (truth >= ends[third]) & (truth <= ends[third + 1])
            if inside.any():
                coverage[third, k] = result.subset(inside).coverage90[k]
    return coverage


def _interval_coverage(
    own: Sequence[PairedResult], limit: Sequence[PairedResult]
) -> Iterator[Goal]:
    """Coverage of 90 % intervals, mean over designs: overall, and by third of the prior."""
    low, high = COVERAGE_RANGE
    figures: list[tuple[str, Callable[[PairedResult], Floats]]] = [
        ("overall", lambda r: r.coverage90),
        ("lower third", lambda r: coverage_by_third(r)[0]),
        ("middle third", lambda r: coverage_by_third(r)[1]),
        ("upper third", lambda r: coverage_by_third(r)[2]),
    ]
    for name, figure in figures:
        mean, limit_mean = (np.nanmean([figure(r) for r in rs], axis=0) for rs in (own, limit))
        # effective number of sets of a mean over designs of unequal size; a third of them each
        sets = len(own) ** 2 / sum(1.0 / r.sets for r in own) / (1 if name == "overall" else 3)
        yield Goal(
            criterion=f"coverage of 90 % intervals, {name}: {low:.0%} to {high:.0%}",
            method=own[0].method,
            measured=_join(f"{v:.1%}" for v in mean),
            standard_error=f"about {np.sqrt(0.09 / sets):.1%}",
            limit=_join(f"{v:.1%}" for v in limit_mean),
            met=bool(((mean >= low) & (mean <= high)).all()),
        )


def _largest_set_rmse(own: Sequence[PairedResult], limit: Sequence[PairedResult]) -> Iterator[Goal]:
    """RMSE of the largest sets, for true cohesions in the goal's range."""
    most = _join(f"{x * f:.2g} {u}" for x, (f, u) in zip(MAX_RMSE, SHEAR_UNITS, strict=True))
    low, high = COHESION_RANGE
    for result, reference in zip(own, limit, strict=True):
        if result.design.rows != LARGEST_SET:
            continue
        truth = result.truth[:, SHEAR.index("cohesion")]
        inside = (truth >= low) & (truth <= high)
        part = result.subset(inside)
        yield Goal(
            criterion=f"{LARGEST_SET} rows, c {low / 1e3:g} to {high / 1e3:g} kPa: RMSE <= {most}",
            method=result.method,
            measured=_in_display_units(part.rmse),
            standard_error=_in_display_units(part.rmse_std),
            limit=_in_display_units(reference.subset(inside).rmse),
            met=bool((part.rmse <= np.asarray(MAX_RMSE)).all()),
        )


def _in_display_units(values: Floats) -> str:
    return _join(f"{v * factor:.2g}" for v, (factor, _) in zip(values, SHEAR_UNITS, strict=True))


def _join(words: Iterable[str]) -> str:
    return ", ".join(words)
