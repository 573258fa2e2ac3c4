"""Correlation lengths and noise of the learned remainder, from what a fit leaves."""

from dataclasses import replace

import numpy as np
from gap_sets import case_of, driven, fit_problem

from soilml.config.measurement_noise import LOG_LOAD_LENGTH, SLIP_LENGTH, Discrepancy
from soilml.gap.evidence.covariance import VarianceComponents, assemble_covariance
from soilml.gap.evidence.problem import MarginalFit, StartedFit, fit_many
from soilml.gap.verdict import remainder_lengths
from soilml.gap.verdict.learned_remainder import learned_remainder
from soilml.gap.verdict.remainder_lengths import with_fitted_lengths
from soilml.io.table import Table
from soilml.numerics.smooth_process import squared_exponential


def changed(shape, amplitude=(1.0, 0.0, 0.0), **declared):
    """A soil fitted to rows whose torque a function of slip and load changes, and the change."""
    case = case_of()
    case = replace(case, discrepancy=declared)
    table = driven(case, slips=16)
    slip, load = table["slip"], table["load_N"]
    added = 0.06 * np.ptp(table["torque_Nm"]) * shape(slip, load)
    problem = fit_problem(
        case, Table(dict(table.columns) | {"torque_Nm": table["torque_Nm"] + added})
    )
    soil = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    evidence = problem.discrepancy.evidence(soil)
    return problem, MarginalFit(soil, replace(evidence, amplitude=np.asarray(amplitude)))


def band(slip, load):
    return np.exp(-(((slip - 0.3) / 0.06) ** 2))


def lengths(problem, name="torque_Nm"):
    own = problem.case.discrepancy[name]
    return own.slip_length, own.log_load_length


def test_a_narrow_band_of_slip_has_a_short_length_in_slip_alone():
    problem, marginal = with_fitted_lengths(*changed(band))
    in_slip, in_load = lengths(problem)
    assert in_slip <= 0.4 * SLIP_LENGTH and in_load >= LOG_LOAD_LENGTH
    assert lengths(problem, "sinkage_m") == (SLIP_LENGTH, LOG_LOAD_LENGTH)
    assert marginal.evidence.amplitude[0] > 0.0


def test_what_changes_fast_is_no_noise_and_its_mean_is_learned():
    """Noise that an analysis estimated three times as large is the declared one beside it."""
    problem, marginal = changed(band)
    readings = problem.readings
    components = replace(VarianceComponents.usual(readings, units=0.0), noise_scale=np.full(3, 3.0))
    loud = assemble_covariance(readings, np.zeros((len(readings), 2)), components)
    found, again = with_fitted_lengths(replace(problem, covariance=loud), marginal)
    assert found.covariance.components.noise_scale.max() < 2.0
    left = [readings.measured - marginal.fit.prediction]
    for own in (found, again), (replace(problem, covariance=loud), marginal):
        mean = np.zeros(len(readings))
        torque = readings.channel == 0
        at = readings.slip[torque], readings.load[torque]
        mean[torque] = learned_remainder(*own).mean_and_std("torque", *at)[0]
        left.append((left[0] - mean)[torque])
    assert np.std(left[1]) < 0.5 * np.std(left[2])


def test_a_smooth_change_and_a_declared_one_keep_their_lengths():
    problem, _ = with_fitted_lengths(*changed(lambda s, w: np.sin(3.0 * s + np.log(w / 80.0))))
    assert lengths(problem) == (SLIP_LENGTH, LOG_LOAD_LENGTH)
    declared = Discrepancy(share=0.02, slip_length=0.2)
    given = changed(band, torque_Nm=declared)
    problem, marginal = with_fitted_lengths(*given)
    assert problem.case.discrepancy["torque_Nm"] == declared
    assert marginal.evidence.amplitude[0] == given[1].evidence.amplitude[0]


def test_a_channel_without_a_remainder_gets_one_where_it_is_decisive():
    _, marginal = with_fitted_lengths(*changed(band, amplitude=(0.0, 0.0, 0.0)))
    assert marginal.evidence.amplitude[0] > 0.0
    quiet = changed(lambda s, w: 0.0 * s, amplitude=(0.0, 0.0, 0.0))
    assert not with_fitted_lengths(*quiet)[1].evidence.amplitude.any()


