"""Why no soil carries the loads: the place of the maximum stress, or the loads themselves."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import identify
from soilml.cli.main import main
from soilml.errors import FitError
from soilml.io.table import Table

PEAK = r"a0 \+ a1 slip is {} at slip {}, and must be above 0 and below 1; change a0 or a1"


@pytest.mark.parametrize("method", ["averaged", "posterior", "nonlinear"])
@pytest.mark.parametrize(
    ("a0", "a1", "load", "said"),
    [
        (0.0, 0.0, 60.0, PEAK.format("0", r"0\.1")),
        (0.98, 0.5, 60.0, PEAK.format(r"1\.03", r"0\.1")),
        (0.4, 0.0, 1e6, "no parameters in the prior carry the measured loads: check load_N"),
    ],
)
def test_identify_states_why_nothing_carries_the_loads(case, method, a0, a1, load, said):
    case = replace(case, soil=replace(case.soil, a0=a0, a1=a1))
    slip, torque = np.asarray([0.1, 0.15, 0.4]), np.asarray([1.5, 2.0, 2.5])
    table = Table({"slip": slip, "load_N": np.full(3, load), "torque_Nm": torque})
    with pytest.raises(FitError, match=said):
        identify(case, table, method=method)


def test_simulate_states_the_same_reason(tmp_path, capsys):
    text = '[gear]\ntype = "wheel"\nradius = 0.1\nwidth = 0.08\n[soil]\n'
    path = tmp_path / "model.toml"
    path.write_text(f'{text}name = "wong1989/dry_sand"\na0 = 0\na1 = 0\n')
    assert main(["simulate", str(path), "--slip", "0.1,0.3", "--load", "60"]) == 2
    said = capsys.readouterr().err
    assert "a0 + a1 slip is 0 at slip 0.1, and must be above 0 and below 1" in said
    assert "--load" not in said
