"""Slip as what is learned: from torque, from other channels, and from both in one file or two."""

import functools

import numpy as np
import pytest
from conftest import WHEEL_ON_SAND
from trained_by_text import trained_by

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator
from soilml.cli import main
from soilml.errors import InputError
from training.export.model_file import export_model

pytestmark = pytest.mark.slow

RECIPE = (
    "rows = {rows}\nseed = {seed}\n"
    + WHEEL_ON_SAND
    + """\
[soil.prior]
{soil}
[operating]
slip = [0.05, 0.6]
load_N = [30.0, 120.0]
[noise]
torque_Nm = "4 %"
drawbar_pull_N = "10 % + 3"
"""
)
KNOWN = "friction_angle = [0.60, 0.62]"
UNKNOWN = "friction_angle = [0.436332, 0.785398]\nshear_modulus = [0.005, 0.03]"
TORQUE = 'features = ["torque/load", "load"]\ntargets = ["slip"]\n'
PULL = 'features = ["drawbar_pull", "load"]\ntargets = ["slip"]\n'
BOTH = 'features = ["torque/load", "load", "drawbar_pull"]\ntargets = ["slip"]\n'
MACHINE = '[[regressor]]\ntype = "fixed-size-lssvm"\ncentres = 30\n'
OF_TORQUE = MACHINE + 'features = ["torque/load", "load"]\n'
OF_PULL = MACHINE + 'features = ["drawbar_pull", "load"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slip")
    for name, soil in (("known", KNOWN), ("unknown", UNKNOWN)):
        (folder / "r.toml").write_text(RECIPE.format(rows=3000, seed=4, soil=soil))
        generate(read_recipe(folder / "r.toml"), folder / f"{name}.parquet")
    return folder


@pytest.fixture(scope="module")
def trained(folder):
    @functools.cache
    def of(text, data="known"):
        rows = folder / f"{data}.parquet"
        original = trained_by(text, rows, folder)
        path = folder / f"{len(list(folder.iterdir()))}.onnx"
        export_model(original, path, rows)
        return original, path

    return of


def share(original):
    return original.scores["estimator"].relative[0]


def test_slip_follows_from_torque_on_known_soil_and_hardly_on_unknown(trained):
    known = trained(TORQUE + MACHINE)[0]
    unknown = trained(TORQUE + MACHINE, "unknown")[0]
    assert share(known) < 0.6 < 0.75 < share(unknown) < 1.0
    for original in (known, unknown):
        assert abs(original.scores["estimator"].cover90[0] - 0.9) < 0.06


def test_a_channel_that_was_not_measured_is_named(trained):
    estimator = Estimator.load(trained(BOTH + OF_TORQUE + OF_PULL)[1])
    with pytest.raises(InputError, match="drawbar_pull is nan"):
        estimator(torque=3.2, load=60.0, drawbar_pull=np.nan)
    with pytest.raises(InputError, match="drawbar_pull is missing"):
        estimator(torque=3.2, load=60.0)
    nothing = estimator.prior_estimate(4)
    assert nothing.mean.shape == (4, 1) and not nothing.in_range.any()
    np.testing.assert_array_equal(nothing.std[2], estimator.prior.std)


def test_the_command_fuses_files_and_goes_on_without_a_channel(trained, tmp_path, capsys):
    first, second = (str(trained(text + MACHINE)[1]) for text in (TORQUE, PULL))
    log = tmp_path / "log.csv"
    log.write_text("run,load_N,torque_Nm,drawbar_pull_N\na,60,3.2,8\na,60,3.2,\na,60,,8\na,60,,\n")
    command = ["estimate", first, str(log), "--with", second, "--out", str(tmp_path / "o.csv")]
    assert main([*command, "-v"]) == 0
    said = capsys.readouterr().out
    assert "1 rows lack a reading" in said
    found = [line.split(",") for line in (tmp_path / "o.csv").read_text().splitlines()]
    assert found[0][4:] == ["slip", "slip_std", "slip_p05", "slip_p95", "in_range", "files"]
    assert [row[-1] for row in found[1:]] == ["2", "1", "1", "0"]
    std = [float(row[5]) for row in found[1:4]]
    assert std[0] < std[1] < std[2]
    assert found[4][4:8] == ["", "", "", ""]
    assert main([*command, "--by", "run"]) == 2
    assert "omit --by" in capsys.readouterr().err
    assert main(["estimate", first, str(log), "--by", "run"]) == 2
    assert "differs from row to row of a run" in capsys.readouterr().err
    log.write_text("run,load_N,torque_Nm\na,60,3.2\n")
    assert main(command) == 2
    assert "column drawbar_pull_N is missing" in capsys.readouterr().err
