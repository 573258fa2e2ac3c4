"""The gap analysis, from a case and a table to a report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.config.given_case import GivenCase, as_case
from soilml.config.measurement_noise import checked_sensors
from soilml.config.remainder import SAME_ROWS
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects, effect_names
from soilml.fitting.coordinates import fixed_parameters, free_soil_parameters
from soilml.fitting.faulty_readings import sound_rows
from soilml.fitting.operating_points import with_rover_columns
from soilml.fitting.readings import Readings, stack_readings
from soilml.fitting.row_order import with_order_columns
from soilml.fitting.usable_readings import answered_rows, with_zeros_replaced
from soilml.gap.checks import DataCheckResult, check_readings, estimate_repeat_noise
from soilml.gap.design.discriminating_runs import next_runs
from soilml.gap.design.run_kinds import check_costs, rank_by_cost
from soilml.gap.evidence.holdout_split import HoldoutSplit, split_holdout
from soilml.gap.evidence.order_trend import order_trends
from soilml.gap.report.results import GapReport, NoiseAgreement
from soilml.gap.report.sentences import headline, report_lines, unsupported_conclusions
from soilml.gap.search.analysis import analyse
from soilml.gap.search.passes import Analysis
from soilml.gap.search.prediction import predictive_gains
from soilml.gap.verdict.agreement import (
    hidden_effect,
    misfit_remarks,
    noise_agreement,
    trend_remarks,
)
from soilml.gap.verdict.cause_of_remainder import described_cause
from soilml.gap.verdict.decision import (
    NOTHING_IS_BETTER,
    Decision,
    cause_set,
    decide,
    is_left_open,
    predictive_suspect,
    reasons,
    unclaimed_effects,
    with_refused_outside,
)
from soilml.gap.verdict.disagreements import disagreements, repeats_that_disagree
from soilml.gap.verdict.entries import (
    analysis_notes,
    candidate_summaries,
    competing_explanations,
    conditions_of_suspects,
    named_effects,
    prediction_notes,
    readings_and_predictions,
    signature_similarity,
    soil_beside_discrepancy,
    soil_marginal,
    suspects,
    variance_component_entries,
)
from soilml.gap.verdict.estimates import (
    among_candidates,
    by_undetected_effects,
    soil_estimates,
    updated_case,
)
from soilml.gap.verdict.learned_remainder import learned_remainder, without_learned_discrepancy
from soilml.gap.verdict.lookalikes import like_another_force, like_another_soil
from soilml.gap.verdict.noise_range import noise_range
from soilml.gap.verdict.reductions import (
    gap_reductions,
    grown_channels,
    plain_fit,
    predict_held_out,
    without_grown,
)
from soilml.gap.verdict.remainder import (
    discrepancy_amplitudes,
    discrepancy_map,
    remaining_discrepancy,
    residual_trend,
    with_uncertain_discrepancy,
)
from soilml.gap.verdict.returned_model import returned_model
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.operating_point import FROM_ORDER
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark

#: Readings that an analysis may have. Its matrices are of this size squared, and many are held at
#: a time: 1.1 GB in all.
MOST_READINGS = 3600
#: Readings up to which their matrices are so small that several threads only wait for each other.
ONE_THREAD = 1000


@solvable("the gap analysis")
def gap(
    case: GivenCase,
    table: Rows,
    *,
    free: Sequence[str] | None = None,
    holdout: str | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    calibration: Mapping[str, float] | None = None,
    costs: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> GapReport:
    """Find where a model disagrees with measured rows, and the effect that the model lacks.

    The soil alone is fitted by generalised least squares. Where a family-wise score test rejects
    that fit, the effects of the catalogue are fitted jointly with the soil, and the report states
    which of them the data do not reject.

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
    costs : mapping, optional
        Cost of each kind of next run or check, in any unit, 1 where none is given; they are then
        ranked by what they discriminate per cost.
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
    case = without_learned_discrepancy(case).without_suspected()
    known_costs = check_costs(costs or {})
    table, copies = sound_rows(case, as_table(table))
    known, case = case.remainder, case.without_remainder_of(table)
    copies += () if case.remainder is known else (SAME_ROWS,)
    table = with_rover_columns(case, with_order_columns(case, table, FROM_ORDER))
    check_wheel_size(case, table)
    _check_size(table)
    table, excluded_rows = answered_rows(table)
    split = split_holdout(table, holdout, seed)
    soil = free_soil_parameters(case, free)

    readings = stack_readings(case, split.analysed)
    readings = with_zeros_replaced(case, split.analysed, readings, refuse=False)
    repeat_noise, notes = estimate_repeat_noise(readings)
    readings, exclusions = readings.with_default_std(repeat_noise).with_known_noise()
    notes += [*readings.notes, *exclusions]
    checks = check_readings(readings, split.analysed, len(soil))
    checks = replace(checks, notes=(*copies, *notes, *excluded_rows, *checks.notes))
    if checks.errors:
        remarks = (*checks.notes, *checks.naming_obstacles)
        return _bad_data_report(case, checks.errors, remarks, seed)

    from threadpoolctl import threadpool_limits

    with threadpool_limits(1 if len(readings) <= ONE_THREAD else None):
        analysis = analyse(
            case,
            soil,
            readings,
            effects=effects,
            calibration=checked_sensors(case.bias) | dict(calibration or {}),
            seed=seed,
            place=split.analysed.place,
            progress=progress or (lambda _: None),
        )
        if analysis.error:
            return _bad_data_report(case, (analysis.error,), checks.notes, seed)
        held_out = None
        if split.held_out is not None:
            held_out = stack_readings(case, split.held_out).with_default_std(repeat_noise)
            held_out = held_out.subset(np.isfinite(held_out.std))
        gains = predictive_gains(analysis.predictions)
        analysis = replace(
            analysis, result=with_refused_outside(analysis.problem, analysis.result, gains)
        )
        agreement = noise_agreement(case, readings, soil, analysis)
        report = _build_report(case, analysis, checks, split, held_out, agreement, seed=seed)
        if report.model.remainder not in (None, case.remainder):
            learned = report.model.remainder.of_rows(split.analysed)
            report = replace(report, model=replace(report.model, remainder=learned))
        report = replace(report, next_runs=tuple(rank_by_cost(report.next_runs, known_costs)))
    lines = report_lines(report, effect_names(case))
    report = replace(report, sentence=headline(report), lines=lines)
    fixed = fixed_parameters(case, soil)
    conclusions = unsupported_conclusions(report, checks.naming_obstacles, fixed)
    conclusions += like_another_soil(analysis.problem, analysis.result)
    first = report.cause_set[0] if report.cause_set else report.best_unclaimed
    conclusions += like_another_force(analysis.problem, analysis.result, first)
    return replace(report, not_claimed=tuple(conclusions))


