"""Set posteriors of the released files beside the exact posteriors of the same simulated sets.

The simulated noise is a share of the true value. A file is fed standard deviations
that are computed from the readings, as a rover's are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from exact_sets import posterior_of_memory
from reference_sets import (
    ANY_WHEEL,
    COUNT,
    ONE_WHEEL,
    ReferenceSet,
    as_any_wheel_sets,
    generate_reference_sets,
    stored_posteriors,
    with_noise_of_reading,
)
from runner import ROOT, Bench, Row, Sample, markdown
from scipy.stats import chi2, chisquare

from soilml import Estimator
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Goals: largest RMSE ratio, largest gap in log density (nat), smallest p-value of uniformity.
MAX_RATIO, MAX_GAP, MIN_P_VALUE = 1.05, 0.1, 0.01
COVERAGE_RANGE = (0.88, 0.92)  # Goal: coverage of 90 % intervals
SHEAR_SYMBOLS = ("c", "phi", "K")
#: A figure that misses its goal by less than this many standard errors is not a clear miss.
STANDARD_ERRORS = 2.0
#: Fewest sets of a measurement condition that is shown.
MIN_SETS = 30
#: Torque noise is split into thirds where its upper third exceeds the lower by this factor.
NOISE_SPREAD = 1.2
#: Interior edges of bins: of ranks, of the 90 % interval, and of the stored exact quantiles.
EDGES = {"ranks": np.linspace(0.1, 0.9, 9), "interval": (0.05, 0.95)}
EDGES |= {"exact": (0.05, 0.25, 0.75, 0.95)}
#: Points of the midpoint rule that gives the prior's standard deviation.
PRIOR_POINTS = 4096
QUICK_SETS = 4
ABOUT = (
    "Estimates of the released files against the exact posteriors of the same simulated reference "
    "sets. `any_wheel` is measured on the reference wheel, as `wheel` is, and over its whole range "
    "of wheels, loads, soils, bearing parameters, noise and bias. The noise is a share of the true "
    "value. A file is fed standard deviations that are this share of the reading, as a rover "
    "computes them. Goals of the files for a microcontroller are those of the full files."
)


#: File and its reference sets; those of the reference wheel are given to any wheel's file too.
FED = {
    f"wheel, {ONE_WHEEL}": ("wheel", ONE_WHEEL),
    f"any_wheel, {ONE_WHEEL}": ("any_wheel", ONE_WHEEL),
    f"any_wheel, {ANY_WHEEL}": ("any_wheel", ANY_WHEEL),
    f"wheel_small, {ONE_WHEEL}": ("wheel_small", ONE_WHEEL),
    f"any_wheel_small, {ANY_WHEEL}": ("any_wheel_small", ANY_WHEEL),
}


@cache
def references(count: int) -> dict[tuple[str, int], list[ReferenceSet]]:
    """Reference sets, the first so many of each design, by label and number of rows."""
    found: dict[tuple[str, int], list[ReferenceSet]] = {}
    for one in generate_reference_sets(count):
        found.setdefault((one.label, one.rows), []).append(one)
    return found


def cases(sample: Sample) -> list[Row]:
    """Each file on the sets of each size."""
    count = QUICK_SETS if sample.quick else COUNT
    return [
        {"name": name, "rows": rows, "count": count}
        for name, (_, label) in FED.items()
        for own, rows in references(count)
        if own == label
    ]


def measured(case: Row) -> list[Row]:
    """Each set: errors, coverage and ranks of a file and of the exact posterior.

    The *file posterior* is the one that the file's likelihood defines, sampled with many draws; the
    file itself reports mean, covariance and 90 % interval, which alone are compared for the files
    of a microcontroller. The sensors of reference sets have no
    common errors but the bias of torque.
    """
    file, label = FED[case["name"]]
    plain = references(case["count"])[label, case["rows"]]
    limit = stored_posteriors(plain)
    estimator = Estimator.load(ROOT / "exported" / f"{file}.onnx")
    found, given = [], with_noise_of_reading(plain)
    if (file, label) == ("any_wheel", ONE_WHEEL):
        given = as_any_wheel_sets(given)
    for i, reference in enumerate(given):
        estimate, system = run_file(estimator, reference)
        sets = reference.sets
        truth, (lower, upper, std) = sets.truth[0], prior_of(reference)
        exact, ends = limit["quantiles"][i], np.stack([estimate.low, estimate.high])
        moments = (
            (estimate.mean, estimate.covariance),
            (limit["mean"][i], limit["covariance"][i]),
        )
        torque, noise = sets.readings["torque"][0], sets.readings["torque_std"][0]
        found.append(
            {
                "answered": bool(estimate.in_range),
                "third": np.minimum(3.0 * (truth - lower) / (upper - lower), 2.0).astype(int),
                "error": [(mean - truth) / std for mean, _ in moments],
                "held90": [(low <= truth) & (truth <= high) for low, high in (ends, exact[[0, 3]])],
                "joint90": [in_ellipsoid(*own, truth, std) for own in moments],
                "interval": binned_rank(truth, ends, EDGES["interval"]),
                "exact": binned_rank(truth, exact, EDGES["exact"]),
                "noise": np.median(noise / np.abs(torque)),
                "conditions": conditions(reference),
            }
        )
        if not file.endswith("small"):  # those have other monomials than the family
            posterior = posterior_of_memory(reference.family, system, sets, 0)
            both = posterior.quantiles, exact
            found[-1] |= {
                "held50": [(q[1] <= truth) & (truth <= q[2]) for q in both],
                "log_density": [posterior.log_density, limit["log_density"][i]],
                "ranks": posterior.rank,
            }
    return found


def run_file(estimator: Estimator, reference: ReferenceSet) -> tuple[Any, Floats]:
    """The estimate of a file for a reference set, and the linear system in its memory."""
    sets = reference.sets
    rows = sets.rows(0)
    for name in ("sinkage", "drawbar_pull"):
        rows[name] = np.where(rows[f"{name}_std"] < ABSENT_STD, rows[name], np.nan)
    exact = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
    configured = estimator.on(None, **sets.context_of(0), **exact)
    estimate, memory = configured.step(configured.start(), **rows)
    return estimate, memory.system.astype(np.float64)


def prior_of(reference: ReferenceSet) -> tuple[Floats, Floats, Floats]:
    """Lower end, upper end and standard deviation of the priors, (q,) each."""
    context, u = reference.sets.context_of(0), (np.arange(PRIOR_POINTS) + 0.5) / PRIOR_POINTS
    axes = reference.family.axes[: reference.family.targets]
    scale = np.asarray([context.get(f"{axis.name}_max", 1.0) for axis in axes])
    lower, upper = (scale * [axis.ends[end] for axis in axes] for end in (0, 1))
    return lower, upper, scale * [axis.value(axis.quantile(u)).std() for axis in axes]


def in_ellipsoid(mean: Floats, covariance: Floats, truth: Floats, std: Floats) -> bool:
    """Whether a truth lies in the 90 % ellipsoid; `std` scales the inversion."""
    error = (truth - mean) / std
    inverse = np.linalg.pinv(covariance / np.outer(std, std), rcond=1e-10, hermitian=True)
    return bool(error @ inverse @ error <= chi2.ppf(0.9, len(truth)))


def binned_rank(truth: Floats, edges: Floats, ends: Sequence[float]) -> Floats:
    """The middle of the bin of each truth (q,) among ascending edges (k, q)."""
    middles = 0.5 * (np.asarray([0.0, *ends]) + np.asarray([*ends, 1.0]))
    return middles[(truth > edges).sum(axis=0)]


def conditions(reference: ReferenceSet) -> list[str]:
    """The measurement conditions that a set has."""
    origin = reference.sets.origin
    bias = origin.noise.get("torque_bias", (np.zeros(1), np.zeros(1)))
    has = {
        "uncertain bearing": float(origin.normal_std[0]) > 0.0,
        "sensor bias": bool(np.max(bias[0]) > 0.0 or np.max(bias[1]) > 0.0),
        "sinkage and pull": bool((reference.sets.readings["sinkage_std"] < ABSENT_STD).any()),
    }
    return [name for name, there in has.items() if there] or ["torque only"]


def stacked(rows: Sequence[Row], member: str) -> Floats:
    """A member of all rows as an array."""
    return np.asarray([row[member] for row in rows])


def rmse_ratio(rows: Sequence[Row]) -> tuple[Floats, Floats]:
    """RMSE over that of the exact posterior, and its jackknife standard error, (q,) each.

    Of the sets that the file answers; errors are relative to the prior's standard deviation.
    """
    own, exact = (stacked([r for r in rows if r["answered"]], "error") ** 2).swapaxes(0, 1)
    without = np.sqrt((own.sum(axis=0) - own) / (exact.sum(axis=0) - exact))
    error = np.sqrt((len(own) - 1) * np.mean((without - without.mean(axis=0)) ** 2, axis=0))
    return np.sqrt(own.sum(axis=0) / exact.sum(axis=0)), error


def coverage(rows: Sequence[Row], member: str, third: int | None = None) -> Floats:
    """Coverage (2, q) of the file and of the exact posterior, of truths in a third of the prior."""
    own = [r for r in rows if r["answered"]]
    counted = np.ones((len(own), 3), bool) if third is None else stacked(own, "third") == third
    held = stacked(own, member) & counted[:, None]
    with np.errstate(invalid="ignore"):  # NaN where nothing is counted
        return np.asarray(held.sum(axis=0) / counted.sum(axis=0))


def uniformity_p_values(ranks: Floats, edges: Sequence[float]) -> Floats:
    """Chi-square test (q,) of ranks (n, q) against uniformity, as p-values.

    `edges` are the interior edges of the bins of [0, 1].
    """
    bins = np.asarray([0.0, *edges, 1.0 + 1e-9])
    expected = np.diff([0.0, *edges, 1.0]) * len(ranks)
    counts = [np.histogram(own, bins)[0] for own in ranks.T]
    return np.asarray([chisquare(count, expected).pvalue for count in counts])


def result(met: bool, near: bool = False) -> str:
    """Whether a goal is met."""
    return "met" if met else f"missed, within {STANDARD_ERRORS:g} s.e." if near else "MISSED"


def by_name(rows: Sequence[Row], member: str = "error") -> dict[str, list[Row]]:
    """Rows of each file on its sets that have a member."""
    found = {name: [r for r in rows if r["name"] == name and member in r] for name in FED}
    return {name: own for name, own in found.items() if own}


def by_size(rows: Sequence[Row]) -> dict[int, list[Row]]:
    """Rows by number of rows of the set."""
    return {n: [r for r in rows if r["rows"] == n] for n in dict.fromkeys(r["rows"] for r in rows)}


def subsets(rows: list[Row]) -> list[tuple[list[Row], str]]:
    """All sets, those of each size, of each condition, and of low and high torque noise."""
    parts = by_size(rows)
    found = [(rows, "all")] if len(parts) > 1 else []
    found += [(own, f"{n} row{'s' if n > 1 else ''}") for n, own in parts.items()]
    for condition in ("torque only", "uncertain bearing", "sensor bias", "sinkage and pull"):
        own = [r for r in rows if condition in r["conditions"]]
        found += [(own, condition)] if MIN_SETS <= len(own) < len(rows) else []
    low, high = np.quantile(stacked(rows, "noise"), [1.0 / 3.0, 2.0 / 3.0])
    if high > NOISE_SPREAD * low:
        found.append(([r for r in rows if r["noise"] < low], f"torque noise below {low:.1%}"))
        found.append(([r for r in rows if r["noise"] > high], f"torque noise above {high:.1%}"))
    return found


def rmse_table(rows: list[Row]) -> str:
    """RMSE relative to the exact posterior, by set size"""
    lines = []
    for name, whole in by_name(rows).items():
        for size, own in by_size(whole).items():
            ratio, error = rmse_ratio(own)
            near = bool(np.all(ratio - STANDARD_ERRORS * error <= MAX_RATIO))
            cells = [f"{x:.3f}" for pair in zip(ratio, error, strict=True) for x in pair]
            refused = f"{1.0 - stacked(own, 'answered').mean():.1%}"
            goal = result(bool(np.all(ratio <= MAX_RATIO)), near)
            lines.append((name, size, len(own), refused, *cells, goal))
    head = [word for symbol in SHEAR_SYMBOLS for word in (symbol, "s.e.")]
    return (
        "RMSE over that of the exact posterior mean on the same sets, with its standard error; of "
        f"the sets that the file answers. Goal: at most {MAX_RATIO:g} at every size.\n\n"
        + markdown(("file, sets", "rows", "sets", "refused", *head, "goal"), lines)
    )


def log_density_table(rows: list[Row]) -> str:
    """Log posterior density at the truth"""
    lines = []
    for name, whole in by_name(rows, "log_density").items():
        for own, label in subsets(whole):
            density = stacked(own, "log_density")
            gap = (density[:, 1] - density[:, 0])[stacked(own, "answered")]
            mean, error = gap.mean(), gap.std(ddof=1) / np.sqrt(len(gap))
            goal = result(mean <= MAX_GAP, mean - STANDARD_ERRORS * error <= MAX_GAP)
            cells = (f"{mean:.3f}", f"{error:.3f}", f"{density[:, 1].mean():.2f}")
            lines.append((name, label, len(own), *cells, goal))
    return (
        "Mean log density at the truth of all unknowns jointly (uncertain bearing included). "
        "*Exact*: of the exact posterior; *gap*: how far the posterior of the file is below it. "
        f"Goal: a gap of at most {MAX_GAP:g} nat.\n\n"
        + markdown(("file, sets", "subset", "sets", "gap, nat", "s.e.", "exact, nat", "goal"),
                   lines, 2)
    )  # fmt: skip


def coverage_table(rows: list[Row]) -> str:
    """Coverage of intervals and ellipsoids"""
    low, high = COVERAGE_RANGE
    lines = []
    for name, whole in by_name(rows).items():
        for own, label in subsets(whole):
            both = coverage(own, "held90")
            margin = STANDARD_ERRORS * np.sqrt(0.09 / len(own))
            inside = np.all((both[0] >= low) & (both[0] <= high))
            near = np.all((both[0] >= low - margin) & (both[0] <= high + margin))
            joint = stacked([r for r in own if r["answered"]], "joint90").mean(axis=0)
            goal = result(bool(inside), bool(near))
            lines.append((name, label, len(own), *_pairs(both), *_pairs(joint[:, None]), goal))
        further = {"all, 50 %": coverage(whole, "held50")} if "held50" in whole[0] else {}
        for k, third in enumerate(("lower", "middle", "upper")):
            further[f"truth in {third} third"] = coverage(whole, "held90", k)
        lines += [(name, label, len(whole), *_pairs(b), "", "") for label, b in further.items()]
    return (
        "Coverage of 90 % intervals, and of the joint 90 % ellipsoid of mean and covariance: of "
        "the file / of the exact posterior on the same sets. Goal: 90 % intervals cover "
        f"{low:.0%} to {high:.0%}. Coverage of an exact posterior is 90 % on average over the "
        "prior. It is not among soils of one third of the prior, where the posterior mean is "
        "shrunk towards the middle. Nor need a Gaussian ellipsoid cover 90 % of a posterior that "
        "is not Gaussian. A file reports 90 % intervals only: 50 % figures are of the posterior "
        "that its likelihood defines.\n\n"
        + markdown(("file, sets", "subset", "sets", *SHEAR_SYMBOLS, "joint", "goal"), lines, 2)
    )


def _pairs(both: Floats) -> list[str]:
    return [f"{own:.1%} / {exact:.1%}" for own, exact in both.T]


def calibration_table(rows: list[Row]) -> str:
    """Simulation-based calibration"""
    lines = []
    for name, whole in by_name(rows, "ranks").items():
        answered = [r for r in whole if r["answered"]]
        for test, edges in EDGES.items():
            p_values = uniformity_p_values(stacked(answered, test), edges)
            goal = "" if test == "exact" else result(bool(np.all(p_values >= MIN_P_VALUE)))
            lines.append((name, len(answered), test, *(f"{p:.2g}" for p in p_values), goal))
    return (
        "Chi-square test of the truth's posterior rank against uniformity (Talts et al., "
        "arXiv:1804.06788, 2018), p-values. `ranks`: 10 bins of the rank in the posterior that "
        "the file's likelihood defines. `interval`: below, inside and above the file's own 90 % "
        "interval. `exact`: the exact posterior, in the bins of its stored quantiles. Goal: p at "
        f"least {MIN_P_VALUE:g}.\n\n"
        + markdown(("file, sets", "sets", "test", *SHEAR_SYMBOLS, "goal"), lines)
    )


def tables(rows: list[Row]) -> str:
    """All tables, each under its heading."""
    found = (rmse_table, log_density_table, coverage_table, calibration_table)
    return "\n\n".join(f"### {of.__doc__}\n\n{of(rows)}" for of in found)


SETS = Bench("sets", "Set posterior", ABOUT, cases, measured, tables)
