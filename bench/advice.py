"""The advised next row against a random one and a repetition, on soils that are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from runner import ROOT, Bench, Row, Sample, rms, table

from soilml import Case, Operating, identify, read_case
from soilml.experiment_design import advise, candidate_grid, samples_of_rows
from soilml.experiment_design.design import SLIPS
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.table import Table

LOADS = (30.0, 42.0, 60.0, 85.0, 120.0)
SOILS, QUICK_SOILS, SAMPLES = 120, 3, 1024
#: Rows of the first drive, which are the seeds of the soils too.
DRIVEN = (1, 3)
#: Rows after the first drive, by name; `nothing` is no further row.
KINDS = ("nothing", "repeat", "random", "advised")
EXPECTED = "advised, as expected"
ABOUT = (
    "Remaining fraction of the prior width after one more reading, where that is the advised one, "
    "a repetition, or a random one (docs/how-to/priors-and-noise.md), and the error: root mean "
    "squares over "
    f"{SOILS} soils, in standard deviations of the prior."
)


def cases(sample: Sample) -> list[Row]:
    """All soils of each number of rows: they are drawn one after another."""
    soils = QUICK_SOILS if sample.quick else SOILS
    return [{"rows": rows, "soils": soils, "seed": rows} for rows in DRIVEN]


def driven(asked: Row) -> list[Row]:
    """Soils by kind of next row: error and width, in standard deviations of the prior."""
    case = read_case(ROOT / "examples" / "wheel" / "model.toml")
    return advised(case, asked["rows"], asked["soils"], asked["seed"])


def advised(case: Case, rows: int, soils: int, seed: int, samples: int = SAMPLES) -> list[Row]:
    """Draw soils from the prior, drive `rows` at one slip and load, then one more row of each kind.

    The drawn point and the next ones are of one grid of slips and loads; the torque is measured
    with the case's noise, the same draw of it whichever next row is driven. `width` of the last
    kind is what the advice said would be left.
    """
    rng = np.random.default_rng(seed)
    free = select_free(case, None)
    spread = np.asarray([f.prior.std for f in free])
    found: list[Row] = []
    for _ in range(soils):
        truth = {f.path: float(f.prior.at(rng.random())) for f in free}
        values = np.asarray(list(truth.values()))
        first, other = ((rng.choice(SLIPS), rng.choice(LOADS)) for _ in range(2))
        normal = rng.standard_normal(rows + 1)
        table = measured(case, truth, [first] * rows, normal[:rows])
        data = usable_readings(case, table)
        belief = samples_of_rows(case, data, free, samples, exact_model=True)
        best = advise(case, belief, candidate_grid(SLIPS, LOADS), channels=("torque",)).best()
        points = (first, other, (best.candidate.slip, best.candidate.load))
        tables = [measured(case, truth, [*[first] * rows, point], normal) for point in points]
        for kind, own in zip(KINDS, (table, *tables), strict=True):
            fit = identify(case, own, None, "posterior")
            error = (fit.values - values) / spread
            found.append({"kind": kind, "width": fit.std / spread, "error": error})
        found.append({"kind": EXPECTED, "width": best.remaining_fraction, "error": None})
    return found


def measured(
    case: Case,
    truth: dict[str, float],
    points: Sequence[tuple[float, float]],
    normal: np.ndarray,
) -> Table:
    """Rows at some slips and loads."""
    slip, load = np.asarray(points, dtype=float).T
    true = case.with_values(truth)
    torque = np.asarray(true.model(true.soil, Operating(slip=slip, load=load)).torque)
    torque = torque + case.noise["torque_Nm"].std(torque) * normal
    run = np.full(len(slip), "a")
    return Table({"run": run, "slip": slip, "load_N": load, "torque_Nm": torque})


def tables(rows: list[Row]) -> str:
    """Width and error that each next row leaves."""

    def cell(member: str, index: int | None):  # type: ignore[no-untyped-def]
        def text(own: list[Row]) -> str:
            values = [np.asarray(row[member]) for row in own if row[member] is not None]
            part = [v if index is None else v[index] for v in values]
            return f"{rms(part):.3f}" if part else ""

        return text

    columns = {
        f"{title} {name}": cell(member, index)
        for title, member in (("std left", "width"), ("RMSE", "error"))
        for name, index in (("c", 0), ("phi", 1), ("K", 2), ("all", None))
    }
    by = {"rows at one slip and load": "rows", "then one row": "kind"}
    ordered = sorted(rows, key=lambda r: (r["rows"], (*KINDS, EXPECTED).index(r["kind"])))
    return table(ordered, by, columns)


ADVICE = Bench(
    "advice", "Experimental design: benefit of the advised reading", ABOUT, cases, driven, tables
)
