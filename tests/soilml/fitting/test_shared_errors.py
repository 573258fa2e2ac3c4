"""Identification where all rows share errors of the sensors and of the model."""

from dataclasses import replace

import numpy as np
import pytest
from remarked import remarked
from scipy.optimize import least_squares

from soilml import Operating, identify, read_case
from soilml.config.measurement_noise import Noise
from soilml.fitting.coordinates import select_free
from soilml.fitting.error_columns import error_columns
from soilml.fitting.shared_errors import USUAL_LAW_ERRORS, ModelledErrors, usual_errors
from soilml.fitting.usable_readings import usable_readings
from soilml.identification import METHODS
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.effects.contact_shape import ExitAngle
from soilml.physics.effects.sensors import SlipOffset

TRUTH = {"cohesion": 812.0, "friction_angle": 0.6, "shear_modulus": 0.012}
SLIPS, LOADS = np.tile(np.linspace(0.08, 0.6, 6), 3), np.repeat([40.0, 70.0, 110.0], 6)
CHANNELS = {"torque_Nm": "torque", "drawbar_pull_N": "drawbar_pull", "sinkage_m": "sinkage"}
NOISE = {
    "torque_Nm": Noise(share=0.02),
    "drawbar_pull_N": Noise(share=0.02, constant=0.5),
    "sinkage_m": Noise(constant=0.0005),
}


@pytest.fixture
def case(model_file):
    return replace(read_case(model_file), noise=NOISE)


def measured(case, rng, channels=("torque_Nm",), slip_offset=0.0, bearing=1.0, torque_gain=0.0):
    """Rows with noise, whose slip, soil and torque differ from what the case takes them for."""
    soil = case.soil
    other = case.with_values({**TRUTH, "kc": bearing * soil.kc, "kphi": bearing * soil.kphi})
    force = other.model(other.soil, Operating(slip=SLIPS - slip_offset, load=LOADS))
    table = {"slip": SLIPS, "load_N": LOADS}
    for key in channels:
        y = np.asarray(getattr(force, CHANNELS[key]))
        y = y * (1.0 + torque_gain * (key == "torque_Nm"))
        table[key] = y + NOISE[key].std(y) * rng.standard_normal(y.size)
    return Table(table)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nonlinear", "posterior"])
def test_a_bias_gives_what_an_effect_with_a_normal_prior_gives(case, method):
    """An error of the sensor that is left out of the result, and one that is part of it."""
    table = measured(case, np.random.default_rng(1), slip_offset=0.02)
    fit = identify(replace(case, bias={"slip": Noise(constant=0.015)}), table, method=method)
    effect = replace(
        case,
        model=case.model + SlipOffset(offset=0.0),
        prior={**case.prior, "slip-offset.offset": Prior.normal(0.015)},
    )
    other = identify(effect, table, method=method)
    expected = np.asarray([other[name] for name in fit.names])
    std = np.asarray([other.std[other.names.index(name)] for name in fit.names])
    assert (fit.values - expected) / std == pytest.approx(0.0, abs=0.3)
    assert fit.std == pytest.approx(std, rel=0.2)
    exact = identify(case, table, method=method)
    assert (fit.std > 0.95 * exact.std).all()  # at another soil, whose sensitivities differ
    assert fit.std[2] > 1.3 * exact.std[2]
    assert remarked(fit.warnings, "slip 0.015")


def test_errors_of_the_model_change_it_as_other_soils_and_sensors_do(case):
    at, soil = Operating(slip=SLIPS, load=LOADS), case.soil
    changed = case.model + ModelledErrors(
        slip_bias=-0.02, load_gain=0.01, bearing=0.3, bearing_by_load=0.1, typical_load=70.0
    )
    load = 1.01 * LOADS
    factor = np.exp(0.3 + 0.1 * np.log(load / 70.0))
    other = replace(soil, kc=soil.kc * factor, kphi=soil.kphi * factor)
    expected = case.model(other, Operating(slip=SLIPS - 0.02, load=load))
    assert changed(soil, at).torque == pytest.approx(expected.torque, rel=1e-9)
    wider = case.model + ModelledErrors(contact=1.0)
    usual = case.model + ExitAngle(kappa=0.15)
    assert wider(soil, at).sinkage == pytest.approx(usual(soil, at).sinkage, rel=1e-9)
    short, far = (case.model + ModelledErrors(contact=e) for e in (-0.01, -4.0))
    exact, plus = case.model(soil, at), case.model + ModelledErrors(contact=0.01)
    rise = short(soil, at).sinkage - exact.sinkage
    assert rise == pytest.approx(exact.sinkage - plus(soil, at).sinkage, rel=0.05)
    assert np.isfinite(far(soil, at).torque).all()


