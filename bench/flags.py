"""Detection of faults: what model files flag, and what a statistical test could flag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from faults import Fault, Readings, faults, simulate
from response_fits import POINTS, ResponseSurface, box_points, channels, parameter_values, weights
from runner import ROOT, Bench, Row, Sample, markdown

from datagen.recipe import read_recipe
from soilml import Estimator
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
QUICK_SETS, QUICK_VALID, QUICK_GROUPS = 6, 30, ("rows",)
FILES = ("wheel", "any_wheel")
#: The recipe's ranges, and the least share of rows in them for which tests are computed: with
#: fewer, a check of the range detects the fault.
SLIP_RANGE, LOAD_RANGE, MIN_IN_RANGE = (0.05, 0.6), (30.0, 120.0), 0.9
#: False alarm rate of the tests, and valid sets of each size that that of the files is measured on.
FALSE_ALARM_RATE, FALSE_ALARM_SETS = 0.01, 1000
COLUMNS = {"torque": "torque_Nm", "sinkage": "sinkage_m", "drawbar_pull": "drawbar_pull_N"}
NO_FAULT, ANY_DESIGN = Fault("-", "no fault"), "valid sets of the training distribution"
#: Detection rate that counts as detected; rms error in sigma below which a fault is harmless; set
#: size of the summary.
DETECTED, HARMLESS, SUMMARY_SIZE = 0.95, 1.3, 16
CHANNELS = {False: "torque only", True: "torque, sinkage and drawbar pull"}
ABOUT = (
    "Reference wheel, six slips at six loads, 2 % torque noise, 100 soils per fault; files with "
    "exact sensors. Detection rates in %: *flagged* by the file; by a *chi-square* test of the "
    "exact model without knowledge of the fault; and by a *likelihood-ratio* test. That test knows "
    "the fault and its size, and is about the most powerful test there is. Both tests have a false "
    "alarm rate of 1 %. *Error*: rms error of c, phi and K in standard deviations reported by "
    "`wheel.onnx`, over the sets that it does not flag; 1 for valid sets."
)


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


@cache
def studied() -> dict[str, tuple[int, Fault]]:
    """All faults by name, numbered, after none."""
    every = (NO_FAULT, *faults(read_recipe("wheel").case))
    return {fault.name: (i, fault) for i, fault in enumerate(every)}


def cases(sample: Sample) -> list[Row]:
    """Each fault, and valid sets of all designs."""
    sets, valid, alarms = SETS, VALID_SETS, FALSE_ALARM_SETS
    names = list(studied())
    if sample.quick:
        sets, valid, alarms = QUICK_SETS, QUICK_VALID, 20
        groups = ("-", *QUICK_GROUPS)
        names = [name for name, (_, fault) in studied().items() if fault.group in groups]
    found = [{"fault": name, "sets": sets, "valid": valid} for name in names]
    return [*found, {"fault": ANY_DESIGN, "sets": alarms, "valid": 0}]


def measured(asked: Row) -> list[Row]:
    """Detection rates of one fault by channels and set size."""
    case = read_recipe("wheel").case
    if asked["fault"] == ANY_DESIGN:
        return false_alarms(asked["sets"])
    axes = [PriorAxis.of(name, case.prior[name]) for name in SHEAR]
    number, fault = studied()[asked["fault"]]
    simulation = simulate_fault(fault, case, axes, 100 + number, asked["sets"], asked["valid"])
    return [
        {"all_channels": all_channels, "rows": rows}
        | detection_rates(simulation, rows, case, all_channels)
        for all_channels in CHANNELS
        for rows in SIZES
        if all_channels or not fault.sinkage_only
    ]


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
    fault: Fault, case: Case, axes: Sequence[PriorAxis], seed: int, sets: int, valid_sets: int
) -> FaultSimulation:
    """Simulate soils of the prior with a fault, and fit the models that may explain them."""
    true_case, rng = fault.case(case), np.random.default_rng(seed)
    u = rng.random((sets + valid_sets, 3))
    x = np.stack([a.quantile(u[:, i]) for i, a in enumerate(axes)], axis=1)
    theta = parameter_values(axes, x)
    true = simulate(true_case, theta[:sets], SLIP, LOAD)
    reported = fault.report(true)
    slip, load = reported["slip"][0], reported["load"][0]
    nodes = box_points(POINTS, 5)
    soils = parameter_values(axes, nodes)
    responses = fault.report(simulate(true_case, soils, SLIP, LOAD))
    with_fault = ResponseSurface.fit(nodes, channels(responses))
    readings = fault.report(add_noise(true, case, seed))
    if np.mean(within(slip, SLIP_RANGE) & within(load, LOAD_RANGE)) < MIN_IN_RANGE:
        return FaultSimulation(fault, theta[:sets], readings, readings, None, with_fault)
    nominal = ResponseSurface.fit(nodes, channels(simulate(case, soils, slip, load)))
    valid = add_noise(simulate(case, theta[sets:], slip, load), case, seed + 1)
    return FaultSimulation(fault, theta[:sets], readings, valid, nominal, with_fault)


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


def detection_rates(simulation: FaultSimulation, rows: int, case: Case, all_channels: bool) -> Row:
    """Rates of both files, of the chi-square and of the likelihood-ratio test.

    `error` is the rms error of the sets that each file does not flag, in the standard deviations
    that it reports, (files, 3); None where it flags all.
    """
    order = shuffled_conditions(len(simulation.truth), 3)[:, :rows]
    r = select_rows(simulation.readings, simulation.fault, order)
    rates, errors = [], []
    for file in files():
        mean, std, flagged = run_file(file, r, noise_std(r, case), all_channels)
        rates.append(float(flagged.mean()))
        error = ((mean - simulation.truth) / std)[~flagged]
        errors.append(np.sqrt(np.mean(error**2, axis=0)) if len(error) else None)
    tests = exact_test_rates(simulation, rows, case, all_channels)
    return {"rates": (*rates, *tests), "error": errors}


@cache
def files() -> list[Estimator]:
    """Both files, the second configured for the wheel of the recipe."""
    case = read_recipe("wheel").case
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
    wheel, any_wheel = (Estimator.load(ROOT / "exported" / f"{name}.onnx") for name in FILES)
    return [wheel.on(**exact), any_wheel.on(**context, **exact)]


def false_alarms(sets: int) -> list[Row]:
    """Share flagged of valid sets, over all designs of the training distribution."""
    found, family = [], RecipeFamily.of(read_recipe("wheel"), SHEAR)
    for rows in SIZES:
        own = family.sets(sets, rows, 4711)
        std = {name: own.readings[f"{name}_std"] for name in COLUMNS}
        read = {k: np.where(v < ABSENT_STD, own.readings[k], np.nan) for k, v in std.items()}
        readings = {k: own.readings[k] for k in ("slip", "load")} | read
        shares = [run_file(file, readings, std, True)[2].mean() for file in files()]
        found.append({"all_channels": True, "rows": rows, "rates": shares, "error": None})
    return found


def tables(rows: list[Row]) -> str:
    """A verdict for each fault, rates by set size, and false alarms."""
    alarms = [r for r in rows if r["fault"] == ANY_DESIGN]
    rest, parts = [r for r in rows if r["fault"] != ANY_DESIGN], []
    for three, title in CHANNELS.items():
        own = [r for r in rest if r["all_channels"] == three]
        lines = [
            (
                r["fault"],
                *(f"{100 * r['rates'][i]:.0f}" for i in (0, 2, 3)),
                _errors(r),
                verdict(r),
            )
            for r in own
            if r["rows"] == SUMMARY_SIZE
        ]
        head = ("flagged", "chi-square", "likelihood ratio", "error, sigma", "verdict")
        parts += [f"### {SUMMARY_SIZE} rows, {title}", markdown(("fault", *head), lines)]
    sizes = [f"{n} row{'s' if n > 1 else ''}" for n in SIZES]
    for three, title in CHANNELS.items():
        own = [r for r in rest if r["all_channels"] == three]
        lines = [
            (name, *("/".join(f"{100 * x:.0f}" for x in r["rates"]) for r in own
                     if r["fault"] == name))
            for name in dict.fromkeys(r["fault"] for r in own)
        ]  # fmt: skip
        words = "wheel.onnx / any_wheel.onnx / chi-square / likelihood ratio"
        parts += [f"### By set size, {title}: {words}", markdown(("fault", *sizes), lines)]
    shares = (" / ".join(f"{100 * share:.1f}" for share in r["rates"]) for r in alarms)
    words = "Valid sets that are flagged, in %, by wheel.onnx / any_wheel.onnx."
    lines = [(f"{alarms[0]['sets']} sets each", *shares)] if alarms else []
    parts += ["### False alarms", words, markdown(("no fault", *sizes), lines)]
    return "\n\n".join(parts)


def _errors(row: Row) -> str:
    error = row["error"][0]
    return "- - -" if error is None else " ".join(f"{e:.1f}" for e in error)


def verdict(row: Row) -> str:
    """In words, for the first file."""
    (file, *_, chi_square, likelihood_ratio), error = row["rates"], row["error"][0]
    if file >= DETECTED:
        return "flagged"
    if chi_square >= DETECTED:
        return "could be flagged"
    if max(error) < HARMLESS:
        return "harmless"
    return "targeted test only" if likelihood_ratio >= DETECTED else "mimics another soil"


FLAGS = Bench(
    "flags", "Detection of faulty readings and wrong models", ABOUT, cases, measured, tables
)
