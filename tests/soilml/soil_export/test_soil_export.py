"""Soil in the units of other programs: their own equations give the forces of the fit."""

import json
import math
import re

import numpy as np
import pytest
from conftest import WHEEL_ON_SAND

from soilml import Model, Operating, Soil, Wheel, export_soil, soil
from soilml.cli import main
from soilml.errors import InputError
from soilml.parameters import declared
from soilml.soil_export import TARGETS

SAND = soil("wong1989/dry_sand", a0=0.5, a1=0.0)
CORRELATION = -0.7


def fit_file(folder, **changes):
    """A result of `identify`: cohesion and friction angle of the rows, all else of the file."""
    rng = np.random.default_rng(0)
    cov = CORRELATION * 300.0 * 0.02
    drawn = rng.multivariate_normal([1500.0, 0.55], [[300.0**2, cov], [cov, 0.02**2]], 400)
    values = {name: float(getattr(SAND, name)) for name in declared(Soil)}
    content = {
        "method": "averaged",
        "parameters": {
            "cohesion": {"value": 1500.0, "std": 300.0, "p05": 1007.0, "p95": 1993.0,
                         "unit": "Pa", "remaining_fraction": 0.3},
            "friction_angle": {"value": 0.55, "std": 0.02, "p05": 0.517, "p95": 0.583,
                               "unit": "rad", "remaining_fraction": 0.9},
        },
        "warnings": [],
        "model": {"soil": values | {"cohesion": 1500.0, "friction_angle": 0.55}, "effects": []},
        "draws": {"cohesion": drawn[:, 0].tolist(), "friction_angle": drawn[:, 1].tolist()},
    }  # fmt: skip
    path = folder / "result.json"
    path.write_text(json.dumps(content | changes))
    return path


def codes(export):
    return {(remark.code, *remark.about) for remark in export.remarks}


def test_chrono_takes_them_in_the_order_and_units_of_set_soil_parameters(tmp_path):
    export = export_soil(fit_file(tmp_path), "chrono", tmp_path / "scm")
    content = json.loads((tmp_path / "scm/scm_soil.json").read_text())
    assert list(content["Soil Parameters"].items()) == [
        ("Bekker Kphi", 1528430.0),
        ("Bekker Kc", 990.0),
        ("Bekker n", 1.1),
        ("Mohr Cohesion", 1500.0),
        ("Mohr Friction", pytest.approx(0.55 * 180 / math.pi)),
        ("Janosi Shear", pytest.approx(SAND.shear_modulus)),
        ("Elastic K", 2e8),
        ("Dampening R", 3e4),
    ]
    # what no row reveals is said to be a default, and what the rows leave open too
    assert codes(export) == {
        ("defaulted", "elastic_K"), ("defaulted", "damping_R"),
        ("not-determined", "friction_angle"),
    }  # fmt: skip
    record = json.loads((tmp_path / "scm/export.json").read_text())
    assert record["parameters"]["Bekker_n"]["from"] == "model file"
    assert record["parameters"]["Mohr_cohesion"]["from"] == "rows"
    assert {remark["code"] for remark in record["remarks"]} == {"defaulted", "not-determined"}
    stiff = {name: float(getattr(SAND, name)) for name in declared(Soil)} | {"kphi": 3e8}
    with pytest.raises(InputError, match="kphi is 3e\\+08; chrono needs it below elastic_K"):
        export_soil(fit_file(tmp_path, model={"soil": stiff, "effects": []}), "chrono")


def plugin_forces(parameters, radius, width, slip, load, points=4001):
    """Torque, pull and sinkage of gz-terramechanics, by its source: sums over points of the rim.

    TerramechanicsSystem.cc, computeContactGeometry, computeStresses and computeForces, for slip
    of at least 0 and without grousers.
    """
    p = parameters
    k, phi = p["k"] or p["k_c"] / width + p["k_phi"], math.radians(p["phi"])
    low, high = 0.0, 1.5 * radius
    for _ in range(60):
        depth = (low + high) / 2
        front = math.acos(1 - depth / radius)
        middle = front / 2
        theta = np.linspace(0.0, front, points)
        rear = front - theta * (front - middle) / middle
        angle = np.where(theta >= middle, theta, rear)
        sigma = k * (radius * np.maximum(np.cos(angle) - math.cos(front), 0.0)) ** p["n"]
        moved = radius * (front - theta - (1 - slip) * (math.sin(front) - np.sin(theta)))
        tau = (p["c"] + sigma * math.tan(phi)) * (1 - np.exp(-moved / p["K"]))
        share = radius * width * (theta[1] - theta[0])
        carried = share * np.sum(tau * np.sin(theta) + sigma * np.cos(theta))
        low, high = (depth, high) if carried < load else (low, depth)
    pull = share * np.sum(tau * np.cos(theta) - sigma * np.sin(theta))
    return radius * share * np.sum(tau), pull, depth