def _bad_data_report(
    case: Case, errors: Sequence[Remark], notes: tuple[Remark, ...], seed: int
) -> GapReport:
    """The report on data that cannot be analysed."""
    report = GapReport("bad-data", "", case, reasons=tuple(errors), notes=notes, seed=seed)
    return replace(report, sentence=headline(report), lines=report_lines(report))


def _build_report(
    case: Case,
    analysis: Analysis,
    checks: DataCheckResult,
    split: HoldoutSplit,
    held_out: Readings | None,
    agreement: NoiseAgreement | None,
    *,
    seed: int,
) -> GapReport:
    """Decide the status, then compute the entries of the report."""
    problem, result = analysis.problem, analysis.result
    opened = () if analysis.opened is None else (analysis.opened,)
    obstacles = (*opened, *checks.naming_obstacles)
    smooth_gap = result.has_gap and not is_left_open(result)
    trends = order_trends(problem, result.soil, seed)
    drift, conflicts = trend_remarks(trends), []
    if not smooth_gap:
        conflicts = [*drift, *misfit_remarks(agreement, case, analysis)]
        conflicts += disagreements(problem, result.soil)
    if result.has_gap and not (smooth_gap or conflicts):
        conflicts = [NOTHING_IS_BETTER]
    decision = decide(problem, result, obstacles, conflicts)
    excluded = _changed_by_outliers(analysis, decision, obstacles)
    before, beside = soil_marginal(analysis), soil_beside_discrepancy(analysis)
    shown = decision.shown.best if decision.shown else before
    suspected = predictive_suspect(decision, predictive_gains(analysis.predictions))
    explained = shown if decision.claimed else beside
    plain = plain_fit(problem, result.soil, decision.shown) if decision.shown else result.soil
    figures, beside_remainder = gap_reductions(analysis, decision.shown, plain, seed)
    if held_out is not None and len(held_out):
        figures[split.name] = predict_held_out(
            problem, result.soil, plain, held_out, split.description
        )
    addition = " + ".join(decision.shown.names) if decision.shown else ""
    figures, not_reduced = without_grown(figures, addition)
    beside_remainder, _ = without_grown(beside_remainder, addition)
    replicates = repeats_that_disagree(problem, shown.fit) if smooth_gap else []
    if smooth_gap:
        options = (shown, beside) if suspected else (explained,)
        taken = bool(decision.claimed and not suspected)
        own, written = returned_model(problem, result.soil, options, taken)
        suspected = suspected if set(suspected) <= {*written.fit.effects} else ()
        learned = learned_remainder(own, written)
        left = discrepancy_amplitudes(problem, written)
        intervals = with_uncertain_discrepancy(problem, written)
        spread = among_candidates(intervals, result.candidates, result.posterior)
    else:
        left, learned, written = None, None, explained
        intervals = with_uncertain_discrepancy(problem, written)
        spread = by_undetected_effects(problem, result.soil, result.soil_test.signatures)
    marked = tuple(n for n in suspected if n not in effect_names(case))  # what the case had stays
    listed = suspects(analysis, decision.claimed) if smooth_gap else []
    sizes = result.posterior.oversized & {s.effects for s in listed}
    doubted = [c.fit for c in result.candidates if c.names in sizes]
    report = GapReport(
        status=decision.status,
        sentence="",
        model=replace(updated_case(intervals, left, learned), suspected=marked),
        cause_set=cause_set(decision, result),
        probabilities={n: result.posterior.probability(n) for n in result.posterior.effects()},
        best_unclaimed=unclaimed_effects(decision, result),
        reasons=reasons(decision, obstacles, conflicts or replicates),
        gap=figures,
        gap_beside_remainder=beside_remainder,
        soil_before=soil_estimates(result.soil),
        soil_after=soil_estimates(intervals, spread),
        candidates=tuple(candidate_summaries(analysis, claimed=bool(decision.claimed))),
        untestable=dict(result.untestable),
        notes=(
            *excluded,
            *checks.notes,
            *prediction_notes(() if decision.claimed else suspected, analysis, not_reduced),
            *analysis_notes(analysis, written.fit, [shown.fit, *doubted], replicates),
            *grown_channels(figures, addition),
            *(drift if smooth_gap else ()),
            *(hidden_effect(problem, result) if decision.status == "no-gap" else ()),
        ),
        variance_components=variance_component_entries(analysis),
        misfit=agreement,
        trends=tuple(trends),
        p_gap=result.soil_test.p_value,
        p_residual=result.final_test.p_value,
        seed=seed,
        curves=readings_and_predictions(analysis, plain),
    )
    if decision.claimed:
        claimed = decision.claimed
        if not set(claimed[0].names) <= {*intervals.effects}:  # of a class, and not returned
            intervals = with_uncertain_discrepancy(problem, shown)
        similarity = signature_similarity(problem, claimed[0].fit, claimed[0].amplitude)
        report = replace(
            report,
            effects=tuple(named_effects(claimed, intervals, similarity, result.posterior)),
            mimic_radius=similarity.largest_cosine(claimed[0].names),
        )
    if not smooth_gap:
        return report
    left_by = shown if decision.shown else beside
    conditions = conditions_of_suspects(analysis, obstacles)
    if decision.status == "suspected" and decision.shown:
        conditions = (*conditions, noise_range(analysis, decision.shown))
    return replace(
        report,
        suspects=tuple(listed),
        conditions=conditions,
        where=tuple(discrepancy_map(problem, result.soil, seed)),
        residual_trend=residual_trend(problem, left_by.fit),
        discrepancy=remaining_discrepancy(problem, beside, left_by),
        remainder_cause=described_cause(problem, explained, seed),
        next_runs=tuple(next_runs(problem, competing_explanations(analysis, decision.claimed))),
    )


