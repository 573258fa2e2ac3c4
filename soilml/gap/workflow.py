"""The gap analysis, from a case and a table to a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.remainder import SAME_ROWS
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import fixed_parameters, free_soil_parameters
from soilml.fitting.fitted_readings import FittedReadings
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.usable_readings import prepared_rows, with_zeros_replaced
from soilml.gap.cause_of_remainder import described_cause
from soilml.gap.checks import ONE_LOAD, estimate_repeat_noise, faults_of, naming_obstacles
from soilml.gap.conclusions import (
    like_another_force,
    like_another_soil,
    unsupported_conclusions,
)
from soilml.gap.decision import decide, ranked_sets, reasons, suspects
from soilml.gap.disagreements import (
    disagreements,
    misfit_remarks,
    noise_agreement,
    opened_priors,
    unpredicted_rows,
)
from soilml.gap.estimates import (
    named_effects,
    returned_case,
    soil_after,
    soil_before,
    variance_component_entries,
    whole_answer,
)
from soilml.gap.held_out import (
    HoldoutSplit,
    gap_reductions,
    plain_fits,
    predict_held_out,
    predictive_gains,
    split_holdout,
    unexplained_figures,
    without_grown,
)
from soilml.gap.next_runs import competing_explanations, next_runs
from soilml.gap.notes import analysis_notes, hidden_effect, outlier_names
from soilml.gap.remainder import discrepancy_map, remaining_discrepancy
from soilml.gap.results import GapReport
from soilml.gap.sentences import headline, report_lines
from soilml.inference import constants
from soilml.inference.posterior import Posterior, infer
from soilml.inference.problem import InferenceProblem
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.operating_point import FROM_ORDER
from soilml.processes import threads_for
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.row_status import Status

#: Readings that an analysis may have: its columns are as long, and there are some for each run.
MOST_READINGS = 3600
#: Explanations that are scored on rows kept back, the likeliest first.
SCORED = 4
#: Share of outliers above which they form a pattern, so that the data cannot be analysed, and
#: outliers that the reason states.
MAX_OUTLIER_FRACTION, OUTLIERS_STATED = 0.1, 3


@solvable("the gap analysis")
def gap(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    holdout: str | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    calibration: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> GapReport:
    """Find where a model disagrees with measured rows, and the effect that the model lacks.

    One posterior weighs the soil alone and sets of effects of the catalogue, each beside a smooth
    discrepancy or without one, by their evidence. The report states which the data do not reject.

    Parameters
    ----------
    case : Case or path
        Model, soil, priors, measurement noise, and the bias of sensors.
    table : Table, path, data frame or mapping of columns
        Rows with `run`, `slip`, `load_N` and measured channels.
    free : sequence of str, optional
        Soil parameters to fit; by default those with a prior.
    holdout : str, optional
        `run` (a quarter of the runs) or `COLUMN=VALUE`: rows that take no part in the analysis and
        are predicted afterwards.
    effects : mapping, optional
        The catalogue of effects by name; those that do not suit the gear are ignored.
    calibration : mapping, optional
        Standard deviation of the remaining error of a calibrated sensor, by effect name, in the
        unit of the effect's size; by default as the bias of the case declares it.
    seed : int
        Of all random draws; the same input gives the same report.
    progress : callable, optional
        Called with the share of the work that is done, from 0 to 1, as it grows.

    Returns
    -------
    GapReport
        Its status is `bad-data` where the data cannot be analysed.

    Raises
    ------
    InputError
        For unknown names, an unusable `holdout`, a table without usable rows, or more readings than
        an analysis can hold.
    TableError
        For columns that contradict the case, such as another wheel radius.

    Examples
    --------
    Rows that the model itself predicts contain no gap:

    >>> import numpy as np
    >>> from soilml import Model, Operating, Wheel, soil
    >>> from soilml.config.case import Case
    >>> from soilml.config.measurement_noise import Noise
    >>> from soilml.gap import gap
    >>> from soilml.io.table import Table
    >>> from soilml.numerics.prior import Prior
    >>> model, sand = Model(Wheel(radius=0.15, width=0.12)), soil("wong1989/dry_sand")
    >>> slip, load = np.tile(np.linspace(0.1, 0.6, 6), 3), np.repeat([40.0, 60.0, 90.0], 6)
    >>> force = model(sand, Operating(slip=slip, load=load))
    >>> columns = {"run": np.repeat(["a", "b", "c"], 6), "slip": slip, "load_N": load}
    >>> columns |= {"torque_Nm": force.torque, "drawbar_pull_N": force.drawbar_pull}
    >>> noise = {"torque_Nm": Noise(share=0.01), "drawbar_pull_N": Noise(constant=0.2)}
    >>> case = Case(model, sand, {"friction_angle": Prior(0.3, 0.8)}, noise)
    >>> gap(case, Table(columns)).status
    'no-gap'
    """
    case = as_case(case)
    effects = candidate_effects(case, effects)
    case = case.without_learned_discrepancy().without_explanations()
    table, remarks = prepared_rows(case, as_table(table), FROM_ORDER)
    known, case = case.remainder, case.without_remainder_of(table)
    remarks += [] if case.remainder is known else [SAME_ROWS]
    _check_size(table)
    split = split_holdout(table, holdout, seed)
    soil = free_soil_parameters(case, free)

    readings = stack_readings(case, split.analysed)
    readings = with_zeros_replaced(case, split.analysed, readings, refuse=False)
    repeat_noise, notes = estimate_repeat_noise(readings)
    readings, exclusions = readings.with_default_std(repeat_noise).with_known_noise()
    notes = [*remarks, *notes, *readings.notes, *exclusions]
    if faults := tuple(faults_of(readings, len(soil))):
        return _bad_data_report(case, faults, notes, seed)
    obstacles = tuple(naming_obstacles(readings, len(soil)))

    problem = InferenceProblem.of(case, readings, soil, effects, calibration)
    with threads_for(len(readings)):
        posterior = infer(problem, progress or (lambda _: None))
        if error := _unusable(posterior, split.analysed.place):
            return _bad_data_report(case, (error,), notes, seed)
        held_out = None
        if split.held_out is not None:
            held_out = stack_readings(case, split.held_out).with_default_std(repeat_noise)
            held_out = held_out.subset(np.isfinite(held_out.std))
        report = _build_report(case, posterior, obstacles, notes, split, held_out, readings, seed)
    if report.model.remainder not in (None, case.remainder):
        learned = report.model.remainder.of_rows(split.analysed)
        report = replace(report, model=replace(report.model, remainder=learned))
    lines = report_lines(report, effect_names(case))
    report = replace(report, sentence=headline(report), lines=lines)
    conclusions = unsupported_conclusions(report, obstacles, fixed_parameters(case, soil))
    conclusions += like_another_soil(posterior, posterior.soil.fit)
    first = report.cause_set[0] if report.cause_set else report.best_unclaimed
    conclusions += like_another_force(posterior, first)
    return replace(report, not_claimed=tuple(conclusions))


def _bad_data_report(
    case: Case, errors: Sequence[Remark], notes: Iterable[Remark], seed: int
) -> GapReport:
    """The report on data that cannot be analysed."""
    report = GapReport("bad-data", "", case, reasons=tuple(errors), notes=tuple(notes), seed=seed)
    return replace(report, sentence=headline(report))


def _unusable(posterior: Posterior, place: Callable[[int], str]) -> Remark | None:
    """Why the rows cannot be analysed: loads that nothing carries, or too many outliers."""
    if posterior.refused is not None:
        fit = posterior.refused
        readings = fit.problem.readings
        row = int(readings.row[np.flatnonzero(~np.isfinite(fit.prediction))[0]])
        status = Status(int(forces(fit.fitted(), readings.at).status[row]))
        text = f"the model cannot carry the load of {place(row)}"
        if status not in (Status.TOO_HEAVY, Status.NOT_CONVERGED):
            text = f"{place(row)}: {status.reason}"
        return Remark("no-equilibrium", text)
    if np.mean(posterior.outliers) <= MAX_OUTLIER_FRACTION:
        return None
    names = outlier_names(posterior, place)
    more = len(names) - OUTLIERS_STATED
    text = f"{len(names)} readings are outliers: check the sensors first: "
    text += ", ".join(names[:OUTLIERS_STATED]) + (f" and {more} more" if more > 0 else "")
    return Remark("many-outliers", text, names)


def _build_report(
    case: Case,
    posterior: Posterior,
    naming: tuple[Remark, ...],
    notes: Sequence[Remark],
    split: HoldoutSplit,
    held_out: Readings | None,
    readings: Readings,
    seed: int,
) -> GapReport:
    """Decide the status, then compute the entries of the report.

    naming: Why the rows cannot identify a cause.
    """
    gains = predictive_gains(posterior, ranked_sets(posterior)[:SCORED], seed)
    quiet = posterior.no_gap > constants.LIKELIER
    alone, _ = plain_fits(posterior, None)
    opened = opened_priors(posterior)
    obstacles = (*opened, *naming)
    agreement = noise_agreement(case, readings, posterior, alone)
    kept_back = held_out if held_out is not None and len(held_out) else None
    conflicts = list[Remark]()
    if quiet:
        conflicts = misfit_remarks(agreement, case, posterior, alone)
        conflicts += disagreements(posterior)
        conflicts += unexplained_figures(gap_reductions(posterior, (alone, alone), seed))
        if kept_back is not None:
            conflicts += unpredicted_rows(posterior, kept_back, split.description)
    decision = decide(posterior, gains, obstacles, conflicts)
    if decision.status == "undecided" and not quiet:
        conflicts = list(opened)
    shown = decision.shown
    fits = plain_fits(posterior, shown)
    figures = gap_reductions(posterior, fits, seed)
    if kept_back is not None:
        figures[split.name] = predict_held_out(posterior, fits, kept_back, split.description)
    added = " + ".join(shown.hypothesis.effects) if shown else ""
    figures, not_reduced = without_grown(figures, added)
    smooth_gap = decision.status not in ("no-gap", "undecided")
    whole = whole_answer(posterior, decision)
    written = whole or shown or posterior.soil
    listed = suspects(posterior, decision, gains) if smooth_gap else []
    claimed = bool(decision.claimed) and shown is not None
    report = GapReport(
        status=decision.status,
        sentence="",
        model=returned_case(posterior, whole, seed),
        effects=tuple(named_effects(posterior, decision)) if claimed else (),
        cause_set=decision.listed,
        probabilities={n: posterior.probability(n) for n in posterior.effects()},
        best_unclaimed=listed[0].effects if listed and not decision.claimed else (),
        reasons=reasons(decision, obstacles, conflicts),
        gap=figures,
        soil_before=soil_before(alone),
        soil_after=soil_after(posterior, seed),
        untestable=dict(posterior.untestable),
        notes=(
            *notes,
            *not_reduced,
            *analysis_notes(posterior, alone, written, split.analysed.place),
            *(hidden_effect(posterior, alone) if decision.status == "no-gap" else ()),
        ),
        variance_components=variance_component_entries(posterior),
        misfit=agreement,
        gap_probability=1.0 - posterior.no_gap,
        remainder_probability=1.0 - (shown or posterior.soil).share_without,
        outside_probability=posterior.outside,
        seed=seed,
        curves=FittedReadings.of_solutions(*fits, posterior.std),
    )
    if not smooth_gap:
        return report
    explained = shown if claimed and shown is not None else posterior.soil
    rivals = competing_explanations(posterior, decision, listed)
    return replace(
        report,
        suspects=tuple(listed),
        conditions=tuple(_conditions(posterior, obstacles)),
        where=tuple(discrepancy_map(posterior, alone)),
        discrepancy=remaining_discrepancy(posterior, posterior.soil, shown or posterior.soil),
        remainder_cause=described_cause(posterior, explained, seed),
        next_runs=tuple(next_runs(posterior, rivals)),
    )


def _conditions(posterior: Posterior, obstacles: Sequence[Remark]) -> Iterator[Remark]:
    """The conditions under which the odds of suspects are valid."""
    text = "no other cause than those of the catalogue has a similar signature"
    yield Remark("catalogue-complete", text)
    if len(posterior.terms.readings.runs) == 1:
        yield Remark("one-bed", "the bed was the same for all rows")
    if any(obstacle.code == ONE_LOAD for obstacle in obstacles):
        text = "the soil parameters lie inside their priors, because one load cannot test them"
        yield Remark("inside-priors", text)


def _check_size(table: Table) -> None:
    """Raise `InputError` for more readings than a gap analysis can hold, with what to leave out."""
    columns = [table[column(name)] for name in CHANNELS if column(name) in table]
    count = sum(int(np.isfinite(values).sum()) for values in columns)
    if count > MOST_READINGS:
        every = -(-count // MOST_READINGS)
        raise InputError(
            f"{table.source}: {count} readings in {len(table)} rows; an analysis takes at most "
            f"{MOST_READINGS}: average replicate rows, or keep one row, or one run, of {every}"
        )