def test_what_changes_with_the_pass_is_no_remainder_of_slip(monkeypatch):
    """At one load, readings of the second pass differ from those of the first at the same slips."""
    case, runs, slips = case_of(), 4, 16
    table = driven(case, loads=(80.0,) * runs, slips=slips)
    again = np.repeat(np.arange(runs) >= runs // 2, slips) - 0.5
    added = 0.3 * np.ptp(table["torque_Nm"]) * again * np.sin(np.pi * table["slip"])
    columns = dict(table.columns) | {"torque_Nm": table["torque_Nm"] + added}
    problem = fit_problem(case, Table(columns))
    soil = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    evidence = replace(problem.discrepancy.evidence(soil), amplitude=np.zeros(3))
    given = problem, MarginalFit(soil, evidence)
    assert with_fitted_lengths(*given)[1].evidence.amplitude[0] == 0.0
    assert with_fitted_lengths(*given)[1].fit is soil
    beside = replace(evidence, amplitude=np.asarray([3.0, 0.0, 0.0]))
    whiten = problem.discrepancy.whiten(beside.amplitude)
    (away,) = fit_many(problem, [StartedFit(case, problem.soil, soil.start_values(), whiten)])
    own, again = with_fitted_lengths(problem, MarginalFit(away, beside))
    assert again.evidence.amplitude[0] == 0.0  # it predicts nothing, and the soil does without it
    known = own.discrepancy.whiten(again.evidence.amplitude)
    fits = [fit.whitened_by(known) for fit in (again.fit, away)]
    best, earlier = (fit.problem.objective(fit.residual, fit.x) for fit in fits)
    assert best < earlier - 1.0
    monkeypatch.setattr(remainder_lengths, "_predicts", lambda *_: [True] * 3)
    assert with_fitted_lengths(*given)[1].evidence.amplitude[0] > 0.0


def test_a_process_counts_where_each_residual_follows_from_the_others():
    z = np.arange(8.0)[:, None]
    process, noise = squared_exponential(z / 3.0, z / 3.0), 0.01 * np.eye(8)
    smooth = np.sin((1.0 + z[:, 0]) / 3.0)
    gains = remainder_lengths._gains(smooth, noise, process)
    assert (gains > 0.0).all()
    for i in range(8):
        others = np.arange(8) != i
        known = (noise + process)[np.ix_(others, others)]
        mean = process[i, others] @ np.linalg.solve(known, smooth[others])
        np.testing.assert_allclose(gains[:, i], smooth[i] ** 2 - (smooth[i] - mean) ** 2)
    alternating = np.where(z[:, 0] % 2.0, 1.0, -1.0)
    assert (remainder_lengths._gains(alternating, noise, process).sum(axis=1) < 0.0).all()
    assert not remainder_lengths._gains(alternating, noise, 0.0 * process).any()


def test_a_process_counts_by_what_it_predicts_without_the_scatter_between_runs():
    """Four runs of two channels: scatter moves both, but only the first is off, in all runs."""
    run, of_first = np.repeat(np.arange(4), 8), np.tile([True] * 4 + [False] * 4, 4)
    scatter = 9.0 * (run[:, None] == run)
    process = 9.0 * (~of_first[:, None] & ~of_first)
    noise = scatter + 0.01 * np.eye(len(run))
    beside, alone = remainder_lengths._gains(np.where(of_first, 3.0, 0.0), noise, process)
    assert beside[~of_first].sum() > 0.0  # the process cancels the scatter
    assert alone[~of_first].sum() < -10.0  # and is wrong without it


def few(off):
    """Four rows at one load, whose torque is so many standard deviations off a fit."""
    table = driven(case_of(), loads=(80.0,), slips=4)
    problem = fit_problem(case_of(), table)
    soil = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    readings = problem.readings
    measured = soil.prediction.copy()
    measured[readings.channel == 0] += np.asarray(off) * readings.std[readings.channel == 0]
    problem = replace(problem, readings=replace(readings, measured=measured))
    evidence = replace(problem.discrepancy.evidence(soil), amplitude=np.zeros(3))
    return problem, MarginalFit(soil, evidence)


def test_few_rows_that_are_all_off_to_one_side_have_a_remainder_that_is_the_same_at_all_slips():
    """An end of four readings does not follow from the others by a process of the usual length."""
    off = np.asarray([5.5, 12.9, 13.2, 27.2])
    problem, marginal = with_fitted_lengths(*few(off))
    assert lengths(problem)[0] == remainder_lengths.STEADY_FACTOR * SLIP_LENGTH
    readings, std = problem.readings, problem.readings.std[problem.readings.channel == 0]
    slip = readings.slip[readings.channel == 0]
    mean, _ = learned_remainder(problem, marginal).mean_and_std("torque", slip, 80.0)
    assert np.abs(off - mean / std).max() < 0.6 * off.max()
    assert (np.abs(off - mean / std) < np.abs(off)).sum() >= 3
    assert not with_fitted_lengths(*few([8.0, -9.0, 7.0, -8.0]))[1].evidence.amplitude.any()