def rows_of(case, table, usual):
    """Readings, with typical errors or without, and the free parameters."""
    readings, free = usable_readings(case, table), select_free(case, None)
    errors = usual_errors(case, readings.row_load, [c.path for c in free]) if usual else {}
    return replace(readings, shared_errors=errors), free


@pytest.mark.slow
def test_usual_errors_hold_the_truth_where_the_model_is_wrong(case):
    rng, held, before = np.random.default_rng(3), [], []
    truth = np.asarray([TRUTH[f.path] for f in select_free(case, None)])
    for _ in range(12):
        table = measured(case, rng, CHANNELS, slip_offset=0.02, bearing=1.4, torque_gain=-0.03)
        for answers, usual in ((held, True), (before, False)):
            fit = METHODS["nonlinear"](case, *rows_of(case, table, usual))
            answers.append((fit.interval[0] <= truth) & (truth <= fit.interval[1]))
    assert np.mean(held) >= 0.8
    assert np.mean(before) < np.mean(held)


def test_the_misfit_counts_the_errors_that_rows_share(case):
    """Soil and an offset of slip by scipy, from rows without noise whose slip is read 0.03 high."""
    case = replace(case, noise={key: Noise(constant=0.05) for key in ("torque_Nm", "sinkage_m")})
    other = case.with_values(TRUTH)
    true = other.model(other.soil, Operating(slip=SLIPS - 0.03, load=LOADS)).torque
    table = Table({"slip": SLIPS, "load_N": LOADS, "torque_Nm": np.asarray(true)})
    fit = identify(replace(case, bias={"slip": Noise(constant=0.005)}), table, method="nonlinear")

    def residuals(x):
        soil = case.with_values(dict(zip(TRUTH, x[:3] * list(TRUTH.values()), strict=True))).soil
        torque = case.model(soil, Operating(slip=SLIPS - 0.005 * x[3], load=LOADS)).torque
        return np.append((np.asarray(torque) - true) / 0.05, x[3])

    best = least_squares(residuals, [1.0, 1.0, 1.0, 1.0], xtol=1e-10)
    assert best.x[3] > 2.0
    assert fit.misfit == pytest.approx(2.0 * best.cost / (len(SLIPS) - 3), rel=0.05)


def test_what_is_declared_or_unknown_is_no_usual_error(case):
    load = np.asarray([50.0, 100.0])
    usual = usual_errors(case, load, ["cohesion"])
    assert usual["drawbar_pull_bias"] == pytest.approx(0.75)
    assert {"slip_bias", "bearing", "contact"} <= usual.keys()
    declared = replace(case, bias={"slip": Noise(constant=0.0)})
    assert "slip_bias" not in usual_errors(declared, load, ["cohesion"])
    assert "bearing" not in usual_errors(case, load, ["kphi"])
    with_effect = replace(case, model=case.model + SlipOffset(offset=0.01))
    assert "slip_bias" not in usual_errors(with_effect, load, ["cohesion"])


def test_columns_are_differences_of_readings_with_and_without_each_error(case):
    at = Operating(slip=SLIPS, load=LOADS)
    data = usable_readings(case, measured(case, np.random.default_rng(1), tuple(CHANNELS)))
    errors = {"slip_bias": 0.015, "bearing": 0.4, "torque_gain": 0.03, "drawbar_pull_bias": 0.5}
    found = error_columns(case, data, errors)

    def of(force):
        return data.stack({name: np.asarray(getattr(force, name)) for name in CHANNELS.values()})

    for name in ("slip_bias", "bearing"):
        ends = [case.model + ModelledErrors(**{name: e * errors[name]}) for e in (-0.01, 0.01)]
        low, high = (of(model(case.soil, at)) for model in ends)
        np.testing.assert_allclose(found[name], (high - low) / 0.02, rtol=1e-3, atol=1e-7)
    soil, tangent = case.soil, np.tan(case.soil.friction_angle)
    laws = error_columns(case, data, USUAL_LAW_ERRORS)
    stronger, weaker = (
        of(
            case.model(
                replace(soil, cohesion=f * soil.cohesion, friction_angle=np.arctan(f * tangent)), at
            )
        )
        for f in (1.001, 0.999)
    )
    np.testing.assert_allclose(
        laws["strength"], USUAL_LAW_ERRORS["strength"] * (stronger - weaker) / 0.002, rtol=1e-3
    )
    own = data.channel == data.channels.index("torque")
    torque = of(case.model(case.soil, at))[own]
    np.testing.assert_allclose(found["torque_gain"][own], 0.03 * torque, rtol=1e-6)
    assert not found["torque_gain"][~own].any()
    assert set(found["drawbar_pull_bias"]) == {0.0, 0.5}
