"""The gear of each row from the name of its run or file."""

import re

import numpy as np
import pytest
from foreign_rigs import drive, table

from soilml.errors import InputError
from soilml.log_import import import_log, init_map
from soilml.log_import.mapping.log_map import map_from


def logs_of_widths(folder):
    logs = []
    for width in (50, 70):
        d = drive(np.random.default_rng(width), (0.1, 0.4), [60] * 2)
        logs.append(folder / f"sand_b{width}_run1.csv")
        rows = table((d.t, d.omega, d.v, d.torque, d.load))
        logs[-1].write_text("\n".join(["t,omega,v,torque,Fz", *rows]))
    return logs


def test_gear_from_names_of_files(tmp_path):
    logs = logs_of_widths(tmp_path)
    text = init_map(logs).replace("# radius =", "gear_from = '(b\\d+)_'\nradius =")
    (tmp_path / "map.toml").write_text(text)
    found = import_log(logs, tmp_path / "map.toml").table
    assert {str(r): str(g) for r, g in zip(found["run"], found["gear"], strict=True)} == {
        "sand_b50_run1": "b50",
        "sand_b70_run1": "b70",
    }
    (tmp_path / "map.toml").write_text(text.replace("(b", "(zb"))
    with pytest.raises(InputError, match=r"gear_from .* finds nothing"):
        import_log(logs, tmp_path / "map.toml")


@pytest.mark.parametrize(
    ("wheel", "said"),
    [
        ({"gear_from": "(a)(b)"}, "at most one group"),
        ({"gear_from": "(a"}, "no regular expression"),
        ({"gear_from": "a", "gear": "b"}, "has gear and gear_from"),
    ],
)
def test_what_is_wrong_in_gear_from_is_said(wheel, said):
    with pytest.raises(InputError, match=said):
        map_from({"wheel": wheel, "slip": {"value": 0.1}, "load": {"value": 50}})


def logs_of_radii(folder, radii):
    """Logs of wheels that slip alike, whose radius in mm stands in the name of the file."""
    logs = []
    for size in radii:
        d = drive(np.random.default_rng(size), (0.1, 0.4), [60] * 2)
        omega = d.omega * 130 / size  # `drive` has a wheel of 130 mm
        logs.append(folder / f"sand_R{size}mm_1.csv")
        rows = table((d.t, omega, d.v, d.torque, d.load))
        logs[-1].write_text("\n".join(["t,omega,v,torque,Fz", *rows]))
    return logs


def map_of_radii(logs, radii):
    """The map of such logs, with the gear of each in its name."""
    text = init_map(logs).replace("# radius =", "gear_from = '_(R\\d+mm)_'\n# radius =")
    return text + "".join(f'\n[gears.R{r}mm]\nradius = "{r} mm +- 1 %"\n' for r in radii)


def test_wheels_of_different_radius_have_their_own_slip(tmp_path):
    logs = logs_of_radii(tmp_path, (100, 160))
    (tmp_path / "map.toml").write_text(map_of_radii(logs, (100, 160)))
    found = import_log(logs, tmp_path / "map.toml")
    rows = found.table
    radii = {"R100mm": 0.1, "R160mm": 0.16}
    assert {str(gear) for gear in rows["gear"]} == radii.keys()
    for gear, radius in radii.items():
        own = rows.where("gear", gear)
        assert set(own["wheel_radius_m"]) == {radius}
        np.testing.assert_allclose(own["slip"], (0.1, 0.4), atol=0.02)
    assert [series.run for series in found.series] == ["sand_R100mm_1", "sand_R160mm_1"]
    assert found.bias["slip"].constant > 0.004  # of a radius that is known to 1 %
    assert not found.implausible and np.isnan(found.radius)


def test_a_gear_without_a_radius_is_asked_for(tmp_path):
    logs = logs_of_radii(tmp_path, (100, 160))
    text = map_of_radii(logs, (100, 160))
    (tmp_path / "map.toml").write_text(text.replace("[gears.R160mm]", "[gears.R150mm]"))
    with pytest.raises(InputError, match=r"has the gear 'R160mm', and \[gears\] does not"):
        import_log(logs, tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text(re.sub(r"\n(radius|diameter) = .*", "", text))
    with pytest.raises(InputError, match="the radius is missing"):
        import_log(logs, tmp_path / "map.toml")


def test_rows_of_a_table_have_the_radius_of_their_gear(tmp_path):
    file = tmp_path / "runs.csv"
    stages = [(0.1, 50), (0.3, 60), (0.5, 70)]
    rows = [
        f"{gear} {i},{1 / radius / (1 - slip)},1,{load},1.5"
        for gear, radius in (("A", 0.1), ("B", 0.2))
        for i, (slip, load) in enumerate(stages)
    ]
    file.write_text("\n".join(["test,omega,v,Fz,T", *rows]))
    found = import_log(file, {
        "runs": {"each_row": True, "column": "test"}, "wheel": {"gear_from": "^([AB])"},
        "gears": {"a": {"radius": "0.1 m +- 1 %"}, "b": {"radius": "0.2 m"}},
        "wheel_speed": {"column": "omega", "unit": "rad/s"}, "load": {"column": "Fz", "unit": "N"},
        "ground_speed": {"column": "v", "unit": "m/s"}, "torque": {"column": "T", "unit": "N m"},
    }).table  # fmt: skip
    np.testing.assert_allclose(found["slip"], [0.1, 0.3, 0.5] * 2)
    assert found["gear"].tolist() == ["a"] * 3 + ["b"] * 3
    assert found["wheel_radius_m"].tolist() == [0.1] * 3 + [0.2] * 3
