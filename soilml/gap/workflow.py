"""The whole of a gap analysis, from a table to a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.checks import Gate, examined, repeated_noise, without_repeats
from soilml.gap.data.observations import Cells, cells_of
from soilml.gap.design.discriminating_runs import next_runs
from soilml.gap.messages import not_claimed, sentence
from soilml.gap.results import Curves, GapReport, Shrink, Tried
from soilml.gap.search.candidate_fits import Candidate
from soilml.gap.search.cross_validation import held_out_region, held_out_runs, shrink, unseen
from soilml.gap.search.iteration import Analysis, analysed
from soilml.gap.search.residual_trend import remainder
from soilml.gap.search.stepwise import REJECTED
from soilml.gap.search.updated_case import grown_case
from soilml.gap.search.verdict import likeness, map_of, named, status_of, values_of
from soilml.gap.statistics.coordinates import predicted
from soilml.gap.statistics.least_squares import GapFit
from soilml.gap.statistics.reml_covariance import FEW_RUNS
from soilml.identification.compatibility import check_wheel_size
from soilml.identification.free_parameters import FreeParameter, select_free
from soilml.io.table import Table
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.quantities import SHEAR, column


def gap(
    case: Case,
    table: Table,
    *,
    free: Sequence[str] | None = None,
    holdout: str | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    calibration: Mapping[str, float] | None = None,
    seed: int = 0,
) -> GapReport:
    """Find where a model and measured rows disagree, and name what is missing from the model.

    `free` names the soil parameters that may differ from the case's; without it, those that have a
    prior. `holdout` is `run` (a quarter of the runs) or `COLUMN=VALUE`: rows that take no part in
    anything but the last figures. `calibration` gives the spread of a sensor's fault by effect name
    where it was checked, in the unit of its size. Same input, same answer.

    Raises `InputError` and `TableError` for names, columns and rows that make no sense; data that
    cannot be analysed give a report of status `bad-data`.
    """
    effects = {name: e for name, e in effects.items() if e.applies_to(case.model.gear)}
    check_wheel_size(case, table)
    answered = table.answered
    if not answered.any():
        raise InputError(f"{table.source}: no row has the status ok")
    table, unanswered = table.rows(answered), int(np.count_nonzero(~answered))
    table, repeats = without_repeats(table)
    seen, kept_back, what = _split(table, holdout, seed)
    wanted = select_free(case, free if free is not None or case.prior else SHEAR)
    for f in wanted:
        if free is not None and "." in f.path:
            raise InputError(f"--free {f.path} is no soil parameter; only those may differ here")
    soil = [f for f in wanted if "." not in f.path]
    cells = cells_of(case, seen)
    noise, notes = repeated_noise(cells)
    cells, left_out = cells.with_noise(noise).declared()
    notes += left_out
    gate = examined(cells, seen, repeats, len(soil))
    if gate.refused:
        return _refused(case, (*gate.refused, *gate.unnameable), gate.notes, seed)
    if unanswered:
        notes.append(
            "1 row is left out: its status is not ok"
            if unanswered == 1
            else f"{unanswered} rows are left out: their status is not ok"
        )
    gate = replace(gate, notes=(*notes, *gate.notes))
    found = analysed(case, soil, cells, effects, calibration or {}, seed, seen.place)
    if found.refused:
        return _refused(case, (found.refused,), gate.notes, seed)
    beyond = None if kept_back is None else cells_of(case, kept_back).with_noise(noise)
    if beyond is not None:
        beyond = beyond.keeping(np.isfinite(beyond.std))
    return _reported(case, found, gate, soil, beyond, what, seed)


def _refused(case: Case, reasons: Sequence[str], notes: tuple[str, ...], seed: int) -> GapReport:
    """The report on data that cannot be analysed."""
    return GapReport(
        "bad-data", "; ".join(reasons), case, reasons=tuple(reasons), notes=notes, seed=seed
    )


def _split(table: Table, holdout: str | None, seed: int) -> tuple[Table, Table | None, str]:
    """The rows to analyse, those kept back, and what those are."""
    if holdout is None:
        return table, None, ""
    if holdout == "run":
        runs = np.unique(table["run"])
        if runs.size < 4:
            raise InputError(f"--holdout run needs four runs or more; the table has {runs.size}")
        out = np.random.default_rng(seed).permutation(runs)[: max(1, runs.size // 4)]
        back = np.isin(table["run"], out)
        what = f"runs {', '.join(sorted(map(str, out)))}, kept back"
    else:
        name, equals, value = holdout.partition("=")
        if not equals:
            raise InputError(f"--holdout is {holdout!r}; needed is run, or COLUMN=VALUE")
        kept = table.where(name, value)
        back = np.isin(np.arange(len(table)), _positions(table, kept))
        what = f"{holdout}, kept back"
    if back.all():
        raise InputError(f"--holdout {holdout} keeps every row back; nothing is left to analyse")
    return table.rows(~back), table.rows(back), what


def _positions(table: Table, rows: Table) -> NDArray[np.int64]:
    """Where the rows of a part stand in the whole: by line where there are lines."""
    if len(table.line):
        return np.flatnonzero(np.isin(table.line, rows.line))
    keys = [tuple(str(table[n][i]) for n in table.columns) for i in range(len(table))]
    own = {tuple(str(rows[n][i]) for n in rows.columns) for i in range(len(rows))}
    return np.asarray([i for i, key in enumerate(keys) if key in own], dtype=np.int64)


def _reported(
    case: Case,
    analysis: Analysis,
    gate: Gate,
    free: Sequence[FreeParameter],
    beyond: Cells | None,
    what: str,
    seed: int,
) -> GapReport:
    bench, found = analysis.bench, analysis.found
    after = found.causes[0].fit if found.causes else found.soil
    gaps = _gaps(analysis, after, seed)
    status = status_of(found, gate.unnameable, gaps.get("held_out_runs"))
    if beyond is not None and len(beyond):  # after the verdict, in which they take no part
        name = "held_out_runs" if what.startswith("runs") else "held_out_region"
        gaps[name] = unseen(bench, found.soil, after, beyond, what)
    claimed = status in ("named", "form-open", "class")
    if not claimed:  # the figures are those of the model that is handed over
        after, gaps = found.soil, {name: s.unchanged() for name, s in gaps.items()}
    alike = likeness(bench, after) if claimed else None
    rivals = _rivals(found.causes, found.tried)
    report = GapReport(
        status=status,
        sentence="",
        model=grown_case(after),
        effects=() if alike is None else tuple(named(found.causes, alike)),
        cause_set=tuple(c.names for c in found.causes) if claimed else (),
        stand_in=() if claimed or not found.causes else found.causes[0].names,
        reasons=gate.unnameable if status == "not-testable" else (),
        where=tuple(map_of(bench, found.soil, seed)) if found.gap else (),
        gap=gaps,
        soil_before=values_of(found.soil, soil=True),
        soil_after=values_of(after, soil=True),
        mimic_radius=0.0 if alike is None else alike.mimicry(found.causes[0].names),
        next_runs=tuple(next_runs(bench, rivals)) if found.gap else (),
        tried=tuple(_tried(analysis, claimed=claimed)),
        untestable={u.name: u.reason for u in found.cannot},
        notes=_notes(analysis, gate, after),
        scatter=_scatter(analysis),
        remainder=remainder(bench, after) if found.gap else {},
        p_gap=found.first.p,
        p_left=found.left.p,
        seed=seed,
        curves=_curves(analysis, after),
    )
    return replace(
        report,
        sentence=sentence(report, gate.unnameable, [e.name for e in case.model.effects]),
        not_claimed=tuple(not_claimed(report, gate.unnameable, _held(case, free))),
    )


def _held(case: Case, free: Sequence[FreeParameter]) -> list[str]:
    """Soil and gear parameters that were believed as the model file has them."""
    freed = {f.path for f in free}
    soil = [name for name in (*SHEAR, "kphi", "n") if name not in freed]
    return [*soil, *(f"gear.{name}" for name in declared(type(case.model.gear)))]


def _rivals(causes: Sequence[Candidate], tried: Sequence[Candidate]) -> list[Candidate]:
    """The explanations to tell apart: those left, or the one left and the next best of its size."""
    if len(causes) != 1:
        return list(causes)
    others = [c for c in tried if len(c.names) == len(causes[0].names) and c != causes[0]]
    return [causes[0], *sorted(others, key=lambda c: c.cost)[:1]]


def _gaps(analysis: Analysis, after: GapFit, seed: int) -> dict[str, Shrink]:
    bench, soil = analysis.bench, analysis.found.soil
    std = bench.covariance.std
    gaps = {"train": shrink(bench.cells, std, soil.prediction, after.prediction, "all rows fitted")}
    runs, region = held_out_runs(bench, soil, after, seed), held_out_region(bench, soil, after)
    if runs is not None:
        gaps["held_out_runs"] = runs
    if region is not None:
        gaps["held_out_region"] = region
    return gaps


def _tried(analysis: Analysis, *, claimed: bool) -> list[Tried]:
    found = analysis.found
    if not found.tried:
        return []
    lowest = min(c.cost for c in found.tried)
    kept = {c.names for c in found.causes}
    rows = []
    for c in sorted(found.tried, key=lambda c: c.cost):
        gain = found.predicted_gain.get(c.names[0], 0.0) if len(c.names) == 1 else float("nan")
        if c.names in kept:
            verdict = "explains the data" if claimed else "fits best, not claimed"
        elif not c.strict.converged:
            verdict = "fit failed: no evidence either way"
        elif c.cost <= lowest + REJECTED:
            verdict = "more effects than needed"
        else:
            verdict = "rejected against the best"
        rows.append(Tried(c.names, gain, found.soil.cost - c.cost, c.cost - lowest, verdict))
    return rows


def _notes(analysis: Analysis, gate: Gate, after: GapFit) -> tuple[str, ...]:
    said = list(gate.notes)
    if analysis.strays:
        shown = ", ".join(analysis.strays[:6])
        said.append(
            f"{len(analysis.strays)} readings stray from all others and are set aside: {shown}"
        )
    for axis, x in zip(after.axes, after.x, strict=True):
        if "." not in axis.path and min(x, 1.0 - x) < 1e-3:
            said.append(f"{axis.path} stands at the end of its prior")
        elif "." in axis.path and x > axis.upper - 1e-3 * (axis.upper - axis.lower):
            said.append(f"{axis.path} stands at the end of what it may be")
    scatter = analysis.bench.covariance.scatter
    for name, scale in zip(analysis.bench.cells.channels, scatter.scale, strict=True):
        if scale > 1.25:
            said.append(f"{column(name)} scatters {scale:.2g} times as much as declared")
    if 1 < len(analysis.bench.cells.runs) < FEW_RUNS:
        said.append(
            f"fewer than {FEW_RUNS} runs cannot show how the soil scatters between them: "
            f"{np.degrees(scatter.friction_angle):.2g} deg and {scatter.bearing:.0%} of bearing "
            "are taken for granted, and residuals may stand below 1"
        )
    if scatter.memory > 0.0:
        said.append(
            f"neighbouring samples of a run share their noise (correlation {scatter.memory:.2g}): "
            "they count for fewer"
        )
    return tuple(said)


def _scatter(analysis: Analysis) -> dict[str, float]:
    scatter, channels = analysis.bench.covariance.scatter, analysis.bench.cells.channels
    scales = {
        f"noise_scale_{column(n)}": float(s) for n, s in zip(channels, scatter.scale, strict=True)
    }
    return scales | {
        "friction_angle_from_run_to_run_rad": scatter.friction_angle,
        "bearing_from_run_to_run": scatter.bearing,
        "memory_of_samples": scatter.memory,
    }


def _curves(analysis: Analysis, after: GapFit) -> Curves:
    bench, soil = analysis.bench, analysis.found.soil
    cells = bench.cells
    raw = np.linalg.solve(bench.covariance.whiten, after.slope)
    model_std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", raw, after.covariance, raw), 0.0))
    return Curves(
        channels=tuple(column(n) for n in cells.channels),
        channel=cells.channel,
        run=tuple(cells.runs[cells.run[r]] for r in cells.row),
        slip=cells.slip,
        load=cells.load,
        reading=cells.reading,
        std=bench.covariance.std,
        before=soil.prediction,
        after=predicted(after.case, after.axes, after.x[None, :], cells)[0],
        after_std=model_std,
        held_out=np.zeros(len(cells), dtype=np.bool_),
    )
