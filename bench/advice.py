"""The advised next row against a random one and a repetition, on soils that are known."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from benchmarks_file import ROOT

from soilml import Case, Estimator, Operating, identify, read_case
from soilml.experiment_design import (
    advise,
    candidate_grid,
    samples_of_prior,
    samples_of_rows,
)
from soilml.experiment_design.advice_after_results import advice_of_file
from soilml.experiment_design.design import SLIPS
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.fit import Fit
from soilml.identification.model_error_inputs import with_exact_model
from soilml.io.table import Table

LOADS = (30.0, 42.0, 60.0, 85.0, 120.0)
SOILS = 120
#: Rows after the first drive, by name; `nothing` is no further row.
KINDS = ("nothing", "repeat", "random", "advised")


@dataclass(frozen=True)
class Driven:
    """Soils (s,) by kind of next row (k,) and parameter (p,), in standard deviations of the prior.

    `expected` (s, p) is the width that the advice said would be left.
    """

    error: np.ndarray
    std: np.ndarray
    expected: np.ndarray

    def root_mean_square(self) -> tuple[np.ndarray, np.ndarray]:
        """Of error and of std, (k, p)."""
        return np.sqrt(np.mean(self.error**2, axis=0)), np.sqrt(np.mean(self.std**2, axis=0))


def driven(case: Case, rows: int, soils: int, seed: int, samples: int = 1024) -> Driven:
    """Draw soils from the prior, drive `rows` at one slip and load, then one more row of each kind.

    The drawn point and the next ones are of one grid of slips and loads; the torque is measured
    with the case's noise, the same draw of it whichever next row is driven.
    """
    rng = np.random.default_rng(seed)
    free = select_free(case, None)
    spread = np.asarray([f.prior.std for f in free])
    found = []
    for _ in range(soils):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        values = np.asarray(list(truth.values()))
        first, other = ((rng.choice(SLIPS), rng.choice(LOADS)) for _ in range(2))
        normal = rng.standard_normal(rows + 1)
        table = _measured(case, truth, [first] * rows, normal[:rows])
        data = usable_readings(case, table)
        belief = samples_of_rows(case, data, free, samples, exact_model=True)
        best = advise(case, belief, candidate_grid(SLIPS, LOADS), channels=("torque",)).best()
        points = {
            "repeat": first,
            "random": other,
            "advised": (best.candidate.slip, best.candidate.load),
        }
        fits = [identify(case, table, None, "posterior")]
        for point in points.values():
            fits.append(_with(case, truth, [first] * rows, point, normal))
        found.append(
            (
                [(fit.values - values) / spread for fit in fits],
                [fit.std / spread for fit in fits],
                best.remaining_fraction,
            )
        )
    error, std, expected = (np.asarray(part) for part in zip(*found, strict=True))
    return Driven(error, std, expected)


def planned(case: Case, rows: int, soils: int, seed: int) -> dict[str, np.ndarray]:
    """Std left (s, p) where `rows` are planned before any is driven, or drawn from the grid."""
    rng = np.random.default_rng(seed)
    free = select_free(case, None)
    spread = np.asarray([f.prior.std for f in free])
    ranges = candidate_grid(SLIPS, LOADS)
    plan = advise(case, samples_of_prior(free), ranges, channels=("torque",), count=rows).sequence
    best = [(choice.candidate.slip, choice.candidate.load) for choice in plan]
    left: dict[str, list[np.ndarray]] = {"drawn": [], "planned": []}
    for _ in range(soils):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        normal = rng.standard_normal(rows)
        drawn = [(rng.choice(SLIPS), rng.choice(LOADS)) for _ in range(rows)]
        for name, points in (("drawn", drawn), ("planned", best)):
            table = _measured(case, truth, points, normal)
            left[name].append(identify(case, table, None, "posterior").std / spread)
    return {
        **{name: np.asarray(values) for name, values in left.items()},
        "planned, as expected": plan[-1].remaining_fraction[None],
    }


def _with(
    case: Case,
    truth: dict[str, float],
    points: list[tuple[float, float]],
    last: tuple[float, float],
    normal: np.ndarray,
) -> Fit:
    return identify(case, _measured(case, truth, [*points, last], normal), None, "posterior")


def _measured(
    case: Case,
    truth: dict[str, float],
    points: Sequence[tuple[float, float]],
    normal: np.ndarray,
) -> Table:
    slip, load = np.asarray(points, dtype=float).T
    true = case.with_values(truth)
    torque = np.asarray(true.model(true.soil, Operating(slip=slip, load=load)).torque)
    torque = torque + case.noise["torque_Nm"].std(torque) * normal
    run = np.full(len(slip), "a")
    return Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": torque})


def next_rows(soils: int = SOILS) -> str:
    """The section of the page: width and error that each next row leaves."""
    case = read_case(ROOT / "examples" / "wheel" / "model.toml")
    lines = [
        "| rows at one slip and load | then one row | std left c | phi | K | all "
        "| RMSE c | phi | K | all |",
        "|---|---|" + "---:|" * 8,
    ]
    for rows in (1, 3):
        found = driven(case, rows, soils, seed=rows)
        for kind, error, std in zip(KINDS, *found.root_mean_square(), strict=True):
            cells = [f"{v:.3f}" for part in (std, error) for v in (*part, _all(part))]
            lines.append(f"| {rows} | {kind} | {' | '.join(cells)} |")
        expected = np.sqrt(np.mean(found.expected**2, axis=0))
        cells = [f"{v:.3f}" for v in (*expected, _all(expected))]
        lines.append(f"| {rows} | advised, as expected | {' | '.join(cells)} | | | | |")
    return "\n".join(lines)


def plans(soils: int = SOILS) -> str:
    """The section of the page: rows planned at once against rows drawn at random."""
    case = read_case(ROOT / "examples" / "wheel" / "model.toml")
    lines = ["| rows | chosen | std left c | phi | K | all |", "|---|---|---:|---:|---:|---:|"]
    for rows in (2, 3):
        for name, left in planned(case, rows, soils, seed=10 + rows).items():
            part = np.sqrt(np.mean(left**2, axis=0))
            cells = [f"{v:.3f}" for v in (*part, _all(part))]
            lines.append(f"| {rows} | {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def promises(
    estimator: Estimator, soils: int = SOILS, rows: int = 1, seed: int = 5, errors: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """What a trained file promised of its advised row, and what it answered with it, (soils, q).

    Both are widths in standard deviations of the prior, in the mode in which the file answers.
    Soils are drawn from the prior of examples/wheel, `rows` from the grid. Sensors have the noise
    of the case, and `errors` times the usual errors that all rows share.
    """
    case = read_case(ROOT / "examples" / "wheel" / "model.toml")
    rng, free = np.random.default_rng(seed), select_free(case, None)
    usual = estimator.sets.common_errors
    promised, answered = [], []
    for _ in range(soils):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        points = [(float(rng.choice(SLIPS)), float(rng.choice(LOADS))) for _ in range(rows)]
        offset, load, torque = (
            errors * usual[name] * rng.standard_normal()
            for name in ("slip_bias", "load_gain", "torque_gain")
        )
        shared, normal = (offset, 1.0 + load, 1.0 + torque), rng.standard_normal(rows + 1)
        readings = _readings(case, truth, points, normal[:rows], shared)
        told = estimator.run(**readings)
        if not told.in_range:
            continue
        best = advice_of_file(estimator, told.mean, told.covariance, readings).best()
        points.append((best.candidate.slip, best.candidate.load))
        after = estimator.run(**_readings(case, truth, points, normal, shared))
        promised.append(best.remaining_fraction)
        answered.append(after.std / estimator.prior.std)
    return np.asarray(promised), np.asarray(answered)


def _readings(
    case: Case,
    truth: dict[str, float],
    points: list[tuple[float, float]],
    normal: np.ndarray,
    shared: tuple[float, float, float],
) -> dict[str, np.ndarray]:
    """Readings by name at slips and loads as they are read, with offset and gains of sensors."""
    offset, load_gain, torque_gain = shared
    true = [(slip - offset, load / load_gain) for slip, load in points]
    slip, load = np.asarray(points).T
    torque = torque_gain * _measured(case, truth, true, normal)["torque_Nm"]
    return {"slip": slip, "load": load, "torque": torque}


def from_file(soils: int = SOILS) -> str:
    """The section of the page: promises of a trained file beside its answers."""
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx")
    lines = [
        "| rows first | model | promised c | φ | K | answered c | φ | K |",
        "|---|---|" + "---:|" * 6,
    ]
    for rows in (1, 3, 6):
        for name, own in (("default", estimator), ("exact", with_exact_model(estimator))):
            parts = [np.sqrt(np.mean(x**2, axis=0)) for x in promises(own, soils, rows)]
            cells = [f"{v:.2f}" for part in parts for v in part]
            lines.append(f"| {rows} | {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _all(parts: np.ndarray) -> float:
    return float(np.sqrt(np.mean(parts**2)))


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else SOILS
    print(next_rows(count), plans(count), from_file(count), sep="\n\n")
