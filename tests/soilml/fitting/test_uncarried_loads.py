"""Why no soil carries the loads: the place of the maximum stress, or the loads themselves."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import Operating, identify, read_case
from soilml.cli.main import main
from soilml.errors import FitError
from soilml.fitting.global_optimum import missing_peak, raise_uncarried
from soilml.io.table import Table

SAID = r"a0 \+ a1 slip is 0 at slip 0\.1, and must be above 0 and below 1; change a0 or a1"


@pytest.fixture
def case(model_file):
    own = read_case(model_file)
    return replace(own, soil=replace(own.soil, a0=0.0, a1=0.0))


@pytest.mark.parametrize("method", ["averaged", "posterior", "nonlinear"])
def test_a_maximum_stress_below_the_axle_is_the_reason_that_identify_states(case, method):
    slip, torque = np.asarray([0.1, 0.2, 0.4]), np.asarray([1.5, 2.0, 2.5])
    table = Table({"slip": slip, "load_N": np.full(3, 60.0), "torque_Nm": torque})
    with pytest.raises(FitError, match=SAID):
        identify(case, table, method=method)


def test_a_load_that_is_too_heavy_is_another_reason(case):
    sound = replace(case, soil=replace(case.soil, a0=0.4))
    at = Operating(slip=np.asarray([0.1, 0.2]), load=np.full(2, 1e6))
    assert missing_peak(sound, at) == ""
    with pytest.raises(FitError, match="check load_N"):
        raise_uncarried(sound, at)
    turned = replace(case, soil=replace(case.soil, a0=0.9, a1=0.5))
    light = Operating(slip=np.asarray([0.1, 0.4]), load=np.full(2, 60.0))
    assert missing_peak(turned, light).startswith("a0 + a1 slip is 1.1 at slip 0.4")


def test_simulate_states_the_same_reason(tmp_path, capsys):
    text = '[gear]\ntype = "wheel"\nradius = 0.1\nwidth = 0.08\n[soil]\n'
    path = tmp_path / "model.toml"
    path.write_text(f'{text}name = "wong1989/dry_sand"\na0 = 0\na1 = 0\n')
    assert main(["simulate", str(path), "--slip", "0.1,0.3", "--load", "60"]) == 2
    said = capsys.readouterr().err
    assert "a0 + a1 slip is 0 at slip 0.1, and must be above 0 and below 1" in said
    assert "--load" not in said
