"""A map of a drive over two soils: where they change, what they are, and what the rover does."""

import json
from dataclasses import replace

import numpy as np
import pytest

from soilml import Estimator, Model, Operating, Wheel, read_case, soil, soil_map
from soilml.cli import main
from soilml.config.explanations import CaseExplanation
from soilml.errors import InputError
from soilml.io.text_tables import csv_text
from soilml.physics.effects import StressShift
from soilml.soil_maps.field import FieldSetting, SoilField, map_ability
from soilml.soil_maps.local_soils import LocalSoils, lower_root
from soilml.soil_maps.raster import MapGrid, geotiff, nav2_files

tifffile = pytest.importorskip("tifffile")

ROVER = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.436332, 0.785398]
shear_modulus = [0.005, 0.03]
[noise]
torque_Nm = "2 %"
[rover]
mass = 24.0
centre_of_mass = [0.0, 0.0, 0.2]
[rover.wheels]
front-left = { position = [0.4, 0.3] }
front-right = { position = [0.4, -0.3] }
rear-left = { position = [-0.4, 0.3] }
rear-right = { position = [-0.4, -0.3] }
"""
#: A weak and a strong soil, and where the second begins, m.
SOILS = {
    "cohesion": (300.0, 2500.0),
    "friction_angle": (0.47, 0.72),
    "shear_modulus": (0.02, 0.012),
}
BORDER, STEP = 26.0, 0.25


def two_soils(count=208):
    """Columns of one wheel that drives to the east over both."""
    rng = np.random.default_rng(3)
    x = STEP * np.arange(count)
    slip = np.clip(0.25 + 0.18 * np.sin(0.9 * np.arange(count)), 0.05, 0.5)
    load = 60.0 + 20.0 * np.sin(0.37 * np.arange(count))
    ground = soil(
        "wong1989/dry_sand", **{n: np.where(x < BORDER, *pair) for n, pair in SOILS.items()}
    )
    force = Model(Wheel(radius=0.15, width=0.12))(ground, Operating(slip=slip, load=load))
    torque = force.torque * (1.0 + 0.02 * rng.standard_normal(count))
    return {"x_m": x, "y_m": 0.0 * x, "slip": slip, "torque_Nm": torque, "load_N": load}


@pytest.fixture(scope="module")
def rover(tmp_path_factory):
    file = tmp_path_factory.mktemp("map") / "rover.toml"
    file.write_text(ROVER)
    return file


@pytest.fixture(scope="module")
def estimator():
    return Estimator.load("wheel").on(noise={"torque": (0.0, 0.02)})


@pytest.fixture(scope="module")
def found(rover, estimator):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("soilml.soil_maps.field.DRAWS", 400)
        return soil_map(
            read_case(rover),
            two_soils(),
            estimator,
            cell=1.0,
            slopes=np.deg2rad([0.0, 15.0]),
        )


def test_the_change_of_soil_is_where_it_is(found):
    assert len(found.changes) == 1 and abs(found.changes[0] - BORDER) < 1.0
    assert found.followed.used.mean() > 0.95


def test_the_soils_are_within_their_intervals(found):
    mean, std = found.moments
    east = found.grid.centres[found.known][:, 0]
    for side, rows in enumerate((east < BORDER - 2.0, east > BORDER + 2.0)):
        true = np.asarray([pair[side] for pair in SOILS.values()])
        assert np.all(np.abs(mean[rows] - true) < 2.5 * std[rows])
    # a field that said nothing would pass: it says more than the prior
    assert np.median(std, axis=0) == pytest.approx([560.0, 0.062, 0.0038], rel=0.5)
    weak, strong = (np.median(mean[rows], axis=0) for rows in (east < 24.0, east > 28.0))
    assert strong[0] > weak[0] and strong[1] > weak[1]


def test_the_weak_soil_is_climbed_with_less_probability_and_more_slip(found):
    ability, east = found.ability, found.grid.centres[found.known][:, 0]
    weak, strong = east < BORDER - 1.0, east > BORDER + 1.0
    assert ability.climbed[weak, 1].max() < ability.climbed[strong, 1].min()
    assert np.nanmin(ability.slip[weak, 1]) > np.nanmax(ability.slip[strong, 1])
    # level ground takes less slip and work than a slope
    assert np.all(ability.climbed[:, 0] >= ability.climbed[:, 1])
    assert np.nanmax(ability.energy[:, 0]) < np.nanmin(ability.energy[:, 1])


def test_slopes_have_each_explanation_as_likely_as_it_is(found, rover):
    alone, n = read_case(rover), 3
    shift = replace(alone, model=alone.model + StressShift(shift=0.5))
    both = tuple(CaseExplanation.of(0.5, one) for one in (alone, shift))
    score, covariance = np.zeros((n, 3)), np.tile(0.1 * np.eye(3), (n, 1, 1))
    slope = np.deg2rad([12.0])
    climbed = {
        name: map_ability(case, found.soils, score, covariance, slope).climbed.mean()
        for name, case in {
            "alone": alone, "shift": shift, "both": replace(alone, explanations=both)
        }.items()
    }  # fmt: skip
    assert abs(climbed["alone"] - climbed["shift"]) > 0.2
    half = 0.5 * (climbed["alone"] + climbed["shift"])
    assert climbed["both"] == pytest.approx(half, abs=0.05)


def test_the_field_is_the_conditional_normal(monkeypatch):
    """Beside the joint covariance of places and stretches, written out."""
    rng = np.random.default_rng(1)
    place, patch = rng.uniform(0.0, 10.0, (5, 2)), np.asarray([0, 0, 0, 1, 1])
    roots = 0.4 * rng.standard_normal((5, 2, 2))
    errors = roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(2)
    common = np.asarray([[0.5, 0.2], [0.2, 0.3]])
    score = rng.standard_normal((5, 2))
    soils = LocalSoils((), place, place[:, 0], patch, score, errors, common)
    setting = FieldSetting(drive=0.2, patch=0.3, local=0.5, length=4.0, excess=2.0)
    monkeypatch.setattr(SoilField, "settings", [setting])
    monkeypatch.setattr("soilml.soil_maps.field.ACROSS", 0.5)
    own = SoilField(replace(soils, patch=np.zeros(5, int)))  # one patch: no mixture at its end
    at = np.asarray([[2.0, 3.0], [9.0, 1.0]])
    mean, covariance = own.at(at)
    every = np.vstack([at, place])
    distance = np.hypot(*(every[:, None] - every).transpose(2, 0, 1))
    root = np.sqrt(3.0) * distance / 4.0
    joint = np.kron(0.2 + 0.3 + 0.5 * (1 + root) * np.exp(-root), np.eye(2))
    seen = np.r_[np.zeros(4), np.ones(10)]
    joint += np.outer(seen, seen) * np.kron(np.ones((7, 7)), common)
    for i in range(5):
        block = slice(4 + 2 * i, 6 + 2 * i)
        joint[block, block] += 2.0 * errors[i]
    across, inner = joint[:4, 4:], joint[4:, 4:]
    assert mean.ravel() == pytest.approx(across @ np.linalg.solve(inner, score.ravel()), abs=1e-6)
    left = joint[:4, :4] - across @ np.linalg.solve(inner, across.T)
    assert covariance[0] == pytest.approx(left[:2, :2], abs=1e-6)
    assert covariance[1] == pytest.approx(left[2:, 2:], abs=1e-6)


def test_the_root_of_a_singular_covariance_is_finite():
    flat = np.asarray([[0.04, 0.02], [0.02, 0.01 - 1e-17]])
    for covariance in (flat, np.zeros((2, 2))):
        root = lower_root(np.stack([covariance, np.eye(2)]))
        assert root[0] @ root[0].T == pytest.approx(covariance, abs=1e-9)


def test_a_geotiff_lies_where_its_cells_are(tmp_path):
    grid = MapGrid.around(np.asarray([[0.3, 1.2], [4.0, 2.0]]), 0.5, 1.0)
    assert (grid.west, grid.south) == (-1.0, 0.0) and grid.shape == (6, 12)
    values = np.arange(72.0).reshape(grid.shape)
    values[0, 0] = np.nan
    file = tmp_path / "a.tif"
    file.write_bytes(geotiff(grid, {"one": values, "two & more": -values}))
    with tifffile.TiffFile(file) as opened:
        page = opened.pages[0]
        data, tags = opened.asarray(), {tag.code: tag.value for tag in page.tags}
    # the first row of a GeoTIFF is the northern one
    assert np.array_equal(data[0], values[::-1].astype(np.float32), equal_nan=True)
    assert tags[33550][:2] == (0.5, 0.5) and tags[33922][3:5] == (-1.0, 3.0)
    assert tags[34735][4:8] == (1024, 0, 1, 32767) and "two &amp; more" in tags[42112]


def test_nav2_reads_the_probability_of_not_climbing():
    grid = MapGrid(-1.5, 2.0, 0.5, (2, 3))
    files = nav2_files(grid, np.asarray([[0.0, 0.304, 1.0], [np.nan, 0.5, 0.996]]))
    head, body = files["costmap.pgm"][:11], files["costmap.pgm"][11:]
    assert head == b"P5\n3 2\n255\n"
    assert list(body) == [255, 50, 100, 0, 30, 100]  # north first; above 100 is unknown
    lines = dict(line.split(": ") for line in files["costmap.yaml"].decode().splitlines())
    assert lines["mode"] == "raw" and lines["negate"] == "0" and lines["image"] == "costmap.pgm"
    assert lines["origin"] == "[-1.5, 2.0, 0.0]" and lines["resolution"] == "0.5"


def test_other_bad_input_is_one_line(rover, estimator):
    case = read_case(rover)
    with pytest.raises(InputError, match=r"would have .* cells of 0.01 m"):
        soil_map(case, two_soils(), estimator, cell=0.01, reach=1000.0)
    for size in (0.0, 1e-9, 1e9, np.nan, np.inf):
        for sizes in ({"cell": size}, {"reach": size}):
            with pytest.raises(InputError, match=r"needed are 0.01 to 1000 m"):
                soil_map(case, two_soils(), estimator, **sizes)
    asked = []
    with pytest.raises(InputError, match="between 0 and 60 degrees"):
        soil_map(case, two_soils(), estimator, slopes=[1.66], progress=lambda *at: asked.append(at))
    assert not asked
    with pytest.raises(InputError, match="no cell of 100 m has its middle within 2 m"):
        soil_map(case, two_soils(60), estimator, cell=100.0)
    with pytest.raises(InputError, match="has no set posterior"):
        soil_map(case, two_soils(), Estimator.load("wheel_lssvm"))


def test_the_command_writes_its_folder(rover, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "drive.csv").write_text(csv_text(two_soils(60)))
    words = ["drive", "map", str(rover), "drive.csv", "--from", "wheel", "--cell", "2"]
    monkeypatch.setattr("soilml.soil_maps.field.DRAWS", 100)
    assert main([*words, "--slope", "0,10", "--out", "map"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("No sharp change of the soil was found") and "1 table more" in said
    names = {file.name for file in (tmp_path / "map").iterdir()}
    assert names == {"map.tif", "costmap.yaml", "costmap.pgm", "map.json", "map.png"}
    content = json.loads((tmp_path / "map/map.json").read_text())
    assert content["cells"] > 0 and len(content["stretches"]["station_m"]) >= 4
    for missing in (["none.toml"], [str(rover), "--from", "none.onnx"]):
        assert main(["drive", "map", missing[0], "drive.csv", *missing[1:]]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    text = (tmp_path / "drive.csv").read_text().replace("x_m", "east_m")
    (tmp_path / "drive.csv").write_text(text)
    assert main(words) == 2
    assert capsys.readouterr().err.count("\n") == 1
