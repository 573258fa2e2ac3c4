"""Agreement: one misfit for all commands, and trends with the order of runs and rows."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem

from soilml import identify
from soilml.gap import gap
from soilml.gap.evidence.order_trend import FEWEST_RUNS, TREND_LEVEL, order_trends
from soilml.gap.report.results import NoiseAgreement
from soilml.gap.search.passes import Analysis
from soilml.gap.verdict.agreement import misfit_remarks, trend_remarks
from soilml.numerics.prior import Prior
from soilml.traction.soil_draws import measured_soil

CASE = case_of()
LOADS = (60.0, 40.0, 90.0, 90.0, 40.0, 60.0, 40.0, 90.0)


def changing(angles, loads=LOADS, seed=1):
    """Runs on soils whose friction angle differs by so many degrees."""
    angle = CASE.soil.friction_angle + np.deg2rad(angles)
    return driven(CASE, loads=loads, soils={"friction_angle": angle}, seed=seed)


def trends(table):
    problem = fit_problem(CASE, table, (1.0, 1.0))
    soil = problem.fit_soil([np.full(len(problem.soil), 0.4)])
    return {(t.order, t.parameter): t for t in order_trends(problem, soil, 0)}


def test_a_soil_that_changes_evenly_drifts_from_run_to_run():
    found = trends(changing(np.linspace(0.0, 3.0, 8)))
    angle = found["runs", "friction angle"]
    assert angle.p < TREND_LEVEL and angle.z > 0.0
    assert np.degrees(angle.change) == pytest.approx(3.0, abs=1.0)
    (remark,) = trend_remarks(list(found.values()))
    assert remark.code == "drift-of-runs" and "may have changed" in remark.text
    falling = trends(changing(np.linspace(3.0, 0.0, 8)))["runs", "friction angle"]
    assert falling.z < 0.0 and falling.p < TREND_LEVEL


def test_the_same_soils_in_another_order_do_not_drift():
    mixed = np.linspace(0.0, 3.0, 8)[[3, 6, 1, 4, 7, 0, 5, 2]]
    assert trend_remarks(list(trends(changing(mixed)).values())) == []


def test_an_order_of_few_runs_or_of_rising_loads_tells_nothing():
    few = LOADS[: FEWEST_RUNS - 1]
    assert trends(changing(np.linspace(0.0, 3.0, len(few)), few)) == {}
    assert {order for order, _ in trends(changing(np.linspace(0.0, 3.0, 8)))} == {"runs"}
    rising = tuple(np.linspace(40.0, 90.0, 8))
    assert trends(changing(np.linspace(0.0, 3.0, 8), rising)) == {}


def test_rows_driven_in_mixed_order_show_a_drift_along_a_run():
    table = driven(CASE, loads=LOADS[:4], slips=16)
    rng = np.random.default_rng(3)
    order = np.concatenate([16 * i + rng.permutation(16) for i in range(4)])
    place = np.tile(np.arange(16), 4)
    columns = {name: values[order] for name, values in table.columns.items()}
    for name in ("torque_Nm", "drawbar_pull_N"):
        angle = {"friction_angle": CASE.soil.friction_angle + np.deg2rad(2.0)}
        there = driven(CASE.with_values(angle), loads=LOADS[:4], slips=16, noise=0.0)[name]
        here = driven(CASE, loads=LOADS[:4], slips=16, noise=0.0)[name]
        columns[name] = columns[name] + (there - here)[order] * place / 15.0
    found = trends(replace(table, columns=columns))
    assert min(t.p for (order, _), t in found.items() if order == "rows") < TREND_LEVEL


@pytest.mark.slow
def test_gap_identify_and_pull_state_the_same_residuals():
    table = changing([0.9, -0.6, 0.3, -0.9, 0.6, -0.3, 0.7, -0.7])
    report = gap(CASE, table)
    assert report.misfit.exceeds_noise and report.status == "no-gap"
    assert "granting the soil a scatter of" in report.sentence
    factor = f"residuals are {np.sqrt(report.misfit.declared):.1f} times the declared noise"
    assert factor in report.lines[0].text.lower()
    for method in ("nonlinear", "posterior"):
        fit = identify(CASE, table, method=method)
        assert fit.misfit == pytest.approx(report.misfit.declared, rel=1e-3)
        (said,) = [w.text for w in fit.warnings if w.code == "excess-residuals"]
        assert factor in said
    warnings = measured_soil(CASE, table, exact_model=True).warnings
    (said,) = [w.text for w in warnings if w.code == "excess-residuals"]
    assert factor in said


@pytest.mark.parametrize("name", ["friction_angle", "shear_modulus"])
def test_a_prior_without_the_true_soil_is_no_agreement(name):
    """What another friction angle explains, no effect does: the priors are doubted."""
    true = getattr(CASE.soil, name)
    prior = replace(CASE, prior={**CASE.prior, name: Prior(1.25 * true, 1.4 * true)})
    report = gap(prior, driven(CASE, seed=4))
    assert report.status == "undecided" and report.reasons[0].code == "soil-at-prior"
    assert name in report.reasons[0].about
    assert report.sentence.endswith("widen them, or model or noise is wrong.")
    assert "or the noise is understated" in report.reasons[0].text


@pytest.mark.parametrize("scale, code", [(1.0, "soil-at-prior"), (1.6, "excess-residuals")])
def test_noise_that_accounts_for_the_residuals_is_doubted_before_the_priors(
    monkeypatch, scale, code
):
    problem = fit_problem(CASE, driven(CASE))
    components = replace(problem.covariance.components, noise_scale=np.full(3, scale))
    problem = replace(problem, covariance=replace(problem.covariance, components=components))
    analysis = Analysis(problem, SimpleNamespace(soil=None))
    pressed = {"n": "n at 1.4, the upper end of its prior"}
    monkeypatch.setattr("soilml.gap.verdict.agreement.pressed_priors", lambda _: pressed)
    found = NoiseAgreement(2.9, True, 2.9 / scale**2, 0.0, 0.0)
    (remark,) = misfit_remarks(found, CASE, analysis)
    assert remark.code == code


@pytest.mark.slow
def test_a_drift_leaves_no_agreement_but_a_doubt(monkeypatch):
    monkeypatch.setattr("soilml.gap.search.stepwise.GAP_LEVEL", 0.0)  # no smooth gap is seen
    report = gap(CASE, changing(np.linspace(0.0, 3.0, 8)))
    assert report.status == "undecided"
    assert report.reasons[0].code == "drift-of-runs"
    assert "the residuals drift from run to run: the soil may have changed" in report.sentence
    found = report.as_json()
    assert {t["order"] for t in found["trends"]} >= {"runs"}
    assert found["misfit"]["exceeds_noise"]


def test_scatter_that_was_not_granted_is_not_named():
    none = NoiseAgreement(1.0, False, 1.0, 0.0, 0.0)
    assert not none.grants_scatter and replace(none, bearing_std=0.1).grants_scatter


@pytest.mark.slow
def test_a_soil_that_dries_in_cohesion_and_stiffness_has_both_drifts():
    progress = np.linspace(0.0, 1.0, 9)
    soils = {
        "cohesion": CASE.soil.cohesion * (1.0 - 0.7 * progress),
        "kphi": CASE.soil.kphi * np.exp(-0.4 * progress),
    }
    loads = (60.0, 40.0, 90.0, 40.0, 90.0, 60.0, 40.0, 90.0, 60.0)
    report = gap(CASE, driven(CASE, loads=loads, soils=soils))
    assert report.cause_set == (("bearing-drift", "cohesion-drift"),)
    assert report.status in ("named", "partly-named")


@pytest.mark.slow
def test_scatter_is_not_credited_with_what_an_exclusion_did():
    table = driven(CASE, seed=4)
    torque = table["torque_Nm"] * np.where(np.arange(len(table)) == 13, 10.0, 1.0)
    report = gap(CASE, replace(table, columns=dict(table.columns) | {"torque_Nm": torque}))
    assert not report.misfit.exceeds_noise
    assert report.misfit.declared < 1.5 * report.misfit.granted
    assert report.lines[0].text.startswith("1 reading is an outlier and was excluded. Without it,")
