"""Analytic identification: time against the number of rows, and polynomials beside the model."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import islice
from typing import Any

import gap_speed
import numpy as np
from core_speed import timed
from gap_case import read_model

from datagen.recipe import read_recipe
from soilml import Operating, identify
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.posterior_density import PosteriorDensity
from soilml.io.table import Table
from soilml.numerics.importance_sampling import ImportanceSample, importance_sample
from soilml.numerics.surface_sampling import surface_sample

METHODS = ("nonlinear", "posterior")
#: Numbers of rows, and the largest at which the model itself is sampled for comparison.
ROWS, MOST_SAMPLED = (4, 16, 64, 256, 1000, 5000), 256
#: Soils on which samples from polynomials and from the model are compared, and rows of each set.
SOILS, SET_SIZES = 24, (8, 16, 40)
AVERAGED_SETS = 24  # Blind sets of which the averaged answer is timed


def text() -> str:
    """All tables."""
    return f"{_times()}\n\n{_agreement()}\n\n{_averaged_times()}"


def _averaged_times() -> str:
    """Seconds of the averaged answer on the sets of `gap_speed`, raw and scaled."""
    lines = [
        "| averaged answer, three channels | sets | seconds: median, longest | scaled: median, "
        "longest |",
        "|---|---:|---:|---:|",
    ]
    for rows, design in ((64, "sweep"), (5, "few-rows")):
        seconds, scaled = [], []
        for drawn in islice(gap_speed.sets(rows, design), AVERAGED_SETS):
            case, table = read_model(drawn.model), Table(dict(drawn.columns))
            answer = timed(case, partial(identify, case, table))
            seconds.append(answer.seconds)
            scaled.append(answer.scaled)
        lines.append(
            f"| {rows} rows | {len(seconds)} | {np.median(seconds):.2f}, {max(seconds):.2f} | "
            f"{np.median(scaled):.2f}, {max(scaled):.2f} |"
        )
    return "\n".join(lines)


def _times() -> str:
    lines = [
        "| rows | nonlinear least squares (s) | posterior (s) | posterior, model itself (s) | "
        "ratio |",
        "|---:|---:|---:|---:|---:|",
    ]
    rng = np.random.default_rng(4)
    for rows in ROWS:
        case, table = _measured(rng, rows, _drawn(rng))
        repeats = 3 if rows <= 256 else 1
        own = {m: _best(partial(identify, case, table, None, m), repeats) for m in METHODS}
        cells = [f"{own[m]:.3g}" for m in METHODS]
        if rows <= MOST_SAMPLED:
            density = _density(case, table)
            sampled = _best(partial(importance_sample, density, len(density.free)), 1)
            cells += [f"{sampled:.3g}", f"{sampled / own['posterior']:.1f}"]
        else:
            cells += ["", ""]
        lines.append(f"| {rows} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _agreement() -> str:
    rng = np.random.default_rng(5)
    lines = [
        "| rows | soils | difference of means, rms / largest | ratio of std, least / largest | "
        "difference of 90 % ends, rms / largest |",
        "|---:|---:|---:|---:|---:|",
    ]
    for rows in SET_SIZES:
        shift, ratio, ends = [], [], []
        for _ in range(SOILS):
            density = _density(*_measured(rng, rows, _drawn(rng)))
            p = len(density.free)
            quick, slow = surface_sample(density, p), importance_sample(density, p)
            if quick is None:
                continue
            mean, std, end = _moments(slow)
            own_mean, own_std, own_end = _moments(quick)
            shift.append((own_mean - mean) / std)
            ratio.append(own_std / std)
            ends.append((own_end - end) / std)
        lines.append(
            f"| {rows} | {len(shift)} of {SOILS} | {_rms(shift):.3f} / {np.abs(shift).max():.3f} | "
            f"{np.min(ratio):.3f} / {np.max(ratio):.3f} | "
            f"{_rms(ends):.3f} / {np.abs(ends).max():.3f} |"
        )
    return "\n".join(lines)


def _drawn(rng: np.random.Generator) -> dict[str, float]:
    case = read_recipe("wheel").case
    return {name: float(prior.at(rng.random())) for name, prior in case.prior.items()}


def _measured(rng: np.random.Generator, rows: int, truth: dict[str, float]) -> tuple[Case, Table]:
    """The case of the recipe `wheel` with torque and sinkage of a soil, measured with noise."""
    case = read_recipe("wheel").case
    case = replace(case, noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(constant=5e-4)})
    slip, load = rng.uniform(0.05, 0.6, rows), rng.choice([35.0, 60.0, 85.0, 110.0], rows)
    true = case.with_values(truth)
    force = true.model(true.soil, Operating(slip=slip, load=load))
    columns: dict[str, Any] = {"run": np.full(rows, "a"), "slip": slip, "load_N": load}
    for name, value in (("torque_Nm", force.torque), ("sinkage_m", force.sinkage)):
        columns[name] = value + case.noise[name].std(value) * rng.standard_normal(rows)
    return case, Table(columns)


def _density(case: Case, table: Table) -> PosteriorDensity:
    return PosteriorDensity(case, usable_readings(case, table), select_free(case, None))


def _moments(sample: ImportanceSample) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    mean = sample.mean(sample.u)
    std = np.sqrt(sample.mean((sample.u - mean) ** 2))
    interval = import_module("soilml.identification.posterior").INTERVAL
    return mean, std, sample.quantiles(sample.u, interval)


def _rms(values: list[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _best(call: Callable[[], object], repeats: int) -> float:
    """Seconds of the fastest of several calls."""
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times)


if __name__ == "__main__":
    print(text())
