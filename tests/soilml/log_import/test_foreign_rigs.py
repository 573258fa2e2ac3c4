"""Logs of rigs that the guesses were not made for: what comes out is the truth."""

import numpy as np
import pytest
from foreign_rigs import RADIUS_EDIT, WRITERS, drive, law, nearest_stage, table

from soilml.log_import import import_log, init_map
from soilml.log_import.readers import read_log

#: Error of the zero of a sinkage: the wheel had sunk in before it started.
SUNK = 0.0045


def imported(folder, logs, edits):
    text = init_map(logs)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text, encoding="utf-8")
    return import_log(logs, folder / "map.toml"), text


@pytest.mark.slow
@pytest.mark.parametrize("writer", WRITERS, ids=lambda w: w.__name__)
def test_a_guessed_map_with_few_edits_gives_the_truth(writer, tmp_path):
    logs, edits, stages = writer(np.random.default_rng(7), tmp_path)
    found, text = imported(tmp_path, logs, edits)
    rows = found.table
    zero = 2.0 if writer.__name__ == "pounds_and_a_lifted_end" else 0.0
    met = set()
    for i in range(len(rows)):
        slip, load = nearest_stage(stages, rows["slip"][i], rows["load_N"][i])
        met.add((slip, load))
        torque, pull, sinkage = law(slip, load)
        assert rows["slip"][i] == pytest.approx(slip, abs=0.012)
        assert rows["load_N"][i] == pytest.approx(load + zero, rel=0.04)
        assert rows["torque_Nm"][i] == pytest.approx(torque, rel=0.05)
        if "drawbar_pull_N" in rows:
            assert rows["drawbar_pull_N"][i] == pytest.approx(pull, abs=0.8)
        if "sinkage_m" in rows:
            tared = "the wheel stands on the ground" in text
            assert rows["sinkage_m"][i] == pytest.approx(sinkage, abs=SUNK if tared else 2e-4)
    assert met == set(stages)
    assert any(remark.code == "wheel-lifted" for remark in found.remarks) == (zero > 0.0)


def test_runs_are_named_by_the_line_above_their_header(tmp_path):
    logs, _, _ = WRITERS[0](np.random.default_rng(7), tmp_path)
    (recording,) = read_log(logs[0])
    assert list(dict.fromkeys(recording.texts["block"])) == [
        f"Run with {n} N" for n in (40, 55, 75)
    ]
    assert any("the header stands 3 times" in note.text for note in recording.notes)
    # lines that stand alone are no header, and a file with one header is one run
    lines = logs[0].read_text(encoding="utf-8-sig").splitlines()[1:900]
    (tmp_path / "one.tsv").write_text("\n".join([*lines[:300], "stopped by hand", *lines[300:]]))
    (one,) = read_log(tmp_path / "one.tsv")
    assert not one.texts and len(one) == len(lines) - 1


def test_files_that_number_their_runs_alike_keep_them_apart(tmp_path):
    logs = []
    for k, load in enumerate((40, 60)):
        d = drive(np.random.default_rng(k), (0.1, 0.4), [load] * 2)
        lines = ["trial,t,omega,v,torque,Fz"]
        for trial in (1, 2):
            lines += table((np.full(d.t.size, trial), d.t, d.omega, d.v, d.torque, d.load))
        logs.append(tmp_path / f"day{k}.csv")
        logs[-1].write_text("\n".join(lines))
    found, _ = imported(tmp_path, logs, [RADIUS_EDIT])
    assert set(found.table["run"]) == {"day0_1", "day0_2", "day1_1", "day1_2"}


def test_a_column_of_text_is_named_in_the_map(tmp_path):
    """A column that is not read as numbers does not vanish from sight."""
    d = drive(np.random.default_rng(3), (0.1, 0.4), [60] * 2)
    rows = table((d.t, d.omega, d.v, d.load))
    lines = ["t,omega,v,Fz,torque", *(f"{row},{x:.2f} Nm approx" for row, x in
                                      zip(rows, d.torque, strict=True))]  # fmt: skip
    (tmp_path / "log.csv").write_text("\n".join(lines))
    assert "torque: text, such as '0.00 Nm approx'" in init_map(tmp_path / "log.csv")
