"""The gap analysis, from a case and a table to a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.config.remainder import SAME_ROWS
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import fixed_parameters, free_soil_parameters
from soilml.fitting.fitted_readings import FittedReadings
from soilml.fitting.least_squares import Solution
from soilml.fitting.misfit import declared_misfit
from soilml.fitting.predictions import forces
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.usable_readings import prepared_rows
from soilml.gap.cause_of_remainder import described_cause
from soilml.gap.checks import estimate_repeat_noise, faults_of, naming_obstacles
from soilml.gap.decision import Decision, decide, opened_priors, suspects
from soilml.gap.disagreements import disagreements
from soilml.gap.estimates import (
    named_effects,
    returned_case,
    soil_before,
    variance_component_entries,
    whole_answer,
)
from soilml.gap.held_out import (
    HoldoutSplit,
    gap_reductions,
    plain_fits,
    plain_soil,
    predict_held_out,
    split_holdout,
    without_grown,
)
from soilml.gap.next_runs import competing_explanations, next_runs
from soilml.gap.notes import analysis_notes, indistinct, outlier_names
from soilml.gap.remainder import discrepancy_map, remaining_discrepancy
from soilml.gap.results import GapReduction, GapReport
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
    repeat_noise, notes = estimate_repeat_noise(readings)
    readings = readings.with_default_std(repeat_noise).with_known_noise()
    notes = [*remarks, *notes, *readings.notes]
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
    unsupported = indistinct(report, posterior, fixed_parameters(case, soil))
    sentence = headline(report)
    return replace(report, sentence=sentence, lines=lines, not_claimed=tuple(unsupported))


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

    def figures_of(fits: tuple[Solution, Solution]) -> dict[str, GapReduction]:
        found = gap_reductions(posterior, fits, seed)
        if held_out is not None and len(held_out):
            found[split.name] = predict_held_out(posterior, fits, held_out, split.description)
        return found

    quiet = posterior.no_gap > constants.LIKELIER
    alone, kept = plain_soil(posterior), ~posterior.outliers
    fits = alone, alone
    misfit = declared_misfit(case, readings.subset(kept), posterior.problem.soil, alone.x)
    if quiet:
        figures = figures_of(fits)
        found = disagreements(posterior, case, misfit, alone, figures)
        decision = Decision("undecided" if found else "no-gap", reasons=tuple(found))
    else:
        decision = decide(posterior, (*opened_priors(posterior), *naming))
        fits = plain_fits(posterior, alone, decision.shown)
        figures = figures_of(fits)
    shown = decision.shown
    added = " + ".join(shown.hypothesis.effects) if shown else ""
    figures, not_reduced = without_grown(figures, added)
    whole = whole_answer(posterior, decision)
    claimed = bool(decision.claimed)
    after = posterior.soil_marginals(seed, constants.INTERVAL_FACTOR)
    report = GapReport(
        status=decision.status,
        sentence="",
        model=returned_case(posterior, whole, seed),
        effects=tuple(named_effects(posterior, decision)) if claimed else (),
        cause_set=decision.listed,
        probabilities={n: posterior.probability(n) for n in posterior.effects()},
        reasons=decision.reasons,
        gap=figures,
        soil_before=soil_before(alone),
        soil_after={path.rpartition(".")[2]: own for path, own in after.items()},
        untestable=dict(posterior.search.untestable),
        notes=(
            *notes,
            *not_reduced,
            *analysis_notes(
                posterior, alone, whole or shown or posterior.soil, split.analysed.place
            ),
        ),
        variance_components=variance_component_entries(posterior),
        misfit=None if misfit is None else misfit.per_freedom,
        gap_probability=1.0 - posterior.no_gap,
        remainder_probability=1.0 - (shown or posterior.soil).share_without,
        outside_probability=posterior.outside,
        seed=seed,
        curves=FittedReadings.of_solutions(*fits, posterior.std),
    )
    if decision.status == "no-gap":
        return report
    listed = suspects(posterior, decision)
    explained = shown if claimed and shown is not None else posterior.soil
    rivals = competing_explanations(posterior, decision, listed)
    return replace(
        report,
        suspects=tuple(listed),
        where=tuple(discrepancy_map(posterior, alone)),
        discrepancy=remaining_discrepancy(posterior, posterior.soil, shown or posterior.soil),
        remainder_cause=described_cause(posterior, explained, seed),
        next_runs=tuple(next_runs(posterior, rivals)),
    )


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
