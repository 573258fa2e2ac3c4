"""Detection of faults: what model files flag, and what a statistical test could flag.

`python bench/flags.py [wheel.onnx any_wheel.onnx]` prints the tables.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from benchmarks_file import ROOT
from faults import Fault, Readings, faults, simulate
from fits import POINTS, ResponseSurface, box_points, channels, parameter_values, weights
from flags_page import (
    ABOUT,
    BY_SIZE,
    FALSE_ALARMS,
    DetectionRates,
    all_sizes_table,
    header,
    summary_table,
)

from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.cli.progress import progress_bar
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.onboard.set_contract import ABSENT_STD, COMMON_ERROR_INPUTS
from soilml.quantities import SHEAR
from training.set_posterior.families.coordinates import PriorAxis
from training.set_posterior.families.recipe_family import RecipeFamily

Floats = np.ndarray[Any, np.dtype[np.float64]]
Order = np.ndarray[Any, np.dtype[np.int64]]

#: Operating conditions: six slips at six loads (N); sets have the first rows of a shuffle of them.
SLIP = np.repeat([0.08, 0.14, 0.21, 0.29, 0.38, 0.48], 6)
LOAD = np.tile([40.0, 52.0, 65.0, 79.0, 94.0, 110.0], 6)
SIZES = (1, 6, 16, 32)
#: Sets of each fault and size, and valid sets that set the thresholds of the tests.
SETS, VALID_SETS = 100, 300
RELEASED = [str(ROOT / "exported" / name) for name in ("wheel.onnx", "any_wheel.onnx")]
#: The recipe's ranges, and the least share of rows in them for which tests are computed: with
#: fewer, a check of the range detects the fault.
SLIP_RANGE, LOAD_RANGE, MIN_IN_RANGE = (0.05, 0.6), (30.0, 120.0), 0.9
#: False alarm rate of the tests.
FALSE_ALARM_RATE = 0.01
#: Valid sets of each size that the false alarm rate of the files is measured on.
FALSE_ALARM_SETS = 1000
COLUMNS = {"torque": "torque_Nm", "sinkage": "sinkage_m", "drawbar_pull": "drawbar_pull_N"}


@dataclass(frozen=True)
class FaultSimulation:
    """Simulated readings with one fault, and the models that may explain them.

    `valid` are readings without the fault, of other soils, at the reported slips and loads;
    `nominal` is the response surface of the model without the fault, None where reported slips or
    loads are out of range; `with_fault` that of the model with the fault.
    """

    fault: Fault
    truth: Floats  # (sets, 3)
    readings: Readings  # (sets, conditions)
    valid: Readings
    nominal: ResponseSurface | None
    with_fault: ResponseSurface


def noise_std(r: Readings, case: Case) -> Readings:
    """Standard deviations of readings under the recipe's noise."""
    return {name: np.asarray(case.noise[key].std(r[name])) for name, key in COLUMNS.items()}


def add_noise(r: Readings, case: Case, seed: int) -> Readings:
    """Readings with the recipe's noise."""
    rng, std = np.random.default_rng(seed), noise_std(r, case)
    return r | {k: r[k] + std[k] * rng.standard_normal(std[k].shape) for k in COLUMNS}


def shuffled_conditions(sets: int, seed: int) -> Order:
    """Order (sets, conditions) of rows: every slip once, then every slip at another load, ..."""
    rng = np.random.default_rng(seed)
    loads, slips = (rng.permuted(np.tile(np.arange(6), (sets, 6, 1)), axis=2) for _ in range(2))
    chosen = np.take_along_axis(loads.swapaxes(1, 2), slips, axis=2)  # (sets, round, position)
    return (6 * slips + chosen).reshape(sets, 36)


