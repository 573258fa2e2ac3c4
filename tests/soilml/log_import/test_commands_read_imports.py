"""What an import writes, every command reads without an edit, or refuses by a column's name."""

import numpy as np
import pytest
from foreign_rigs import RADIUS, law
from rig_tables import write

from soilml.cli import main

MODEL = f"""[gear]
type = "wheel"
radius = {RADIUS}
width = 0.1
[soil]
name = "wong1989/dry_sand"
[soil.prior]
friction_angle = ["20 deg", "45 deg"]
[noise]
torque_Nm = "3 %"
[bias]
torque_Nm = "2 %"
"""
#: Priors of all parameters that the released file estimates.
PRIORS = """[soil.prior]
cohesion = [0.0, 2000.0]
shear_modulus = { range = [0.005, 0.04], scale = "log" }
kphi = { range = [2e5, 5e6], scale = "log" }
n = [0.6, 1.4]
"""
MAP = """[runs]
each_row = true
column = "test"
[wheel]
radius = 0.13
[slip]
column = "slip"
[load]
column = "load"
unit = "N"
[torque]
column = "torque"
unit = "N m"
"""
SLIP = np.array([0.05, 0.15, 0.25, 0.35, 0.45, 0.6])


def rows(**changes):
    torque, _, sinkage = law(SLIP, 60.0)
    own = {"test": ["a", "a", "a", "b", "b", "b"], "slip": SLIP, "load": np.full(6, 60.0),
           "torque": torque * (1 + 0.01 * np.cos(9 * SLIP)), "sinkage": sinkage}  # fmt: skip
    return own | changes


def with_row(values, last):
    return np.append(values[:-1], last)


SINKAGE = '[sinkage]\ncolumn = "sinkage"\nunit = "m"'
#: Kind of rows: columns, and lines that the map has in addition.
KINDS = {
    "constant channels": (rows(sinkage=np.full(6, 0.01)), SINKAGE),
    "a single run": (rows(test=["a"] * 6), ""),
    "blank standard errors": (rows(err=["0.05", "", "0.04", "", "", "0.1"]), 'std = "err"'),
    "a wheel that spins": (rows(slip=with_row(SLIP, 1.0)), ""),
    "a locked wheel": (rows(slip=with_row(SLIP, -1.0), torque=with_row(SLIP + 2, -5.0)), ""),
    "an unloaded wheel": (rows(load=with_row(rows()["load"], -3.0)), ""),
    "a torque that one row lacks": (rows(torque=[*map(str, rows()["torque"][:-1]), ""]), ""),
}  # fmt: skip


def imported(folder, columns, text):
    log = folder / "log.csv"
    cells = [[str(x) for x in values] for values in columns.values()]
    log.write_text("\n".join([",".join(columns), *map(",".join, zip(*cells, strict=True))]))
    (folder / "map.toml").write_text(text)
    (folder / "model.toml").write_text(MODEL)
    out = folder / "runs.csv"
    assert main(["import", str(log), "--map", str(folder / "map.toml"), "--out", str(out)]) == 0
    return str(folder / "model.toml"), str(out)


@pytest.mark.parametrize("kind", KINDS)
def test_identify_and_estimate_read_what_import_wrote(kind, tmp_path):
    columns, more = KINDS[kind]
    model, out = imported(tmp_path, columns, MAP + more)
    assert main(["identify", model, out, "--method", "nonlinear"]) == 0
    text = MODEL.replace("[soil.prior]\n", PRIORS)
    (tmp_path / "model.toml").write_text(text)
    assert main(["estimate", "exported/any_wheel.onnx", out, "--model", model, "--by", "run"]) == 0


def test_several_wheels_of_a_log_over_time_are_read(tmp_path):
    t = np.arange(0, 24, 0.05)
    slip = np.where(t < 12, 0.2, 0.45)
    rng = np.random.default_rng(3)
    columns = {"t": t, "v": 0.1 + rng.normal(0, 1e-3, t.size)}
    for name in ("fl", "fr"):
        columns[f"{name}_omega"] = 0.1 / (1 - slip) / RADIUS + rng.normal(0, 2e-3, t.size)
        columns[f"{name}_torque"] = law(slip, 60.0)[0] + rng.normal(0, 0.03, t.size)
    log = write(tmp_path / "log.csv", columns, digits=6)
    text = """[time]
column = "t"
[wheel]
radius = 0.13
[vehicle]
mass = "12.24 kg"
wheels = 2
[ground_speed]
column = "v"
"""
    for name in ("fl", "fr"):
        text += f'[wheels.{name}.wheel_speed]\ncolumn = "{name}_omega"\n'
        text += f'[wheels.{name}.torque]\ncolumn = "{name}_torque"\n'
    for path, content in (("map.toml", text), ("model.toml", MODEL)):
        (tmp_path / path).write_text(content)
    out = str(tmp_path / "runs.csv")
    assert main(["import", str(log), "--map", str(tmp_path / "map.toml"), "--out", out]) == 0
    assert main(["identify", str(tmp_path / "model.toml"), out, "--method", "nonlinear"]) == 0


def test_rows_of_several_radii_are_refused_by_name(tmp_path, capsys):
    columns = rows(wheel_radius_m=[0.13] * 3 + [0.2] * 3)
    model, out = imported(tmp_path, columns, MAP.replace("radius = 0.13", ""))
    assert main(["identify", model, out]) == 2
    assert "wheel_radius_m: 0.2 given" in capsys.readouterr().err
