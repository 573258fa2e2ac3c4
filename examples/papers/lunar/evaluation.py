"""Evaluation over many soils, for the training wheel and for the full integrals, as tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lunar.predictions import (
    Mask,
    PullPredictions,
    SimulatedReadings,
    predict_from_estimate,
    predict_from_pooled_readings,
    predict_from_posterior,
    predict_from_prior,
    predict_from_torque,
    simulate_readings,
)
from lunar.pull import pull_interval, repeat_over_slips
from lunar.sweep import Floats, add_torque_noise, soils, table, three_loads, wheel_forces

from soilml import Case, Estimator, Model, Wheel, identify
from soilml.quantities import SHEAR, Z_90
from soilml.report.aligned_text import format_table

SOILS, FITTED = 200, 25
SLIPS = np.linspace(0.2, 0.6, 9)
DRIVEN = "true wheel"
PARAMETERS = [f"{what} {p}" for what in ("bias", "RMS", "90 %") for p in ("c", "phi", "K")]


def show_evaluation(case: Case, estimator: Estimator, load: float, seed: int) -> None:
    """Accuracy of single readings and of eighteen pooled, for several true wheels."""
    full = replace(
        case, model=Model(Wheel(radius=case.model.gear.radius, width=case.model.gear.width))
    )
    truths = {
        "simplified, as in training": case,
        "full integrals": full,
        "full, theta_m (0.4 + 0.15 s) theta_1": full.with_values({"a0": 0.4, "a1": 0.15}),
    }
    estimates, pulls, fits = [], [], []
    for name, truth in truths.items():
        rng = np.random.default_rng(seed)
        data = simulate_readings(truth, SLIPS, load, SOILS, rng)
        found = estimator(slip=SLIPS, torque=data.torque, load=load)
        valid, values = found.in_range, data.soils[:, None, :3]
        inside = (found.low <= values) & (values <= found.high)
        cells = _errors((found.mean - values)[valid], inside[valid], found.prior_std)
        estimates.append((name, f"{100 * valid.mean():.1f} %", *cells))
        pulls += [(name, *line) for line in _pulls(case, truth, estimator, data, valid, rng)]
        fits.append((name, *_fits(case, truth, load, rng)))
    show_bayes_limit(case, estimator, load, seed)
    print(
        f"\nEach reading alone, {SOILS} soils of the prior, {len(SLIPS)} slips each at {load:g} N."
    )
    print("Errors over the prior's standard deviation, and coverage of the 90 % interval:\n")
    print(format_table((DRIVEN, "in range", *PARAMETERS), estimates))
    print("\nDrawbar pull, RMS error in N (coverage of the 90 % interval); torque / r estimates no")
    print("soil, and subtracts the mean loss over the prior's soils:\n")
    header = (DRIVEN, "predicted at", "prior", "torque / r", "LS-SVM", f"all {len(SLIPS)}")
    print(format_table(header, pulls, text_columns=2))
    print(f"\nLeast squares of the simplified model, 6 slips x 3 loads, {FITTED} soils:\n")
    print(format_table((DRIVEN, *PARAMETERS, "pull N"), fits))


def show_bayes_limit(case: Case, estimator: Estimator, load: float, seed: int) -> None:
    """Accuracy of the LS-SVM relative to the optimum for one reading."""
    rng = np.random.default_rng(seed)
    data = simulate_readings(case, SLIPS, load, SOILS, rng)
    best, mean = predict_from_posterior(case, data, SLIPS, rng)
    own = estimator(slip=SLIPS, torque=data.torque, load=load).mean
    from_own = predict_from_estimate(case, estimator, data, SLIPS, rng)
    lines = []
    for name, found, pull in (
        ("LS-SVM", own, from_own),
        ("exact posterior mean", mean, best),
    ):
        off = np.mean((found - data.soils[:, None, :3]) ** 2, axis=(0, 1))
        share = 1.0 - off / np.var(data.soils[:, :3], axis=0)
        lines.append((name, *_each(share, "{:.2f}"), f"{pull.error(data.pull):.2f}"))
    print("\nVariance of the soils that one reading explains (R2), and RMS error of the pull:\n")
    print(format_table(("", "c", "phi", "K", "pull N"), lines))


def _pulls(
    case: Case,
    truth: Case,
    estimator: Estimator,
    data: SimulatedReadings,
    valid: Mask,
    rng: np.random.Generator,
) -> list[tuple[str, ...]]:
    """At the slip of the reading, and at the slip mirrored at 0.4."""
    lines = []
    for said, at in (("its own slip", SLIPS), ("the slip mirrored at 0.4", SLIPS[::-1])):
        pull = wheel_forces(truth, data.soils[:, None, :], at, data.load).drawbar_pull
        found = [
            predict_from_prior(case, data, at, rng),
            predict_from_torque(case, data, at, rng),
            predict_from_estimate(case, estimator, data, at, rng),
        ]
        if at is SLIPS:
            found.append(predict_from_pooled_readings(case, estimator, data, at, rng))
        cells = [_score(one, pull, valid) for one in found]
        lines.append((said, *cells, *[""] * (4 - len(cells))))
    return lines


def _fits(case: Case, truth: Case, load: float, rng: np.random.Generator) -> list[str]:
    """Least squares with the case's model on readings of the true one, at three loads."""
    values, (slip, loads) = soils(case, FITTED, rng), three_loads()
    torque = add_torque_noise(
        truth, wheel_forces(truth, values[:, None, :], slip, loads).torque, rng
    )
    fits = [identify(case, table(slip, row, loads), method="nonlinear") for row in torque]
    mean = np.stack([fit.values for fit in fits])
    covariance = np.stack([fit.covariance for fit in fits])
    off, std = (mean - values)[:, :3], np.stack([fit.std for fit in fits])[:, :3]
    spread = np.asarray([case.prior[name].std for name in SHEAR])
    pull = wheel_forces(truth, values[:, None, :], SLIPS, load).drawbar_pull
    found = PullPredictions(
        *pull_interval(case, *repeat_over_slips(mean, covariance, len(SLIPS)), SLIPS, load, rng)
    )
    return [*_errors(off, np.abs(off) <= Z_90 * std, spread), _score(found, pull)]


def _errors(off: Floats, inside: Mask, spread: Floats) -> list[str]:
    """Bias and root mean square over the prior's std, and coverage, (n, 3)."""
    return [
        *_each(off.mean(axis=0) / spread, "{:+.2f}"),
        *_each(np.sqrt(np.mean(off**2, axis=0)) / spread, "{:.2f}"),
        *_each(100.0 * inside.mean(axis=0), "{:.0f} %"),
    ]


def _score(found: PullPredictions, pull: Floats, valid: Mask | bool = True) -> str:
    """Root mean square error, N, and in brackets the coverage."""
    return f"{found.error(pull, valid):.2f} ({100 * found.coverage(pull, valid):.0f} %)"


def _each(values: Floats, form: str) -> list[str]:
    return [form.format(value) for value in values]
