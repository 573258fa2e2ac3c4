"""Identification where all rows share errors of the sensors and of the model."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, identify, read_case
from soilml.cli import main
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.identification.data.observations import read_observations
from soilml.identification.free_parameters import select_free
from soilml.identification.shared_errors.columns import linearised_errors
from soilml.identification.shared_errors.sizes import usual_errors
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.physics.effects.sensors.slip_offset import SlipOffset

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


@pytest.mark.parametrize("method", ["nonlinear", "posterior"])
def test_a_bias_gives_what_an_effect_with_a_normal_prior_gives(case, method):
    """The offset of slip integrated in closed form, and estimated with the soil."""
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
    assert (fit.std > exact.std).all()
    assert any("slip 0.015" in text for text in fit.warnings)


def test_changes_are_those_of_the_model(case):
    """Beside the readings of a model whose bearing and slip differ, also far from zero."""
    rng = np.random.default_rng(2)
    for channels, errors in (
        (CHANNELS, {"bearing": 0.4}),
        (["torque_Nm"], {"slip_bias": 0.015, "torque_gain": 0.03}),
    ):
        table = measured(
            case,
            rng,
            channels,
            slip_offset=-0.02 * ("slip_bias" in errors),
            bearing=1.8 if "bearing" in errors else 1.0,
        )
        data = replace(read_observations(case, table), shared_errors=errors)
        free = select_free(case, None)
        u = np.asarray([f.prior.fraction(TRUTH[f.path]) for f in free])
        std = np.concatenate([c.std for c in data.channels])
        found = linearised_errors(case, free, u, data, std, np.zeros((std.size, 0)))
        known = case.with_values(TRUTH)
        force = known.model(known.soil, Operating(slip=SLIPS, load=LOADS))
        y = np.concatenate([getattr(force, c.name) for c in data.channels])
        reading = np.concatenate([c.reading for c in data.channels])
        residual, basis = (reading - y - found.offset) / std, found.columns / std[:, None]
        likeliest = np.linalg.solve(basis.T @ basis + np.eye(len(errors)), basis.T @ residual)
        left = residual - basis @ likeliest
        assert left @ left < 1.5 * std.size  # noise is all that is left
        right = np.log(1.8) / 0.4 if "bearing" in errors else 0.02 / 0.015
        assert likeliest[0] == pytest.approx(right, abs=0.25)


def test_usual_errors_hold_the_truth_where_the_model_is_wrong(case):
    rng, held, before = np.random.default_rng(3), [], []
    truth = np.asarray([TRUTH[f.path] for f in select_free(case, None)])
    for _ in range(12):
        table = measured(case, rng, CHANNELS, slip_offset=0.02, bearing=1.4, torque_gain=-0.03)
        for answers, usual in ((held, True), (before, False)):
            fit = identify(case, table, as_usual=usual)
            answers.append((fit.interval[0] <= truth) & (truth <= fit.interval[1]))
    assert np.mean(held) >= 0.8
    assert np.mean(before) < np.mean(held)


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


def test_a_closed_form_takes_the_model_as_right(case):
    table = measured(case, np.random.default_rng(4))
    with pytest.raises(InputError, match="nonlinear or posterior"):
        identify(case, table, method="newton", as_usual=True)
    biased = replace(case, bias={"slip": Noise(constant=0.01)})
    assert any(
        "ignores [bias]" in text for text in identify(biased, table, method="newton").warnings
    )


def test_the_command_gives_both_answers_and_says_which_one_to_believe(
    case, model_file, tmp_path, capsys
):
    text = model_file.read_text() + "\n[bias]\nslip = 0.01\n"
    (tmp_path / "biased.toml").write_text(text)
    table = measured(case, np.random.default_rng(5))
    lines = ["run,slip,load_N,torque_Nm"]
    lines += [f"a,{s},{w},{t}" for s, w, t in zip(SLIPS, LOADS, table["torque_Nm"], strict=True)]
    (tmp_path / "runs.csv").write_text("\n".join(lines) + "\n")
    out = tmp_path / "fit.json"
    files = [str(tmp_path / "biased.toml"), str(tmp_path / "runs.csv")]
    assert main(["identify", *files, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "errors that all rows share are included in std: slip 0.01" in shown
    assert "as usual" in shown
    assert "believe the second answer" in shown
    assert '"as_usual"' in out.read_text()
