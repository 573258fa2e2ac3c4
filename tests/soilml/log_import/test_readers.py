"""Text logs in the dialects of loggers, units and values with uncertainties."""

import numpy as np
import pytest

from soilml.errors import InputError, MissingLibraryError, SoilmlError
from soilml.log_import.readers import delimited_text, message_fields, read_log
from soilml.remarks import texts

PLAIN = "t,F,M\n0.0,1.5,-2\n0.1,1.6,-3\n0.2,,-4\n0.3,1.8,-5\n0.4,1.9,-6\n"
SEMICOLON = PLAIN.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    "data",
    [
        PLAIN.encode(),
        b"\xef\xbb\xbf" + PLAIN.encode(),
        PLAIN.encode("utf-16"),
        PLAIN.replace("\n", "\r\n").encode(),
        PLAIN.replace(",", "\t").encode(),
        SEMICOLON.encode("utf-16"),
        SEMICOLON.encode(),
        PLAIN.replace(",", ";").encode(),
        PLAIN.replace("0.2,,-4", "0.2,NaN,-4").encode(),
        PLAIN.replace("0.2,,-4", "0.2,#N/A,-4").replace(",", "  ").encode(),
        PLAIN.replace("0.2,,-4", '"0.2","","-4"').replace("t,F,M", '"t","F","M"').encode(),
        ("# rig 3\n# Datum 12.3.\n# t,F,M\n" + PLAIN.split("\n", 1)[1]).encode(),
        ("Größe: 3 µm\n\n" + PLAIN).encode("cp1252"),
        PLAIN.replace("\n", ",\n").encode(),
        ("sep=,\n" + PLAIN).encode(),
    ],
)
def test_dialects_of_text(tmp_path, data):
    (tmp_path / "log.csv").write_bytes(data)
    (recording,) = read_log(tmp_path / "log.csv")
    columns = {k: v for k, v in recording.columns.items() if np.isfinite(v).any()}
    assert list(columns) == ["t", "F", "M"]
    np.testing.assert_allclose(columns["t"], [0.0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(columns["F"], [1.5, 1.6, np.nan, 1.8, 1.9])
    np.testing.assert_allclose(columns["M"], [-2, -3, -4, -5, -6])


@pytest.mark.slow
def test_units_stand_in_brackets_or_in_a_row(tmp_path):
    rows = "\n".join(f"{i};{i};{i};{i}" for i in range(5))
    for header in ("Time [ms];Fz (N);omega, deg/s;n\n", "Time;Fz;omega;n\nms;N;deg/s;-\n"):
        (tmp_path / "log.txt").write_text(header + rows)
        (recording,) = read_log(tmp_path / "log.txt")
        assert list(recording.columns) == ["Time", "Fz", "omega", "n"]
        units = {k: v for k, v in recording.units.items() if v != "-"}
        assert units == {"Time": "ms", "Fz": "N", "omega": "deg/s"}


def test_broken_lines_are_left_out_and_counted(tmp_path):
    text = PLAIN.replace("0.3,1.8,-5", "0.3,1.8,-5,7,9") + "0.5\n"
    (tmp_path / "log.csv").write_text(text)
    (recording,) = read_log(tmp_path / "log.csv")
    assert len(recording) == 4
    assert texts(recording.notes) == ["2 lines have a wrong number of cells and are left out"]


def test_a_cell_that_is_endless(tmp_path):
    """In a header it is refused with its line, in a sample the line is left out."""
    endless = "a" * 200_000
    (tmp_path / "log.csv").write_text("# rig 3\n" + PLAIN.replace("F", endless))
    with pytest.raises(InputError, match=r"log\.csv line 2: field larger than field limit"):
        read_log(tmp_path / "log.csv")
    (tmp_path / "log.csv").write_text(f"{PLAIN}{endless},1,2\n".replace("1.5", '"1.5"'))
    (recording,) = read_log(tmp_path / "log.csv")
    assert len(recording) == 5 and "1 lines" in recording.notes[0].text


def test_a_log_without_header_numbers_its_columns(tmp_path):
    (tmp_path / "log.dat").write_text(PLAIN.split("\n", 1)[1])
    (recording,) = read_log(tmp_path / "log.dat")
    assert list(recording.columns) == ["column_1", "column_2", "column_3"]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"no numbers here\nat all\n", "no line of this file looks like samples"),
        ("a.bin", bytes(range(256)) * 20, "is not a text file"),
        ("a.xlsx", b"PK", "is no .xlsx file"),
        ("a.ods", b"PK", "save it as .xlsx and import that"),
        ("a.csv.gz", b"PK", "unpack it and import that"),
        ("a.tdms", b"TDSm", "save it as text"),
        ("a.json", b"[1, 2, 3]", "needed is a JSON object with numbers for each sample"),
        ("a.jsonl", b'{"t": 0}\nno\n', "needed is a JSON object with numbers for each sample"),
        ("a.h5", b"\x89HDF cut off", "is not a complete HDF5 file"),
        ("a.mat", b"MATLAB 5.0 MAT-file, cut off" + bytes(200), "is not a complete MATLAB file"),
        ("a.parquet", b"PAR1", "is not a complete Parquet file"),
        ("a.mcap", b"not mcap", "cannot be read as a bag"),
        ("a.bag", b"not a bag", "cannot be read as a bag"),
        ("a.db3", b"not a bag", "give its folder"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_line(tmp_path, name, content, words):
    if name in ("a.mcap", "a.bag"):
        pytest.importorskip("rosbags")
    if name == "a.h5":
        pytest.importorskip("h5py")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SoilmlError, match=words) as raised:
        read_log(tmp_path / name)
    assert str(tmp_path / name) in str(raised.value) and "\n" not in str(raised.value)
    with pytest.raises(InputError, match="there is no such file"):
        read_log(tmp_path / "absent.csv")


def test_bags_without_their_libraries_name_the_extra(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "rosbags", None)
    (tmp_path / "a.bag").write_bytes(b"")
    with pytest.raises(MissingLibraryError, match=r"pip install '\.\[logs\]'"):
        read_log(tmp_path / "a.bag")


@pytest.mark.parametrize(
    "cell",
    ["2_0.5", "\uff12\uff10\uff0e\uff15", "\uff120.5", "\u0968\u0966.\u096b", "0x14", "1e999"],
)
def test_a_cell_is_a_number_in_plain_digits_alone(tmp_path, cell):
    """Python's own `float` reads most of these."""
    (tmp_path / "log.csv").write_text(PLAIN.replace("1.6", cell).replace("-4", "1d1"), "utf-8")
    (recording,) = read_log(tmp_path / "log.csv")
    np.testing.assert_array_equal(recording.columns["F"], [1.5, np.nan, np.nan, 1.8, 1.9])
    assert recording.columns["M"][2] == 10.0


@pytest.mark.parametrize("mark", [".", ","])
def test_a_long_log_of_numbers_is_read_as_its_lines_are(mark, tmp_path):
    """A text at its end leaves it to the reader of lines, and the numbers are the same."""
    rng = np.random.default_rng(9)
    separator = "," if mark == "." else ";"
    rows = [
        separator.join([f"{t:.2f}", f" {v:.6e}", "NaN" if t % 7 == 0 else f"{v:.3f}"])
        for t, v in zip(np.arange(12000) / 4, rng.normal(size=12000), strict=True)
    ]  # fmt: skip
    lines = [separator.join(["t [s]", "Fz [N]", "T [Nm]"]), *rows]
    plain, odd = tmp_path / "plain.csv", tmp_path / "odd.csv"
    lines = [line.replace(".", mark) for line in lines]
    plain.write_text("\n".join(lines))
    odd.write_text("\n".join([*lines, separator.join(["stopped", "by", "hand"])]))
    (fast,), (slow,) = read_log(plain), read_log(odd)
    for name in ("t", "Fz", "T"):
        np.testing.assert_array_equal(fast.columns[name], slow.columns[name][:12000])
    assert fast.units == slow.units and [n.code for n in fast.notes] == [
        n.code for n in slow.notes if n.code != "lines-left-out"
    ]


def test_a_log_that_memory_has_no_room_for_is_thinned(tmp_path, monkeypatch):
    """Text and messages: evenly over the whole, and said."""
    for module in (delimited_text, message_fields):
        monkeypatch.setattr(module, "KEPT_VALUES", 12_000)
    t = np.arange(20_000) / 1000
    lines = ["t,run,v", *(f"{x:.3f},{'ab'[int(x > 10)]},{x * x:.4f}" for x in t)]
    lines[7000] += ",7"
    (tmp_path / "long.csv").write_text("\n".join(lines))
    seen = []
    (found,) = read_log(tmp_path / "long.csv", seen.append)
    every = round(20_000 / len(found))
    assert 4 <= every <= 8 and {"thinned", "lines-left-out"} == {n.code for n in found.notes}
    np.testing.assert_allclose(found.columns["v"], found.columns["t"] ** 2, atol=1e-3)
    assert set(found.texts["run"]) == {"a", "b"} and found.columns["t"][-1] > 19.9
    assert seen and seen[-1] == (tmp_path / "long.csv").stat().st_size
    topic = message_fields.TopicColumns(tmp_path)
    for x in t:
        topic.add(x, {"v": x * x})
        message_fields.thin_largest([topic])
    assert topic.size <= 12_000 and topic.notes("/v")
    np.testing.assert_allclose(topic.columns()["v"], topic.times() ** 2)
