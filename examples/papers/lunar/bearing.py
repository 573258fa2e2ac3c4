"""What a file is worth whose bearing is wrong, beside one trained on soils of any bearing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from lunar.evaluation import SLIPS
from lunar.predictions import Mask
from lunar.sweep import Floats, add_torque_noise, soils, three_loads, wheel_forces

from soilml import Case, Estimate, Estimator
from soilml.report.aligned_text import format_table

#: True bearing over that of the soil's table, which the file of known bearing was trained on.
FACTORS = {"as in training": 1.0, "half": 0.5, "a quarter": 0.25}
SOILS = 200
PARAMETERS = [f"{what} {p}" for what in ("RMS", "width", "90 %") for p in ("c", "phi", "K")]
#: Errors that the sensors of a set share by default, none of which this simulation has.
EXACT = {"slip_bias": 0.0, "load_gain": 0.0, "torque_gain": 0.0, "model_error": 0.0}


def write_known(recipe: Path, spec: Path, out: Path) -> tuple[str, str]:
    """Recipe and spec of known bearing and without a set posterior, written into `out`."""
    lines = recipe.read_text(encoding="utf-8").splitlines(keepends=True)
    (out / recipe.name).write_text("".join(x for x in lines if not x.startswith("kphi")))
    (out / spec.name).write_text(spec.read_text(encoding="utf-8").partition("[set_posterior]")[0])
    return str(out / recipe.name), str(out / spec.name)


def show_bearing(
    case: Case, estimator: Estimator, known: Estimator, load: float, seed: int
) -> None:
    """Errors, widths and coverage of both files, for single readings and for sets.

    case: The model whose prior has the bearing (`kphi`).
    estimator: A file that was trained on that prior, with a set posterior.
    known: A file that was trained on the bearing of the soil's table.
    load: Of the single readings, N.
    """
    exact = estimator.on(**EXACT)
    at, loads = three_loads()
    single: list[tuple[str, ...]] = []
    sets: list[tuple[str, ...]] = []
    for said, factor in FACTORS.items():
        rng = np.random.default_rng(seed)
        values = soils(case, SOILS, rng)
        values[:, 3] = factor * case.soil.kphi
        one = add_torque_noise(case, wheel_forces(case, values[:, None], SLIPS, load).torque, rng)
        many = add_torque_noise(case, wheel_forces(case, values[:, None], at, loads).torque, rng)
        for name, file in (("known", known), ("unknown", estimator)):
            cells = _scores(file, file(slip=SLIPS, torque=one, load=load), values[:, None, :3])
            single.append((said, name, *cells))
        files: tuple[tuple[str, Callable[[Floats], Estimate]], ...] = (
            ("known, pooled", lambda row: known.run(slip=at, torque=row, load=loads)),
            ("unknown, set posterior", lambda row: estimator.run(slip=at, torque=row, load=loads)),
            ("the same, exact sensors", lambda row: exact.run(slip=at, torque=row, load=loads)),
        )
        for name, answer in files:
            found = [answer(row) for row in many]
            sets.append((said, name, *_scores_of_sets(estimator, found, values[:, :3])))
    header = ("true bearing", "bearing of the file", "in range", *PARAMETERS)
    print(f"\nTrue bearing, each reading alone: {SOILS} soils, {len(SLIPS)} slips at {load:g} N.")
    print("Error and width of the 90 % interval over those of the prior, coverage in %:\n")
    print(format_table(header, single, text_columns=2))
    print(f"\nTrue bearing, sets of {len(at)} readings at three loads, the same soils:\n")
    print(format_table(header, sets, text_columns=2))


def _scores(file: Estimator, found: Estimate, truth: Floats) -> list[str]:
    valid = np.broadcast_to(found.in_range, found.mean.shape[:-1])
    return _cells(file, found.mean - truth, found.low, found.high, truth, valid)


def _scores_of_sets(file: Estimator, found: list[Estimate], truth: Floats) -> list[str]:
    mean, low, high = (np.stack([getattr(e, n) for e in found]) for n in ("mean", "low", "high"))
    valid = np.asarray([bool(np.all(e.in_range)) for e in found])
    return _cells(file, mean - truth, low, high, truth, valid)


def _cells(
    file: Estimator, off: Floats, low: Floats, high: Floats, truth: Floats, valid: Mask
) -> list[str]:
    """Share in range; RMS error over the prior's std, width over its 90 % interval, coverage."""
    spread = file.prior.std
    width = 0.9 * (file.prior.upper - file.prior.lower)
    inside = (low <= truth) & (truth <= high)
    return [
        f"{100 * valid.mean():.0f} %",
        *(f"{x:.2f}" for x in np.sqrt(np.mean(off[valid] ** 2, axis=0)) / spread),
        *(f"{x:.2f}" for x in (high - low)[valid].mean(axis=0) / width),
        *(f"{100 * x:.0f}" for x in inside[valid].mean(axis=0)),
    ]
