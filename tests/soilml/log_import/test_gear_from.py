"""The gear of each row from the name of its run or file."""

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
    text = init_map(logs)
    assert "# gear_from = '" in text and "the names say b50, b70" in text
    text = text.replace("# gear_from", "gear_from").replace("# radius =", "radius =")
    (tmp_path / "map.toml").write_text(text)
    found = import_log(logs, tmp_path / "map.toml").table
    assert {str(r): str(g) for r, g in zip(found["run"], found["gear"], strict=True)} == {
        "sand_b50_run1": "b50",
        "sand_b70_run1": "b70",
    }
    (tmp_path / "map.toml").write_text(text.replace("(?i)", "z"))
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
