"""Analytic identification: truth recovered, uncertainty calibrated, limits said."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MODEL
from measured_rows import torque_rows

from soilml import LinearWheel, Operating, identify, read_case
from soilml.config.measurement_noise import Noise
from soilml.errors import FitError, InputError, TableError
from soilml.remarks import texts

TRUTH = {"cohesion": 812.0, "friction_angle": 0.6, "shear_modulus": 0.012}
SLIPS = np.tile(np.linspace(0.1, 0.6, 6), 3)
LOADS = np.repeat([40.0, 70.0, 110.0], 6)


def test_recovers_the_truth_from_rows_without_noise(case):
    fit = identify(case, torque_rows(case, TRUTH, SLIPS, LOADS), method="nonlinear")
    for name, value in TRUTH.items():
        assert fit[name] == pytest.approx(value, rel=1e-6)
    assert fit.warnings == ()
    assert fit.rows_used == 18


@pytest.mark.parametrize("method", ["averaged", "posterior", "nonlinear"])
def test_one_reading_does_not_determine_three_parameters(case, method):
    fit = identify(case, torque_rows(case, TRUTH, SLIPS[:1], LOADS[:1]), method=method)
    assert fit.verdict.endswith("1 reading for 3 parameters: the prior determines the rest.")
    assert fit.undetermined == list(fit.names) and fit.report().status == "not identified"


@pytest.mark.slow
def test_nine_of_ten_truths_lie_in_the_interval_and_the_std_says_how_far(case):
    rng = np.random.default_rng(1)
    inside, error, claimed = [], [], []
    for k in range(40):
        truth = {n: float(p.at(rng.random())) for n, p in case.prior.items()}
        fit = identify(
            case, torque_rows(case, truth, SLIPS, LOADS, noise=0.02, seed=k), method="nonlinear"
        )
        off = np.abs(fit.values - list(truth.values()))
        inside.append(off <= 1.645 * fit.std)
        error.append(off**2)
        claimed.append(fit.std**2)
    assert (np.mean(inside, axis=0) > 0.80).all()  # 0.90 expected, 80 draws: 0.80 is 3 sigma
    assert (np.mean(inside, axis=0) < 0.99).all()
    ratio = np.mean(error, axis=0) / np.mean(claimed, axis=0)
    assert (ratio > 0.55).all() and (ratio < 1.7).all()


@pytest.mark.slow
def test_one_load_does_not_identify_cohesion_and_says_so(case):
    rng = np.random.default_rng(2)
    slip, load = np.linspace(0.1, 0.6, 6), np.full(6, 60.0)
    inside = []
    for k in range(40):
        truth = {n: float(p.at(rng.random())) for n, p in case.prior.items()}
        fit = identify(
            case, torque_rows(case, truth, slip, load, noise=0.02, seed=k), method="nonlinear"
        )
        assert "one load only: cohesion is not identified" in texts(fit.warnings)
        assert fit.remaining_fraction["cohesion"] > 0.5
        inside.append(np.abs(fit.values - list(truth.values())) <= 1.645 * fit.std)
    assert (np.mean(inside, axis=0) > 0.78).all()


@pytest.mark.slow
def test_the_std_holds_where_the_prior_holds_another_parameter(case):
    """The equally good values lie along a valley that bends away from the end of the prior."""
    rng = np.random.default_rng(11)
    slip, load = np.full(3, 0.3), np.asarray([40.0, 70.0, 110.0])
    far = []
    for k in range(40):
        truth = {n: float(p.at(rng.random())) for n, p in case.prior.items()}
        fit = identify(
            case, torque_rows(case, truth, slip, load, noise=0.02, seed=k), method="nonlinear"
        )
        far.append(np.abs(fit.values - list(truth.values())) / fit.std)
    assert np.max(far) < 3.0
    assert (np.mean(np.less(far, 2.0), axis=0) > 0.93).all()


@pytest.mark.slow
def test_a_share_of_noise_does_not_draw_the_fit_low(case):
    rng = np.random.default_rng(3)
    slip, load = rng.uniform(0.1, 0.6, 1000), rng.uniform(40.0, 110.0, 1000)
    noisy = replace(case, noise={"torque_Nm": Noise(share=0.1)}).with_values(TRUTH)
    bias = []
    for seed in range(3):
        fit = identify(
            noisy,
            torque_rows(case, TRUTH, slip, load, noise=0.1, seed=seed),
            ["friction_angle"],
            method="nonlinear",
        )
        found, true = noisy.with_values({"friction_angle": fit["friction_angle"]}), noisy
        at = Operating(slip=slip, load=load)
        bias.append((found.model(found.soil, at).torque / true.model(true.soil, at).torque).mean())
    assert abs(np.mean(bias) - 1.0) < 0.006  # 0.1 / sqrt(3000) is 0.002; of readings: -0.02


def test_free_parameters_can_be_chosen_and_unknown_ones_are_refused(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS)
    fit = identify(
        case.with_values({"cohesion": 812.0}), table, ["friction_angle", "kphi"], method="nonlinear"
    )
    assert fit.names == ("friction_angle", "kphi")
    with pytest.raises(InputError, match="cohesion, friction_angle"):
        identify(case, table, ["phi"], method="nonlinear")
    with pytest.raises(InputError, match="nonlinear, linear, newton"):
        identify(case, table, method="magic")
    with pytest.raises(InputError, match="nothing to identify"):
        identify(replace(case, prior={}), table, method="nonlinear")


def test_effect_parameters_can_be_identified(case, tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(MODEL + '[[effect]]\nname = "slip-sinkage"\n[effect.prior]\nn1 = [0, 1]\n')
    case = replace(
        read_case(path), noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(1e-4)}
    )
    table = torque_rows(case, TRUTH | {"slip-sinkage.n1": 0.4}, SLIPS, LOADS, more=["sinkage_m"])
    assert identify(case, table, method="nonlinear")["slip-sinkage.n1"] == pytest.approx(
        0.4, rel=1e-5
    )


def test_undeclared_noise_is_estimated_from_residuals(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS, noise=0.02)
    fit = identify(replace(case, noise={}), table, method="nonlinear")
    known = identify(case, table, method="nonlinear")
    assert any("not declared" in said for said in texts(fit.warnings))
    assert np.all(fit.std / known.std < 2.5) and np.all(fit.std / known.std > 0.4)
    with pytest.raises(FitError, match="declare it"):
        identify(replace(case, noise={}), table.rows(np.arange(3)), method="nonlinear")


def test_a_channel_whose_noise_is_not_declared_is_left_out_and_named(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS, more=["sinkage_m"])
    fit = identify(case, table, method="nonlinear")
    assert fit.channels == ("torque_Nm",)
    assert any("sinkage_m is not used" in said for said in texts(fit.warnings))


def test_more_misfit_than_noise_is_said_with_the_ends_of_priors_that_it_reaches(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS)
    table.columns["torque_Nm"] = table["torque_Nm"] * (1.0 + 0.3 * np.sin(7 * SLIPS))
    fit = identify(case, table, method="nonlinear")
    codes = {remark.code for remark in fit.warnings}
    assert any("times the declared noise" in said for said in texts(fit.warnings))
    assert "at-prior-bound" in codes and fit.misfit > 3.0


def test_a_table_of_another_wheel_is_refused(case):
    table = torque_rows(case, TRUTH, SLIPS, LOADS)
    table.columns["wheel_radius_m"] = np.where(np.arange(18) == 4, 0.1, 0.15)
    with pytest.raises(TableError, match="row 5, column wheel_radius_m"):
        identify(case, table, method="nonlinear")


def closed(case):
    """The same case on the closed form, whose own data the classical methods fit exactly."""
    gear = LinearWheel(radius=case.model.gear.radius, width=case.model.gear.width)
    return replace(case, model=replace(case.model, gear=gear))


def test_linear_least_squares_is_exact_on_the_closed_form(case):
    given = closed(case).with_values({"shear_modulus": 0.012})
    table = torque_rows(given, TRUTH, SLIPS, LOADS, more=["sinkage_m"])
    given = replace(given, noise=given.noise | {"sinkage_m": Noise(1e-5)}, prior={})
    fit = identify(given, table, ["cohesion", "friction_angle"], method="linear")
    assert fit["cohesion"] == pytest.approx(812.0, rel=1e-6)
    assert fit["friction_angle"] == pytest.approx(0.6, rel=1e-6)
    assert any("shear_modulus is fixed at" in said for said in texts(fit.warnings))


def test_linear_least_squares_carries_the_doubt_about_the_shear_modulus(case):
    given = closed(case).with_values({"shear_modulus": 0.012})
    given = replace(given, noise=case.noise | {"sinkage_m": Noise(1e-4)})
    table = torque_rows(given, TRUTH, SLIPS, LOADS, more=["sinkage_m"])
    doubted = identify(given, table, method="linear")
    prior = given.prior["shear_modulus"]
    middle = 0.5 * (prior.lower + prior.upper)
    believed, *moved = (
        identify(
            replace(given.with_values({"shear_modulus": value}), prior={}),
            table,
            ["cohesion", "friction_angle"],
            method="linear",
        )
        for value in (0.012, middle - prior.std, middle + prior.std)
    )
    changes = [fit.values - believed.values for fit in moved]
    spread = 0.5 * sum(np.outer(change, change) for change in changes)
    np.testing.assert_allclose(doubted.covariance, believed.covariance + spread, rtol=1e-6)
    assert (doubted.std > 3.0 * believed.std).all()
    fixed = "shear_modulus is fixed at 0.012"
    assert f"{fixed}; the width of its prior is propagated into std" in texts(doubted.warnings)
    assert f"{fixed} and treated as exact: it has no prior" in texts(believed.warnings)


def test_linear_least_squares_needs_sinkage_and_two_rows(case):
    with pytest.raises(FitError, match="needs sinkage"):
        identify(case, torque_rows(case, TRUTH, SLIPS, LOADS), method="linear")
    both = replace(case, noise=case.noise | {"sinkage_m": Noise(1e-4)})
    table = torque_rows(case, TRUTH, SLIPS[:1], LOADS[:1], more=["sinkage_m"])
    with pytest.raises(FitError, match="needs two"):
        identify(both, table, method="linear")


def test_newton_raphson_is_exact_on_the_closed_form(case):
    given = closed(case).with_values({"cohesion": 812.0})
    truth = TRUTH | {"kphi": 1.2e6}
    table = torque_rows(given, truth, SLIPS, LOADS, more=["sinkage_m"])
    given = replace(given, noise=given.noise | {"sinkage_m": Noise(1e-4)})
    fit = identify(given, table, method="newton")
    assert fit["friction_angle"] == pytest.approx(0.6, rel=1e-6)
    assert fit["shear_modulus"] == pytest.approx(0.012, rel=1e-6)
    assert fit["kphi"] == pytest.approx(1.2e6, rel=1e-6)


def test_newton_raphson_s_std_is_that_of_the_linearised_model(case):
    prior = {name: p for name, p in case.prior.items() if name != "cohesion"}
    noise = case.noise | {"sinkage_m": Noise(1e-4)}
    truth = TRUTH | {"kphi": 1.2e6}
    given = replace(closed(case).with_values(truth), prior=prior, noise=noise)
    table = torque_rows(given, truth, SLIPS, LOADS, more=["sinkage_m"])
    fit = identify(given, table, method="newton")

    def readings(name, share):
        other = given.with_values({name: (1.0 + share) * truth[name]})
        force = other.model(other.soil, Operating(slip=SLIPS, load=LOADS))
        return np.append(force.torque / (0.02 * table["torque_Nm"]), force.sinkage / 1e-4)

    h = 1e-4
    slopes = [(readings(n, h) - readings(n, -h)) / (2.0 * h * truth[n]) for n in fit.names]
    jacobian = np.stack(slopes, axis=1)
    expected = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    np.testing.assert_allclose(fit.std, expected, rtol=1e-3)


def test_newton_raphson_says_when_the_rows_do_not_determine_all(case):
    with pytest.raises(FitError, match="three or more"):
        identify(case, torque_rows(case, TRUTH, SLIPS[:2], LOADS[:2]), method="newton")
    alike = torque_rows(case, TRUTH, np.full(4, 0.3), np.full(4, 60.0), noise=0.05)
    with pytest.raises(FitError, match="Newton-Raphson"):
        identify(case, alike, method="newton")


OFFSET = """[[effect]]
name = "slip-offset"
[effect.prior]
offset = { normal = 0.015 }
"""


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nonlinear", "posterior"])
def test_a_slip_that_is_off_is_integrated_out_by_its_normal_prior(case, tmp_path, method):
    file = tmp_path / "model.toml"
    file.write_text(MODEL + OFFSET)
    uncertain = read_case(file)
    table = torque_rows(uncertain, TRUTH | {"slip-offset.offset": 0.025}, SLIPS, LOADS, noise=0.01)
    exact = replace(case, noise=uncertain.noise)
    wrong, found = identify(exact, table, method=method), identify(uncertain, table, method=method)
    assert (np.abs(wrong.values - list(TRUTH.values())) > 3.0 * wrong.std).any()
    for name, value in TRUTH.items():
        assert abs(found[name] - value) < 2.5 * found.std[found.names.index(name)]


def test_what_no_row_tells_keeps_its_normal_prior(case, tmp_path):
    file = tmp_path / "model.toml"
    file.write_text(
        MODEL + OFFSET.replace("slip-offset", "sinkage-offset").replace("0.015", "0.001")
    )
    fit = identify(
        read_case(file), torque_rows(case, TRUTH, SLIPS, LOADS), method="nonlinear"
    )  # torque alone
    assert fit["sinkage-offset.offset"] == pytest.approx(0.0, abs=1e-9)
    assert fit.std[fit.names.index("sinkage-offset.offset")] == pytest.approx(0.001, rel=0.01)
    assert fit.remaining_fraction["sinkage-offset.offset"] == pytest.approx(1.0, rel=0.01)