def simulate_fault(
    fault: Fault, case: Case, axes: Sequence[PriorAxis], seed: int
) -> FaultSimulation:
    """Simulate soils of the prior with a fault, and fit the models that may explain them."""
    true_case, rng = fault.case(case), np.random.default_rng(seed)
    u = rng.random((SETS + VALID_SETS, 3))
    x = np.stack([a.quantile(u[:, i]) for i, a in enumerate(axes)], axis=1)
    theta = parameter_values(axes, x)
    true = simulate(true_case, theta[:SETS], SLIP, LOAD)
    reported = fault.report(true)
    slip, load = reported["slip"][0], reported["load"][0]
    nodes = box_points(POINTS, 5)
    soils = parameter_values(axes, nodes)
    responses = fault.report(simulate(true_case, soils, SLIP, LOAD))
    with_fault = ResponseSurface.fit(nodes, channels(responses))
    readings = fault.report(add_noise(true, case, seed))
    if np.mean(within(slip, SLIP_RANGE) & within(load, LOAD_RANGE)) < MIN_IN_RANGE:
        return FaultSimulation(fault, theta[:SETS], readings, readings, None, with_fault)
    nominal = ResponseSurface.fit(nodes, channels(simulate(case, soils, slip, load)))
    valid = add_noise(simulate(case, theta[SETS:], slip, load), case, seed + 1)
    return FaultSimulation(fault, theta[:SETS], readings, valid, nominal, with_fault)


def within(x: Floats, ends: tuple[float, float]) -> Any:
    """Whether values lie in a range."""
    return (x >= ends[0]) & (x <= ends[1])


def select_rows(r: Readings, fault: Fault | None, order: Order) -> Readings:
    """Rows (sets, rows) in this order, with the fault's mixing of rows."""
    own, other = (
        {k: np.take_along_axis(v, order, axis=1) for k, v in source.items()}
        for source in (r, {k: np.roll(v, 1, axis=0) for k, v in r.items()})
    )
    return own if fault is None else fault.mix_rows(own, other)


def chi_squares(
    simulation: FaultSimulation, r: Readings, order: Order, case: Case, all_channels: bool
) -> tuple[Floats, Floats]:
    """Chi-square (sets,) of the nominal model, and its decrease by the model with the fault."""
    assert simulation.nominal is not None
    full = {k: np.ones((len(order), len(SLIP))) for k in r}
    for name, value in full.items():
        np.put_along_axis(value, order, r[name], axis=1)
    y, std = channels(full), noise_std(full, case)
    columns = len(SLIP) * (3 if all_channels else 1)

    def min_chi_square(surface: ResponseSurface, rows: slice) -> Floats:
        used = np.zeros_like(full["slip"])
        np.put_along_axis(used, order[:, rows], 1.0, axis=1)
        own = weights(full, std, used, all_channels)[:, :columns]
        return ResponseSurface(surface.coefficients[:, :columns]).min_chi_square(
            y[:, :columns], own
        )

    nominal = min_chi_square(simulation.nominal, slice(None))
    groups = simulation.fault.partition(order.shape[1])
    explained = [min_chi_square(simulation.with_fault, group) for group in groups]
    return nominal, nominal - np.sum(explained, axis=0)


def exact_test_rates(
    simulation: FaultSimulation, rows: int, case: Case, all_channels: bool
) -> tuple[float, float]:
    """Detection rates of the chi-square test and of the likelihood-ratio test, at 1 %."""
    if simulation.nominal is None:
        return 1.0, 1.0
    statistics = []
    for r, fault, seed in ((simulation.readings, simulation.fault, 3), (simulation.valid, None, 4)):
        order = shuffled_conditions(len(r["slip"]), seed)[:, :rows]
        selected = select_rows(r, fault, order)
        statistics.append(chi_squares(simulation, selected, order, case, all_channels))
    faulty, valid = statistics
    thresholds = [np.quantile(v, 1.0 - FALSE_ALARM_RATE) for v in valid]
    chi_square, ratio = (float(np.mean(v > t)) for v, t in zip(faulty, thresholds, strict=True))
    return chi_square, ratio


def run_file(estimator: Estimator, r: Readings, std: Readings, all_channels: bool) -> Any:
    """Mean (sets, 3), standard deviation (sets, 3) and flag (sets,); refused input is flagged."""
    names = ("slip", "load", "torque") + (("sinkage", "drawbar_pull") if all_channels else ())
    outcomes = []
    for i in range(len(r["slip"])):
        rows = {name: r[name][i] for name in names}
        rows |= {f"{name}_std": std[name][i] for name in names[2:]} | {"torque_bias": 0.0}
        try:
            estimate = estimator.run(**rows)
            outcomes.append((estimate.mean, estimate.std, not bool(estimate.in_range)))
        except InputError:
            outcomes.append((np.full(3, np.nan), np.ones(3), True))
    return tuple(np.asarray(part) for part in zip(*outcomes, strict=True))