def _changed_by_outliers(
    analysis: Analysis, decision: Decision, obstacles: Sequence[Remark]
) -> list[Remark]:
    """A remark where another verdict follows from all readings than without the outliers."""
    if analysis.of_all is None:
        return []
    whole = analysis.of_all
    result = with_refused_outside(whole.problem, whole.result, {})
    smooth = result.has_gap and not is_left_open(result)
    conflicts = [] if smooth else disagreements(whole.problem, result.soil)
    other = decide(whole.problem, result, obstacles, conflicts)
    named = [" + ".join(d.shown.names) if d.shown else "no effect" for d in (decision, other)]
    if (other.status == "no-gap") == (decision.status == "no-gap") and named[0] == named[1]:
        return []
    text = (
        f"the verdict depends on what was excluded: {decision.status} with {named[0]} without it, "
        f"{other.status} with {named[1]} with it"
    )
    return [Remark("outliers-matter", text, analysis.outliers)]


def _check_size(table: Table) -> None:
    """Raise `InputError` for more readings than a gap analysis can hold, with what to leave out."""
    columns = [table[column(name)] for name in CHANNELS if column(name) in table]
    count = sum(int(np.isfinite(values).sum()) for values in columns)
    if count > MOST_READINGS:
        every = -(-count // MOST_READINGS)
        raise InputError(
            f"{table.source}: {count} readings in {len(table)} rows; an analysis takes at most "
            f"{MOST_READINGS}, because its matrices grow with the square of their number: average "
            f"replicate rows, or keep one row, or one run, of {every}"
        )
