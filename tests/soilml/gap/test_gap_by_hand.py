"""Figures of the gap analysis beside the same figures computed in another way."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from gap_sets import candidate, case_of, driven, fit_problem, with_readings
from scipy.integrate import quad

from soilml.config.model_settings import UNNAMED_GEAR
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.effect_signatures import SECANT_STEP, Signature, effect_signatures
from soilml.gap.design.planned_readings import joined_readings
from soilml.gap.evidence.covariance import VarianceComponents, assemble_covariance
from soilml.gap.evidence.linearised_fit import AMPLITUDES, amplitude_penalty
from soilml.gap.evidence.outliers import OUTLIER_SIGMA, REPEAT_SIGMA, outliers
from soilml.gap.evidence.prior_odds import EXPECTED_CAUSES
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.evidence.score_test import SignatureSimilarity
from soilml.gap.search.screening import free_law_gains, noise_only_gains, predicted_gains
from soilml.gap.verdict.entries import named_effects, signature_similarity
from soilml.gap.verdict.estimates import (
    PRIOR_HALF_WIDTH,
    effect_estimates,
    soil_estimates,
    updated_case,
)
from soilml.gap.verdict.remainder import discrepancy_map, residual_trend
from soilml.physics.effects import EFFECTS
from soilml.physics.effects.slip_sinkage import SlipSinkage
from soilml.physics.operating_point import Operating


@pytest.fixture(scope="module")
def problem() -> FitProblem:
    case = case_of()
    return fit_problem(case, driven(case, [SlipSinkage(n1=0.3)], seed=2))


@pytest.fixture(scope="module")
def found(problem):
    """The set of slip-sinkage, fitted."""
    return candidate(problem, ["slip-sinkage"], {})


def test_the_prior_of_an_amplitude_is_that_of_its_neighbourhood():
    """Half nothing; else exponential, but for one in fifty: half-Cauchy with the scale 10."""

    def density(a):
        return 0.98 * np.exp(-a) + 0.02 * 20.0 / (np.pi * (100.0 + a * a))

    edges = [0.0, *np.sqrt(AMPLITUDES[1:-1] * AMPLITUDES[2:]), np.inf]
    mass = [0.5 * quad(density, a, b)[0] for a, b in pairwise(edges)]
    expected = -2.0 * np.log([0.5, *mass])
    assert amplitude_penalty(AMPLITUDES[:, None]) == pytest.approx(expected)
    pairs = np.asarray([[0.0, 1.0], [25.0, 0.15]])
    at = [[0, 5], [len(AMPLITUDES) - 1, 1]]
    assert amplitude_penalty(pairs) == pytest.approx([expected[i].sum() for i in at])


def test_separation_is_the_part_of_a_signature_that_no_rival_has():
    cosine = np.asarray([[0.0, 0.6, 0.1], [0.6, 0.0, 0.96], [0.1, 0.96, 0.0]])
    similar = SignatureSimilarity(("a", "b", "c"), np.asarray([5.0, 10.0, 2.0]), cosine)
    assert similar.separation("a", -2.0) == (pytest.approx(2.0 * 5.0 * 0.8), "b")
    assert similar.separation("b", 0.5) == (pytest.approx(0.5 * 10.0 * 0.28), "c")
    assert similar.separation("unknown", 1.0) == (0.0, "")
    assert similar.largest_cosine(["a"]) == 0.6
    assert similar.largest_cosine(["a", "b"]) == 0.96
    assert similar.largest_cosine(["a", "b", "c"]) == similar.largest_cosine(["d"]) == 0.0


def test_similarity_is_that_of_what_the_soil_leaves_of_signatures(problem, found):
    fit = found.fit
    none = np.zeros(len(problem.readings.channels))
    similar = signature_similarity(problem, fit, none)
    case = problem.case.with_values(
        {c.path: fit.values()[c.path] for c in fit.coordinates if (not c.effect)}
    )
    signatures, _ = effect_signatures(case, problem.readings, problem.effects)
    assert similar.names == tuple(s.name for s in signatures)
    whiten = problem.discrepancy.whiten(none)
    soil = whiten @ fit.derivatives[:, :3]
    left = []
    for s in signatures:
        column = whiten @ s.column
        left.append(column - soil @ np.linalg.lstsq(soil, column)[0])
    norms = np.linalg.norm(left, axis=1)
    assert similar.norm == pytest.approx(norms, rel=1e-6, abs=1e-9)
    i, j = similar.names.index("slip-sinkage"), similar.names.index("exit-angle")
    assert similar.cosine[i, j] == pytest.approx(abs(left[i] @ left[j]) / norms[i] / norms[j])
    assert not similar.cosine.diagonal().any()


def test_named_effects_carry_their_estimates_and_rivals(problem, found):
    class Half:
        """Even odds for every effect."""

        def probability(self, name):
            return 0.45

        def log_odds(self, name):
            return 0.0

    similar = SignatureSimilarity(
        ("slip-sinkage", "exit-angle"), np.asarray([4.0, 1.0]), np.asarray([[0.0, 0.8], [0.8, 0.0]])
    )
    other = replace(found, names=("exit-angle",))
    both = replace(found, names=("slip-sinkage", "rate"))
    (effect,) = named_effects([found, both, other], found.fit, similar, Half())
    size = found.fit.x[3]
    assert isinstance(found.fit.coordinates[3], Coordinate) and size > 0.0
    assert (effect.name, effect.alternatives) == ("slip-sinkage", ("exit-angle", "rate"))
    assert effect.separating_snr == pytest.approx(size * 4.0 * 0.6)
    assert (effect.nearest_rival, effect.probability, effect.log_odds) == ("exit-angle", 0.45, 0.0)
    (n1,) = effect_estimates(found.fit, "slip-sinkage").values()
    assert n1.value == pytest.approx(found.fit.values()["slip-sinkage.n1"])
    assert n1.std == pytest.approx(found.fit.stds()["slip-sinkage.n1"])
    assert n1.value == pytest.approx(0.3, abs=4.0 * n1.std)
    assert effect_estimates(found.fit, "rate") == {}
    assert set(soil_estimates(found.fit)) == {"cohesion", "friction_angle", "shear_modulus"}


def test_a_size_gets_a_prior_of_three_standard_deviations_within_its_bounds(found):
    case = updated_case(found.fit)
    value, std = found.fit.values()["slip-sinkage.n1"], found.fit.stds()["slip-sinkage.n1"]
    prior = case.prior["slip-sinkage.n1"]
    assert (prior.lower, prior.upper) == pytest.approx(
        (value - 3.0 * std, value + 3.0 * std), rel=1e-5
    )
    loose = replace(found.fit, jacobian=found.fit.jacobian * 1e-3)  # wider than the bounds
    prior = updated_case(loose).prior["slip-sinkage.n1"]
    assert (prior.lower, PRIOR_HALF_WIDTH) == (0.0, 3.0)
    left = updated_case(found.fit, {"torque_Nm": 0.123456789}).discrepancy
    assert left["torque_Nm"].constant == pytest.approx(0.1235, abs=1e-4)
    assert left["torque_Nm"].share == 0.0 and set(left) == {"torque_Nm"}


def test_readings_are_joined_with_usual_covariates(problem):
    case = case_of()
    other = fit_problem(case, driven(case, loads=(50.0, 70.0), slips=3, speed=[0.1, 0.2])).readings
    first = problem.readings
    both = joined_readings(first, other)
    n, m = len(first.run), len(first)
    assert both.runs == (*first.runs, *other.runs) and len(both) == m + len(other)
    assert both.run.tolist() == [*first.run, *(other.run + 4)]
    assert both.row[m:].tolist() == (other.row + n).tolist()
    assert both.at.speed[n:].tolist() == [0.1] * 3 + [0.2] * 3
    assert np.ptp(both.at.speed[:n]) == 0.0 and both.at.pass_number is None
    assert both.load[m:].tolist() == other.load.tolist() and both.at.gear is None
    named = replace(other, at=replace(other.at, gear=np.full(6, "lugged")))
    assert joined_readings(first, named).at.gear.tolist() == [UNNAMED_GEAR] * n + ["lugged"] * 6


@pytest.mark.parametrize("scale, struck", [(1.0, 1.1 * OUTLIER_SIGMA), (3.0, 3.4 * OUTLIER_SIGMA)])
def test_outliers_are_judged_by_the_scale_of_most_readings(problem, scale, struck):
    """Studentised residuals of independent readings without an unknown are those over noise."""
    readings = problem.readings
    known = VarianceComponents(np.ones(3), 0.0, 0.0, 0.0, 1e6)
    covariance = assemble_covariance(readings, np.zeros((len(readings), 2)), known)
    z = scale * np.random.default_rng(3).permutation(
        np.quantile(np.random.default_rng(0).standard_normal(9999), np.linspace(0.01, 0.99, 96))
    )
    z[5], z[9] = struck, 0.9 * struck * (1.0 if scale == 1.0 else 0.7)
    space = np.zeros((96, 0))
    found = outliers(covariance, z * readings.std, space)
    assert np.flatnonzero(found).tolist() == [5]
    alike, run = np.arange(96), np.zeros(96, dtype=np.int64)
    alike[9], run[9] = 5, 1  # a repeat of another run, 0.5 and more away
    agrees = abs(z[5] - z[9]) <= REPEAT_SIGMA * np.sqrt(2.0) and z[9] > REPEAT_SIGMA * scale
    assert outliers(covariance, z * readings.std, space, alike, run)[5] == (not agrees)


def test_signatures_are_secants_in_the_possible_direction(problem):
    case, readings = problem.case, problem.readings
    signatures, missing = effect_signatures(case, readings, problem.effects)
    by_name = {s.name: s for s in signatures}
    assert str(missing["rate"]) == "needs the column speed_m_s"
    dug = by_name["slip-sinkage"]
    assert dug.sign == 1 and by_name["torque-offset"].sign == 0
    assert dug.kind == EFFECTS["slip-sinkage"].about.kind
    reference = EFFECTS["slip-sinkage"].about.reference["n1"]
    step = SECANT_STEP
    at = Operating(slip=np.asarray(readings.at.slip), load=np.asarray(readings.at.load))
    changed = (case.model + SlipSinkage(n1=step * reference))(case.soil, at)
    base = case.model(case.soil, at)
    own = [
        (np.asarray(getattr(changed, name)) - np.asarray(getattr(base, name))) / step
        for name in readings.channels
    ]
    expected = np.asarray(own)[readings.channel, readings.row]
    # far below the noise: the search for equilibrium of a signature ends early
    assert dug.column / readings.std == pytest.approx(expected / readings.std, rel=1e-4, abs=1e-3)


def test_one_speed_is_not_enough_to_test_a_rate():
    case = case_of()
    constant = fit_problem(case, driven(case, speed=[0.1] * 4)).readings
    missing = effect_signatures(case, constant, {"rate": EFFECTS["rate"]})[1]
    assert missing["rate"].code == "constant-column"
    assert missing["rate"].text == "needs runs at several values of speed_m_s"
    several = fit_problem(case, driven(case, speed=[0.1, 0.1, 0.2, 0.2])).readings
    (tested,), missing = effect_signatures(case, several, {"rate": EFFECTS["rate"]})
    assert tested.name == "rate" and missing == {}


def test_gains_are_what_least_squares_gains(problem):
    soil = problem.fit_soil([np.full(3, 0.5)])
    rng = np.random.default_rng(0)
    std = problem.readings.std
    columns = {"up": 1, "down": -1, "any": 0}
    whiten = problem.covariance.whiten
    shape = rng.standard_normal(len(std)) * std
    signatures = [Signature(name, "soil", shape, sign) for name, sign in columns.items()]
    gains = noise_only_gains(problem, soil, signatures)
    fit = soil.whitened_by(whiten)
    together = np.column_stack([fit.jacobian, whiten @ shape])
    alone = np.linalg.lstsq(fit.jacobian, fit.residual)[0]
    solution = np.linalg.lstsq(together, fit.residual)[0]
    gained = np.sum((fit.residual - fit.jacobian @ alone) ** 2)
    gained -= np.sum((fit.residual - together @ solution) ** 2)
    assert gains["any"] == pytest.approx(gained) and gained > 0.0
    side = "up" if solution[-1] > 0.0 else "down"
    assert gains[side] == gains["any"] and sorted(gains.values())[0] == 0.0
    candidate_ = candidate(problem, ["slip-sinkage"], {})
    free = free_law_gains(problem, candidate_.amplitude, soil, signatures)
    assert free["any"] >= gained * 0.999


def test_the_map_of_the_gap_has_the_side_of_the_readings(problem):
    soil = problem.fit_soil([np.full(3, 0.5)])
    found = discrepancy_map(problem, soil, 0)
    std = problem.covariance.std
    standardised = (problem.readings.measured - soil.prediction) / std
    sizes = [abs(d.z) for d in found]
    assert sizes == sorted(sizes, reverse=True) and len(found) > 3
    worst = found[0]
    channel = ["torque_Nm", "drawbar_pull_N", "sinkage_m"].index(worst.channel)
    low, high = worst.slip
    here = problem.readings.channel == channel
    here &= (problem.readings.slip >= low) & (problem.readings.slip <= high)
    low, high = worst.load_N
    here &= (problem.readings.load >= low) & (problem.readings.load <= high)
    assert np.sign(worst.z) == np.sign(standardised[here].mean())
    assert worst.p < 0.05


def test_an_effect_of_an_impossible_sign_gains_less_than_nothing(problem, found):
    column = found.fit.derivatives[:, 3]  # more of slip-sinkage, which is there already
    none = candidate(problem, [], {})
    signs = {"more": 1, "less": -1, "any": 0}
    signatures = [Signature(name, "soil", column, sign) for name, sign in signs.items()]
    three = replace(problem, effects=dict.fromkeys(signs, EFFECTS["slip-sinkage"]))
    gains = predicted_gains(three, none, none.objective, signatures)
    assert gains["more"] == gains["any"] > 50.0
    assert gains["less"] == pytest.approx(-2.0 * np.log(3.0 / EXPECTED_CAUSES))


def test_a_trend_of_residuals_is_stated_in_sigma_by_channel(problem):
    """A sinkage that is off by a smooth function of slip and load, and readings without noise."""
    soil = problem.fit_soil([np.full(3, 0.5)])
    readings, std = problem.readings, problem.covariance.std
    smooth = np.sin(12.0 * readings.slip) * np.log(readings.load / 75.0)
    off = np.where(readings.channel == readings.channels.index("sinkage"), smooth * std, 0.0)
    trend = residual_trend(problem, with_readings(soil, soil.prediction + 8.0 * off))
    rms = 8.0 * np.sqrt(np.mean(smooth[off != 0.0] ** 2))
    assert trend["sinkage_m"] == pytest.approx(rms, rel=0.35) and trend["sinkage_m"] < rms
    assert trend["torque_Nm"] == trend["drawbar_pull_N"] == 0.0
    rng = np.random.default_rng(0)
    noise = residual_trend(
        problem, with_readings(soil, soil.prediction + std * rng.standard_normal(len(std)))
    )
    assert max(noise.values()) < 0.5