@pytest.mark.parametrize(("slip", "load"), [(0.1, 40.0), (0.4, 90.0)])
def test_the_gazebo_plugin_gives_the_forces_of_the_soil(tmp_path, slip, load):
    """The plugin's own equations, with what stands in the file, where its stress angle is ours."""
    export_soil(fit_file(tmp_path), "gazebo", tmp_path / "gz")
    text = (tmp_path / "gz/soil_params.yaml").read_text()
    numbers = {key: float(value) for key, value in re.findall(r"  (\w+): (\S+)", text)}
    assert set(numbers) == {"k", "k_c", "k_phi", "c", "phi", "K", "rho", "n"}
    ground = soil("wong1989/dry_sand", a0=0.5, a1=0.0, cohesion=1500.0, friction_angle=0.55)
    force = Model(Wheel(radius=0.15, width=0.12))(ground, Operating(slip=slip, load=load))
    found = plugin_forces(numbers, 0.15, 0.12, slip, load)
    expected = (force.torque, force.drawbar_pull, force.sinkage)
    assert found == pytest.approx([float(x) for x in expected], rel=3e-3)


def test_draws_are_a_file_each_and_keep_the_spread_and_the_correlation(tmp_path):
    source, out = fit_file(tmp_path), tmp_path / "scm"
    export = export_soil(source, "chrono", out, draws=120)
    drawn = np.asarray([[d["Mohr_cohesion"], d["Mohr_friction"]] for d in export.draws])
    assert drawn.std(axis=0) == pytest.approx([300.0, math.degrees(0.02)], rel=0.2)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(CORRELATION, abs=0.15)
    assert len({draw["Mohr_cohesion"] for draw in export.draws}) == 120
    first = json.loads((out / "scm_soil_001.json").read_text())["Soil Parameters"]
    assert first["Mohr Cohesion"] == export.draws[0]["Mohr_cohesion"]
    assert (
        export_soil(source, "chrono", draws=5).draws
        != export_soil(source, "chrono", draws=5, seed=1).draws
    )
    # fewer draws in the same folder leave no file of the earlier set behind
    (out / "mine_001.json").write_text("{}")
    export_soil(source, "chrono", out, draws=2)
    left = sorted(path.name for path in out.glob("*_0*.json"))
    assert left == ["mine_001.json", "scm_soil_001.json", "scm_soil_002.json"]


@pytest.mark.parametrize("name", TARGETS)
def test_every_parameter_of_the_soil_is_mapped_or_said_to_be_ignored(tmp_path, name):
    target = TARGETS[name]
    used = {part for own in target.mapped for part in own.soil}
    assert used | target.ignored.keys() == declared(Soil).keys()
    assert not used & target.ignored.keys()
    export_soil(fit_file(tmp_path), name, tmp_path / "out")
    page = (tmp_path / "out/README.txt").read_text()
    for own in (*target.mapped, *target.fixed):
        assert f"\n{own.name} " in page
    assert all(source in page for source in target.sources)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["result.json", "--to", "crono"], "did you mean 'chrono'? there are: chrono, gazebo"),
        (["result.json", "--to", "chrono", "--draws", "401"], "has 400 draws: give 400 or fewer"),
        (
            ["several.json", "--to", "chrono"],
            "needed is one soil: soilml identify --where gear=VALUE",
        ),
        (["no_table.json", "--to", "chrono"], "needed is a table [runs]"),
        (["plain.toml", "--to", "gazebo", "--draws", "3"], "have no prior in [soil.prior]"),
        (["old.json", "--to", "gazebo"], "lacks model.soil"),
        (["drawless.json", "--to", "gazebo", "--draws", "3"], "only averaged and posterior"),
        (["wild.json", "--to", "gazebo"], "n is 90; it must lie between 0.05 and 3"),
        (["ragged.json", "--to", "gazebo"], "draws must be lists of numbers of one length"),
        (["list.json", "--to", "gazebo"], "is no result of `soilml identify`"),
        (["broken.json", "--to", "gazebo"], "is not JSON"),
        (["runs.csv", "--to", "gazebo"], "needed is result.json"),
        (["missing.json", "--to", "gazebo"], "cannot be read"),
    ],
)
def test_what_cannot_be_exported_is_one_line(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    good = json.loads(fit_file(tmp_path).read_text())
    (tmp_path / "plain.toml").write_text(WHEEL_ON_SAND)
    wild = good["model"]["soil"] | {"n": 90}
    files = {
        "old": {key: good[key] for key in ("method", "parameters", "warnings")},
        "drawless": {key: good[key] for key in good if key != "draws"},
        "wild": good | {"model": {"soil": wild}},
        "ragged": good | {"draws": {"cohesion": [1.0], "n": [1.0, 1.1]}},
        "list": [1, 2],
        "several": {"by": "gear", "runs": {"a": good, "b": good}},
        "no_table": {"runs": 5},
    }
    for name, content in files.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "runs.csv").write_text("run\na\n")
    assert main(["export", "soil", *words, "--out", "out"]) == 2
    captured = capsys.readouterr()
    assert said in captured.err and captured.err.count("\n") == 1 and not captured.out
    assert not (tmp_path / "out").exists()
