"""What a trained file promised of the reading that it advised, beside what it then answered."""

from __future__ import annotations

import numpy as np
from advice import LOADS, measured
from runner import ROOT, Bench, Row, Sample, rms, table

from soilml import Case, Estimator, read_case
from soilml.experiment_design.design import SLIPS
from soilml.experiment_design.next_rows import advice_of_file
from soilml.fitting.coordinates import select_free
from soilml.identification.model_error_inputs import with_exact_model

MODES = ("default", "exact")
SOILS, QUICK_SOILS, SEED = 120, 4, 5
#: Readings before the advice.
DRIVEN = (1, 3, 6)
ABOUT = (
    "Width after the advised reading, as `estimate` promises it and as the file then answers: root "
    "mean squares in standard deviations of the prior. Sensors have the noise of examples/wheel "
    "and the usual errors that all readings share; `exact` is the file without model errors."
)


def cases(sample: Sample) -> list[Row]:
    """Numbers of readings by mode."""
    soils = QUICK_SOILS if sample.quick else SOILS
    return [{"rows": rows, "mode": mode, "soils": soils} for rows in DRIVEN for mode in MODES]


def promised(asked: Row) -> list[Row]:
    """Soils of the prior: the promise and the answer."""
    estimator = Estimator.load(ROOT / "exported" / "wheel.onnx")
    if asked["mode"] == "exact":
        estimator = with_exact_model(estimator)
    return promises(estimator, asked["soils"], asked["rows"])


def promises(estimator: Estimator, soils: int, rows: int, seed: int = SEED) -> list[Row]:
    """`promised` and `answered` widths (q,) of soils, in standard deviations of the prior."""
    case = read_case(ROOT / "examples" / "wheel" / "model.toml")
    rng, free = np.random.default_rng(seed), select_free(case, None)
    usual, found = estimator.sets.common_errors, []
    for _ in range(soils):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        points = [(float(rng.choice(SLIPS)), float(rng.choice(LOADS))) for _ in range(rows)]
        offset, load_gain, torque_gain = (
            usual[name] * float(rng.standard_normal())
            for name in ("slip_bias", "load_gain", "torque_gain")
        )
        shared = (offset, 1.0 + load_gain, 1.0 + torque_gain)
        normal = rng.standard_normal(rows + 1)
        readings = _readings(case, truth, points, normal[:rows], shared)
        told = estimator.run(**readings)
        if not told.in_range:
            continue
        best = advice_of_file(estimator, told.mean, told.covariance, readings).best()
        points.append((best.candidate.slip, best.candidate.load))
        after = estimator.run(**_readings(case, truth, points, normal, shared))
        answered = after.std / estimator.prior.std
        found.append({"promised": best.remaining_fraction, "answered": answered})
    return found


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
    torque = torque_gain * measured(case, truth, true, normal)["torque_Nm"]
    return {"slip": slip, "load": load, "torque": torque}


def tables(rows: list[Row]) -> str:
    """Promise beside answer, by parameter."""

    def cell(member: str, index: int):  # type: ignore[no-untyped-def]
        return lambda own: f"{rms([np.asarray(row[member])[index] for row in own]):.2f}"

    columns = {
        f"{member} {name}": cell(member, index)
        for member in ("promised", "answered")
        for index, name in enumerate(("c", "phi", "K"))
    }
    return table(rows, {"readings": "rows", "file": "mode"}, columns)


PROMISES = Bench("promises", "Advice on board: promise and answer", ABOUT, cases, promised, tables)
