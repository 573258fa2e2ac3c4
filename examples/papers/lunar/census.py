"""Many soils, of the wheel that was learned from and of the full integrals, as tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from lunar.many import (
    Drive,
    Foretold,
    Mask,
    by_bayes,
    by_estimate,
    by_prior,
    by_run,
    by_torque,
    drive,
)
from lunar.pull import band, everywhere
from lunar.sweep import Floats, driven, noisy, soils, table, three_loads

from soilml import Case, Estimator, Model, Wheel, identify
from soilml.io.text_tables import format_table
from soilml.quantities import SHEAR, Z_90

SOILS, FITTED = 200, 25
SLIPS = np.linspace(0.2, 0.6, 9)
DRIVEN = "wheel that was driven"
PARAMETERS = [f"{what} {p}" for what in ("bias", "RMS", "90 %") for p in ("c", "phi", "K")]


def show_many(case: Case, estimator: Estimator, load: float, seed: int) -> None:
    """What single readings and eighteen together are worth, whichever wheel is the true one."""
    full = replace(
        case, model=Model(Wheel(radius=case.model.gear.radius, width=case.model.gear.width))
    )
    truths = {
        "simplified, as learned": case,
        "full integrals": full,
        "full, theta_m (0.4 + 0.15 s) theta_1": full.with_values({"a0": 0.4, "a1": 0.15}),
    }
    estimates, pulls, fits = [], [], []
    for name, truth in truths.items():
        rng = np.random.default_rng(seed)
        seen = drive(truth, SLIPS, load, SOILS, rng)
        found = estimator(slip=SLIPS, torque=seen.torque, load=load)
        sound, values = found.in_range, seen.soils[:, None, :]
        inside = (found.low <= values) & (values <= found.high)
        cells = _errors((found.mean - values)[sound], inside[sound], found.prior_std)
        estimates.append((name, f"{100 * sound.mean():.1f} %", *cells))
        pulls += [(name, *line) for line in _pulls(case, truth, estimator, seen, sound, rng)]
        fits.append((name, *_fits(case, truth, load, rng)))
    show_limit(case, estimator, load, seed)
    print(
        f"\nEach reading alone, {SOILS} soils of the prior, {len(SLIPS)} slips each at {load:g} N."
    )
    print("Errors over the prior's spread, and truths inside the 90 % interval:\n")
    print(format_table((DRIVEN, "in range", *PARAMETERS), estimates))
    print(
        "\nDrawbar pull foretold, RMS error in N (truths inside the 90 % band); torque / r finds no"
    )
    print("soil, and takes off what the prior's soils lose in the mean:\n")
    header = (DRIVEN, "foretold at", "prior", "torque / r", "LS-SVM", f"LS-SVM, all {len(SLIPS)}")
    print(format_table(header, pulls, text_columns=2))
    print(f"\nLeast squares of the simplified model, 6 slips x 3 loads, {FITTED} soils:\n")
    print(format_table((DRIVEN, *PARAMETERS, "pull N"), fits))


def show_limit(case: Case, estimator: Estimator, load: float, seed: int) -> None:
    """How near the LS-SVM is to the best that one reading allows."""
    rng = np.random.default_rng(seed)
    seen = drive(case, SLIPS, load, SOILS, rng)
    best, mean = by_bayes(case, seen, SLIPS, rng)
    own = estimator(slip=SLIPS, torque=seen.torque, load=load).mean
    from_own = by_estimate(case, estimator, seen, SLIPS, rng)
    lines = []
    for name, found, pull in (
        ("LS-SVM", own, from_own),
        ("exact posterior mean", mean, best),
    ):
        off = np.mean((found - seen.soils[:, None, :]) ** 2, axis=(0, 1))
        share = 1.0 - off / np.var(seen.soils, axis=0)
        lines.append((name, *_each(share, "{:.2f}"), f"{pull.error(seen.pull):.2f}"))
    print("\nVariance of the soils that one reading explains (R2), and RMS error of the pull:\n")
    print(format_table(("", "c", "phi", "K", "pull N"), lines))


def _pulls(
    case: Case,
    truth: Case,
    estimator: Estimator,
    seen: Drive,
    sound: Mask,
    rng: np.random.Generator,
) -> list[tuple[str, ...]]:
    """At the slip of the reading, and at that as far on the other side of 0.4."""
    lines = []
    for said, at in (("its own slip", SLIPS), ("the slip mirrored at 0.4", SLIPS[::-1])):
        pull = driven(truth, seen.soils[:, None, :], at, seen.load).drawbar_pull
        found = [
            by_prior(case, seen, at, rng),
            by_torque(case, seen, at, rng),
            by_estimate(case, estimator, seen, at, rng),
        ]
        if at is SLIPS:
            found.append(by_run(case, estimator, seen, at, rng))
        cells = [_score(one, pull, sound) for one in found]
        lines.append((said, *cells, *[""] * (4 - len(cells))))
    return lines


def _fits(case: Case, truth: Case, load: float, rng: np.random.Generator) -> list[str]:
    """Least squares of the case's model on readings of the true one, at three loads."""
    values, (slip, loads) = soils(case, FITTED, rng), three_loads()
    torque = noisy(truth, driven(truth, values[:, None, :], slip, loads).torque, rng)
    fits = [identify(case, table(slip, row, loads)) for row in torque]
    mean = np.stack([fit.values for fit in fits])
    covariance = np.stack([fit.covariance for fit in fits])
    off, std = mean - values, np.stack([fit.std for fit in fits])
    spread = np.asarray([case.prior[name].std for name in SHEAR])
    pull = driven(truth, values[:, None, :], SLIPS, load).drawbar_pull
    found = Foretold(*band(case, *everywhere(mean, covariance, len(SLIPS)), SLIPS, load, rng))
    return [*_errors(off, np.abs(off) <= Z_90 * std, spread), _score(found, pull)]


def _errors(off: Floats, inside: Mask, spread: Floats) -> list[str]:
    """Bias and root mean square over the prior's spread, and share of truths inside, (n, 3)."""
    return [
        *_each(off.mean(axis=0) / spread, "{:+.2f}"),
        *_each(np.sqrt(np.mean(off**2, axis=0)) / spread, "{:.2f}"),
        *_each(100.0 * inside.mean(axis=0), "{:.0f} %"),
    ]


def _score(found: Foretold, pull: Floats, sound: Mask | bool = True) -> str:
    """Root mean square error, N, and in brackets the truths inside the band."""
    return f"{found.error(pull, sound):.2f} ({100 * found.held(pull, sound):.0f} %)"


def _each(values: Floats, form: str) -> list[str]:
    return [form.format(value) for value in values]
