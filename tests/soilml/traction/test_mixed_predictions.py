"""Prediction with a case of several explanations: soil, effects and error are drawn together."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Model, SlipSinkage, Wheel, soil
from soilml.config.case import Case
from soilml.config.explanations import CaseExplanation
from soilml.config.measurement_noise import Noise
from soilml.fitting.mixtures import without_faults
from soilml.fitting.simulation import simulate
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.effects.sensors import DrawbarOffset
from soilml.traction.soil_draws import measured_soil

SAND = soil("wong1989/dry_sand")
NOISE = {"torque_Nm": Noise(share=0.02), "drawbar_pull_N": Noise(constant=0.3)}
PLAIN = Case(
    Model(Wheel(radius=0.15, width=0.12)), SAND, {"friction_angle": Prior(0.4, 0.8)}, NOISE
)
DIGGING = replace(
    PLAIN,
    model=PLAIN.model + SlipSinkage(n1=0.3),
    prior=PLAIN.prior | {"slip-sinkage.n1": Prior(0.1, 0.5)},
)
OFF = replace(
    PLAIN,
    model=PLAIN.model + DrawbarOffset(offset=1.0),
    prior=PLAIN.prior | {"drawbar-offset.offset": Prior(0.5, 1.5)},
)
MIXED = replace(
    PLAIN, explanations=(CaseExplanation.of(0.6, DIGGING), CaseExplanation.of(0.3, OFF))
)
SLIP, LOAD = np.tile(np.linspace(0.1, 0.5, 6), 3), np.repeat([40.0, 60.0, 90.0], 6)


@pytest.fixture(scope="module")
def drawn():
    rows = simulate(DIGGING, SLIP, LOAD, run="a", seed=3)
    names = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N")
    return measured_soil(MIXED, Table({name: rows[name] for name in names}))


def test_each_explanation_has_the_share_of_its_weight_in_the_draws(drawn):
    n1 = drawn.draws.values[:, drawn.draws.names.index("slip-sinkage.n1")]
    assert np.mean(n1 > 0.0) == pytest.approx(2.0 / 3.0, abs=0.01)
    assert np.median(n1[n1 > 0.0]) == pytest.approx(0.3, abs=0.05)
    said = next(w.text for w in drawn.warnings if w.code == "suspected")
    assert "suspected, not certain: slip-sinkage (0.67), drawbar-offset (0.33)" in said


def test_the_error_fades_to_zero_mean_and_a_usual_size_in_every_direction(drawn):
    slip = np.asarray([0.3, 0.3, 0.3, 0.95])
    load = np.asarray([60.0, 4.0, 900.0, 60.0])
    found = drawn.with_errors(slip, load.tolist(), ("drawbar_pull",))
    error = found[0].errors
    draw = np.arange(len(drawn.draws.values))
    at = [error.at("drawbar_pull", "", draw, np.full(draw.size, s), np.full(draw.size, w))
          for s, w in zip(slip, load, strict=True)]  # fmt: skip
    std, mean = np.std(at, axis=1), np.mean(at, axis=1)
    assert (std[1:] > std[0]).all()
    assert (np.abs(mean[1:]) < 0.2 * std[1:]).all()


def test_a_mixture_predicts_the_mean_reading_of_its_explanations_and_their_sensors():
    slip = np.asarray([0.1, 0.4])
    mixed, digging, off = (
        simulate(case, slip, 60.0)["drawbar_pull_N"] for case in (MIXED, DIGGING, OFF)
    )
    np.testing.assert_allclose(mixed, (0.6 * digging + 0.3 * off) / 0.9, rtol=1e-12)
    no_effect = replace(MIXED, explanations=(CaseExplanation.of(1.0, PLAIN),))
    on_vehicle = simulate(without_faults(OFF), slip, 60.0)["drawbar_pull_N"]
    np.testing.assert_array_equal(simulate(no_effect, slip, 60.0)["drawbar_pull_N"], on_vehicle)