def detection_rates(
    simulation: FaultSimulation,
    rows: int,
    case: Case,
    files: Sequence[Estimator],
    all_channels: bool,
) -> DetectionRates:
    """Detection rates of one fault at one set size."""
    order = shuffled_conditions(SETS, 3)[:, :rows]
    r = select_rows(simulation.readings, simulation.fault, order)
    rates, errors = [], []
    for file in files:
        mean, std, flagged = run_file(file, r, noise_std(r, case), all_channels)
        rates.append(float(flagged.mean()))
        error = ((mean - simulation.truth) / std)[~flagged]
        rms = np.sqrt(np.mean(error**2, axis=0)) if len(error) else np.full(3, np.nan)
        errors.append(rms)
    tests = exact_test_rates(simulation, rows, case, all_channels)
    return DetectionRates((*rates, *tests), np.stack(errors))


def load_files(case: Case, wheel: str, any_wheel: str) -> list[Estimator]:
    """Both files, the second configured for the wheel of the recipe."""
    gear: Any = case.model.gear
    context = {
        "wheel_radius": gear.radius,
        "wheel_width": gear.width,
        "bearing_modulus": case.soil.kc / gear.width + case.soil.kphi,
        "n": case.soil.n,
        "bearing_std": 0.0,
        "cohesion_max": case.prior["cohesion"].upper,
        "shear_modulus_max": case.prior["shear_modulus"].upper,
    }
    exact = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
    return [Estimator.load(wheel).on(**exact), Estimator.load(any_wheel).on(**context, **exact)]


def measured(
    files: Sequence[str], only: Callable[[Fault], bool] = lambda fault: True
) -> dict[tuple[Fault, bool, int], DetectionRates]:
    """Detection rates by fault, channels and set size."""
    case = read_recipe("wheel").case
    axes = [PriorAxis.of(name, case.prior[name]) for name in SHEAR]
    estimators, rates = load_files(case, *files), {}
    studied = [Fault("-", "no fault"), *filter(only, faults(case))]
    with progress_bar("simulating", len(studied)) as done:
        for i, fault in enumerate(studied):
            simulation = simulate_fault(fault, case, axes, 100 + i)
            for all_channels in (False, True):
                for rows in SIZES:
                    if all_channels or not fault.sinkage_only:
                        rates[fault, all_channels, rows] = detection_rates(
                            simulation, rows, case, estimators, all_channels
                        )
            done(i + 1)
    return rates


def false_alarm_table(files: Sequence[str] = RELEASED) -> str:
    """Share flagged of valid sets, over all designs of the training distribution."""
    recipe = read_recipe("wheel")
    estimators, shares = load_files(recipe.case, *files), []
    for rows in SIZES:
        sets = RecipeFamily.of(recipe, SHEAR).sets(FALSE_ALARM_SETS, rows, 4711)
        std = {name: sets.readings[f"{name}_std"] for name in COLUMNS}
        read = {k: np.where(v < ABSENT_STD, sets.readings[k], np.nan) for k, v in std.items()}
        readings = {k: sets.readings[k] for k in ("slip", "load")} | read
        shares.append([run_file(file, readings, std, True)[2].mean() for file in estimators])
    cells = [" / ".join(f"{100 * share:.1f}" for share in own) for own in shares]
    row = f"| {FALSE_ALARM_SETS} sets each | {' | '.join(cells)} |"
    return "\n".join([header("no fault", SIZES), row])


def tables(files: Sequence[str] = RELEASED) -> str:
    """Markdown of all faults."""
    rates = measured(files)
    return "\n\n".join(
        [
            ABOUT,
            summary_table(rates),
            FALSE_ALARMS,
            false_alarm_table(files),
            BY_SIZE,
            all_sizes_table(rates, SIZES),
        ]
    )


if __name__ == "__main__":
    print(tables(sys.argv[1:] or RELEASED))
