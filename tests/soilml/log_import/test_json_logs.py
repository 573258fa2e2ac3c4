"""JSON logs in their three forms: lines, an array, an object of columns."""

import json

import numpy as np
import pytest

from soilml.log_import.readers import read_log
from soilml.remarks import texts

ROWS = [
    {"t": 0.1 * i, "wheel": {"omega": 0.2 + i, "current": [1.0, float(i)]}, "state": "RUN"}
    for i in range(5)
]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.jsonl", "\n".join(map(json.dumps, ROWS))),
        ("a.json", json.dumps(ROWS)),
    ],
)
def test_an_object_for_each_sample(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    (found,) = read_log(tmp_path / name)
    names = {"t", "wheel.omega", "wheel.current.0", "wheel.current.1"}
    assert {key.replace("[", ".").replace("]", "") for key in found.columns} == names
    np.testing.assert_allclose(found.columns["wheel.omega"], 0.2 + np.arange(5))
    assert found.texts == {"state": ["RUN"] * 5}


def test_an_object_of_columns(tmp_path):
    (tmp_path / "a.json").write_text('{"t": [0, 1, 2], "v": [3, null, 5], "name": "sand"}')
    (found,) = read_log(tmp_path / "a.json")
    np.testing.assert_array_equal(found.columns["t"], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(found.columns["v"], [3.0, np.nan, 5.0])


def test_lines_that_are_cut_off_are_counted(tmp_path):
    lines = [json.dumps(row) for row in ROWS]
    (tmp_path / "a.jsonl").write_text("\n".join([*lines, lines[0][:20]]))
    (found,) = read_log(tmp_path / "a.jsonl")
    assert len(found) == 5
    assert texts(found.notes) == ["1 lines are no JSON objects and are left out"]


def test_an_orientation_in_texts_has_no_angles(tmp_path):
    rows = [{"t": i, "q": dict.fromkeys("xyzw", "1_0")} for i in range(5)]
    (tmp_path / "a.json").write_text(json.dumps(rows))
    assert list(read_log(tmp_path / "a.json")[0].columns) == ["t"]


def test_stamps_of_headers_are_the_clock(tmp_path):
    """Messages come out of order; texts stay beside their numbers."""
    lines = [
        {"header": {"stamp": {"sec": 10 + s, "nanosec": 500000000}}, "v": s, "state": str(s)}
        for s in (0, 2, 1, 3)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, lines)))
    (found,) = read_log(tmp_path / "a.jsonl")
    np.testing.assert_allclose(found.clock, 10.5 + np.arange(4))
    np.testing.assert_array_equal(found.columns["v"], np.arange(4.0))
    assert found.texts["state"] == ["0", "1", "2", "3"]
    (tmp_path / "b.jsonl").write_text("\n".join(map(json.dumps, ROWS)))
    assert read_log(tmp_path / "b.jsonl")[0].clock is None
