"""Stances of a wheel-leg's log, of which every one is known: see examples/import/wheel_leg.py."""

import sys
from pathlib import Path

import numpy as np
import pytest

from soilml import Estimator
from soilml.errors import InputError
from soilml.log_import import import_log
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.quantities import Z_90, column

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "examples" / "import"))

import wheel_leg as rig  # noqa: E402


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("leg")
    files, truth = rig.write_logs(folder, seed=7)
    return files, truth, (folder / "map.toml").read_text()


def imported(logs, tmp_path, *edits, runs=1):
    files, truth, text = logs
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "m.toml").write_text(text)
    found = import_log(files[: 2 * runs], tmp_path / "m.toml")
    return found, rig.of_stances(found.table, truth)


def table_of(text, name):
    """The table [name] of a map, to be taken out."""
    start = text.index(f"[{name}]")
    return text[start : text.find("\n[", start) + 1]


NO_ZERO = [(line + "\n", "") for line in rig.MAP.splitlines() if line.startswith("zero")]


def test_every_stance_is_read_with_errors_that_hold(logs, tmp_path):
    found, true = imported(logs, tmp_path, runs=4)
    table = found.table
    assert len(table) >= 30 and len(true) == 4
    for name, values in true.items():
        error, std = table[name] - values, table[f"{name}_std"]
        assert np.mean(np.abs(error) <= Z_90 * std) >= 0.75, name
        assert np.sqrt(np.mean(error**2)) < 0.02 * values.mean(), name


def test_wild_samples_and_gaps_do_not_become_readings(logs, tmp_path):
    found, true = imported(logs, tmp_path)
    spikes = [n for s in found.series for n in s.notes if n.code == "spikes"]
    assert {n.about[0] for n in spikes} == {"motor_current", "vibration"}
    assert np.abs(found.table["vibration_m_s2"] - true["vibration_m_s2"]).max() < 1.0
    assert "wheel_radius_m" not in found.table  # the foot of a model file has another radius


def test_without_travel_the_rows_have_no_slip_and_files_tell_it(logs, tmp_path):
    cut = (table_of(rig.MAP, "position"), "")
    found, true = imported(logs, tmp_path, cut, runs=2)
    assert np.isnan(found.table["slip"]).all() and len(found.table) >= 20
    files = [
        Estimator.load(ROOT / f"exported/slip_{s}_paper.onnx") for s in ("torque", "vibration")
    ]
    alone = [f(**{n: found.table[column(n)] for n in f.inputs}) for f in files]
    fused = fuse_estimates(alone).estimate
    error = [np.sqrt(np.mean((e.mean[:, 0] - true["slip"]) ** 2)) for e in (*alone, fused)]
    assert error[2] < 0.9 * files[0].prior.std[0] and error[2] < error[0]


def test_what_the_map_lacks_or_has_twice_is_named(logs, tmp_path):
    for edits, said in (
        (NO_ZERO, "zero is missing"),
        ([(table_of(rig.MAP, "wheel_angle"), "")], r"\[wheel_angle\] is missing"),
        ([("legs = 5", "legs = 2")], "legs is 2; it must lie between 3 and 12"),
        ([("legs = 5", "legs = 5\nhalf_width = 1.0")], "half_width is 1 rad"),
        ([("[wheel_leg]", "[wheel]\nradius = 0.15\n[wheel_leg]")], "beside .wheel. radius"),
        ([("legs = 5", "legs = 5\nlegnth = 1")], "unknown key 'legnth'"),
    ):
        with pytest.raises(InputError, match=said):
            imported(logs, tmp_path, *edits)


def test_without_the_table_its_channels_are_unknown(logs, tmp_path):
    table = table_of(rig.MAP, "wheel_leg")
    with pytest.raises(InputError, match="unknown key"):
        imported(logs, tmp_path, (table, "[wheel]\nradius = 0.18\n"))
