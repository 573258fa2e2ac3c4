"""Logs of the wheel rigs of other simulators, with the names of their sources."""

import numpy as np
import pytest
from simulated_rig import imported

from soilml.log_import import init_map
from soilml.optional_imports import tomllib

#: Slip by 1 - v/(r omega), torque, pull and sinkage of three stages of 20 s, and the load.
STAGES = ((0.1, 2.1, 9.0, 0.012), (0.3, 4.2, 18.0, 0.015), (0.5, 5.0, 20.0, 0.019))
LOAD, RADIUS, OMEGA, STEP = 60.0, 0.15, 0.7, 0.05


@pytest.fixture
def samples():
    rng = np.random.default_rng(3)
    slip, torque, pull, sinkage = np.repeat(np.asarray(STAGES), round(20 / STEP), axis=0).T
    noise = rng.standard_normal((4, slip.size))
    time = STEP * np.arange(slip.size)
    zero = np.zeros(slip.size)
    return {
        "time": time, "slip": slip, "zero": zero, "omega": np.full(slip.size, OMEGA),
        "v": OMEGA * RADIUS * (1 - slip), "torque": torque + 0.05 * noise[0],
        "pull": pull + 0.3 * noise[1], "load": LOAD + 0.3 * noise[2],
        "sinkage": sinkage + 1e-4 * noise[3],
    }  # fmt: skip


def write(path, columns):
    rows = [",".join(columns), *(",".join(f"{x:.7g}" for x in row) for row in zip(
        *columns.values(), strict=True))]  # fmt: skip
    path.write_text("\n".join(rows) + "\n")
    return path


def test_chrono_drawbar_pull_rig_without_a_header(tmp_path, samples):
    """DBP.dat of ChVehicleCosimWheeledMBSNode: two spaces, seven digits, no names."""
    s = samples
    columns = (s["time"], s["v"], s["omega"], s["slip"], s["slip"], s["pull"], s["pull"])
    lines = ["  ".join(f"{x:.7e}" for x in row) + "  " for row in zip(*columns, strict=True)]
    log = tmp_path / "DBP.dat"
    log.write_text("\n".join(lines) + "\n")
    content = tomllib.loads(init_map([log]))
    # the speed that the rig sets is constant: the slip that it writes is taken
    assert content["slip"] == {"column": "slip", "unit": "1"}
    assert not {"wheel_speed", "ground_speed"} & content.keys()
    assert content["drawbar_pull"] == {"column": "DBP", "unit": "N"}
    load = ("[windows]", '[load]\nvalue = "60 N"\n[windows]')
    rows = imported(tmp_path, [log], [load])[0].table
    assert rows["slip"] == pytest.approx([stage[0] for stage in STAGES], abs=0.005)
    assert rows["drawbar_pull_N"] == pytest.approx([stage[2] for stage in STAGES], rel=0.02)
    # the names are those of this file alone
    log.rename(tmp_path / "other.dat")
    assert "lin_vel" not in init_map([tmp_path / "other.dat"])
