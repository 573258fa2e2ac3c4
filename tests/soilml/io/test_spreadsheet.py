"""Tables and logs from sheets of spreadsheets."""

import datetime
import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from soilml.errors import InputError
from soilml.io import spreadsheet
from soilml.io.bounds import SHEET_BYTES, SHEET_CELLS
from soilml.io.read_table import read_table
from soilml.log_import.readers import read_log

openpyxl = pytest.importorskip("openpyxl")
RUNS = [["run", "slip", "load_N", "torque_Nm"], ["a", 0.1, 60, 2.5], ["a", 0.3, 60.5, None]]
LOG = [["t", "Fz", "T"], ["s", "N", "N m"], *[[i / 10, 60 + i, 2.5] for i in range(6)]]


def save(path, **sheets):
    """A workbook of sheets by name, each a list of rows or a function of the sheet."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, content in sheets.items():
        sheet = book.create_sheet(name)
        if callable(content):
            content(sheet)
        else:
            for row in content:
                sheet.append(row)
    book.save(path)
    return path


def refusal(path, read=read_table):
    with pytest.raises(InputError) as found:
        read(path)
    text = str(found.value)
    assert "\n" not in text and path.name.split("#")[0] in text
    return text


def test_a_table_of_runs_is_read_with_its_rows(tmp_path):
    file = save(tmp_path / "runs.xlsx", Sheet1=[[], *RUNS, []], Sheet2=[])
    table = read_table(file)
    assert table["run"].tolist() == ["a", "a"] and table["load_N"].tolist() == [60.0, 60.5]
    assert table["torque_Nm"][0] == 2.5 and np.isnan(table["torque_Nm"][1])
    assert table.line.tolist() == [3, 4]


def test_a_fault_has_its_row_and_column(tmp_path):
    file = save(tmp_path / "runs.xlsx", A=[*RUNS, ["b", "30 %", 60, 1.0]])
    assert "line 4, column slip: '30 %' is not a number" in refusal(file)


def test_one_of_several_sheets_is_named(tmp_path):
    file = save(tmp_path / "runs.xlsx", notes=[["tests of May"]], sand=RUNS, gravel=RUNS[:2])
    text = refusal(file)
    assert "3 sheets: 'notes', 'sand', 'gravel'" in text and "runs.xlsx#notes" in text
    assert len(read_table(f"{file}#gravel")) == 1
    assert len(read_table(f"{file}#Sand")) == 2
    text = refusal(tmp_path / "runs.xlsx#clay")
    assert "no sheet 'clay'; there are: 'notes', 'sand', 'gravel'" in text


def test_a_file_whose_name_has_a_hash_is_itself(tmp_path):
    file = tmp_path / "runs.xlsx#2"
    file.write_text("run,slip,load_N,torque_Nm\na,0.1,60,2\n")
    assert len(read_table(file)) == 1


def test_a_log_has_names_and_units_as_in_text(tmp_path):
    file = save(tmp_path / "log.xlsx", A=[["rig 3"], ["radius: 0.15 m"], *LOG])
    (recording,) = read_log(file)
    assert recording.units == {"t": "s", "Fz": "N", "T": "N m"}
    assert recording.columns["Fz"].tolist() == [60, 61, 62, 63, 64, 65]
    assert recording.about == ("rig 3", "radius: 0.15 m")


def test_dates_are_a_clock(tmp_path):
    start = datetime.datetime(2024, 5, 31, 12)
    times = [start + datetime.timedelta(seconds=i) for i in range(5)]
    file = save(tmp_path / "log.xlsx", A=[["time", "T [N m]"], *[[t, 1.5] for t in times]])
    (recording,) = read_log(file)
    assert np.diff(recording.columns["time"]).tolist() == [1.0] * 4
    elapsed = [[datetime.timedelta(hours=30, seconds=i), 1.5] for i in range(5)]
    (recording,) = read_log(save(tmp_path / "log.xlsx", A=[["time", "T [N m]"], *elapsed]))
    assert np.diff(recording.columns["time"]).tolist() == [1.0] * 4


def test_a_date_among_numbers_is_refused(tmp_path):
    rows = [*LOG, [0.6, datetime.datetime(2024, 4, 1), 2.5]]
    text = refusal(save(tmp_path / "log.xlsx", A=[["date", rows[2][0]], *rows]), read_log)
    assert "cell B10: a date among numbers" in text
    dated = [["date", datetime.datetime(2024, 4, 1)], *LOG]
    assert len(read_log(save(tmp_path / "log.xlsx", A=dated))[0]) == 6


def test_per_cent_of_the_cells_and_of_the_head(tmp_path):
    def fill(sheet):
        for row in [["T [N m]", "slip (%)", "share"], *[[i, i / 100, i / 100] for i in range(5)]]:
            sheet.append(row)
        for column in "BC":
            for cell in sheet[column][1:]:
                cell.number_format = "0.0%"

    (recording,) = read_log(save(tmp_path / "log.xlsx", A=fill))
    assert recording.columns["slip"].tolist() == [0, 1, 2, 3, 4]
    assert recording.columns["share"].tolist() == [0, 0.01, 0.02, 0.03, 0.04]


def merged(*ranges):
    def fill(sheet):
        sheet.append(["Tests of May"])
        sheet.append(["", "wheel", None, None])
        for row in LOG:
            sheet.append(row)
        for found in ranges:
            sheet.merge_cells(found)

    return fill


def test_a_merged_title_is_read_and_a_merged_head_refused(tmp_path):
    assert len(read_log(save(tmp_path / "log.xlsx", A=merged("A1:C1")))[0]) == 6
    text = refusal(save(tmp_path / "log.xlsx", A=merged("A1:C1", "B3:C3")), read_log)
    assert "the cells B3:C3 are merged" in text
    assert "A5:A7 are merged" in refusal(save(tmp_path / "log.xlsx", A=merged("A5:A7")), read_log)


def test_a_formula_counts_where_its_value_is_stored(tmp_path):
    file = save(tmp_path / "runs.xlsx", A=[*RUNS[:2], ["a", "=0.1*3", 60, 2.0]])
    assert "cell B3: a formula whose value is not in the file" in refusal(file)
    stored = tmp_path / "stored.xlsx"
    with zipfile.ZipFile(file) as old, zipfile.ZipFile(stored, "w") as new:
        for part in old.namelist():
            text = old.read(part)
            new.writestr(part, re.sub(rb"</f><v ?/?>(</v>)?", b"</f><v>0.3</v>", text))
    assert read_table(stored)["slip"].tolist() == [0.1, 0.3]


def test_an_error_of_a_formula_is_no_blank_cell(tmp_path):
    file = save(tmp_path / "runs.xlsx", A=[*RUNS[:2], ["a", "#DIV/0!", 60, 2.0]])
    rewritten(file, "sheet1.xml", lambda text: text.replace(b"<v>#", b"<f>1/0</f><v>#"))
    assert "line 3, column slip: '#DIV/0!' is not a number" in refusal(file)


def rewritten(file, part, change):
    """The file with one part changed."""
    old = file.with_name("old.xlsx")
    shutil.move(file, old)
    with zipfile.ZipFile(old) as read, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as write:
        for name in read.namelist():
            text = read.read(name)
            write.writestr(name, change(text) if name.endswith(part) else text)
    return file


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(spreadsheet, "SHEET_BYTES", replace(SHEET_BYTES, most=1 << 20))
    file = save(tmp_path / "runs.xlsx", A=RUNS)
    assert len(read_table(file)) == 2
    rewritten(file, "sheet1.xml", lambda text: text + b" " * (1 << 20))
    assert file.stat().st_size < 1 << 15
    assert "more than 1048576 bytes unpacked" in refusal(file)


def test_texts_that_cells_share_are_read(tmp_path):
    """Spreadsheet programs keep texts in a part of their own."""
    file = save(tmp_path / "runs.xlsx", A=RUNS)
    inline = re.compile(rb't="inlineStr"><is><t>([^<]*)</t></is>')
    texts = []

    def shared(text):
        texts.extend(inline.findall(text))
        number = iter(range(len(texts)))
        return inline.sub(lambda _: b't="s"><v>%d</v>' % next(number), text)

    rewritten(file, "sheet1.xml", shared)
    assert len(texts) == 6  # the header, and two names of runs
    kind = b"application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"
    entry = b'<Override PartName="/xl/sharedStrings.xml" ContentType="%s"/></Types>' % kind
    rewritten(file, "[Content_Types].xml", lambda text: text.replace(b"</Types>", entry))
    space = b"http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    items = b"".join(b"<si><t>%s</t></si>" % text for text in texts)
    with zipfile.ZipFile(file, "a") as book:
        book.writestr("xl/sharedStrings.xml", b'<sst xmlns="%s">%s</sst>' % (space, items))
    assert read_table(file)["run"].tolist() == ["a", "a"]


@pytest.mark.parametrize("far", ["XFD2", "B1048576"])
def test_a_far_cell_does_not_take_the_memory_of_a_sheet(tmp_path, monkeypatch, far):
    monkeypatch.setattr(spreadsheet, "SHEET_CELLS", replace(SHEET_CELLS, most=10_000))
    file = save(tmp_path / "runs.xlsx", A=lambda sheet: sheet.__setitem__(far, 1))
    assert "more than 10000 cells" in refusal(file)


def test_entities_do_not_grow(tmp_path):
    bomb = b'<?xml version="1.0"?><!DOCTYPE w [<!ENTITY a0 "aaaaaaaaaaaaaaaa">' + b"".join(
        b'<!ENTITY a%d "%s">' % (i, b"&a%d;" % (i - 1) * 16) for i in range(1, 9)
    )
    file = save(tmp_path / "runs.xlsx", A=RUNS)
    rewritten(file, "sheet1.xml", lambda text: bomb + b"]>" + text.replace(b">slip<", b">&a8;<"))
    assert "damaged" in refusal(file)


@pytest.mark.parametrize("content", [b"", b"\xd0\xcf\x11\xe0 of the older kind", b"a,b\n1,2\n"])
def test_what_is_no_spreadsheet_is_refused(tmp_path, content):
    file = tmp_path / "runs.xlsx"
    file.write_bytes(content)
    assert "is no .xlsx file" in refusal(file)


@pytest.mark.parametrize("part", ["workbook.xml", "sheet1.xml"])
def test_a_damaged_part_is_refused(tmp_path, part):
    file = rewritten(
        save(tmp_path / "runs.xlsx", A=RUNS), part, lambda text: text[: len(text) // 2]
    )
    assert "damaged" in refusal(file)


def test_an_empty_book_is_refused(tmp_path):
    assert "empty" in refusal(save(tmp_path / "runs.xlsx", A=[]))
    assert "no sheet with cells" in refusal(save(tmp_path / "runs.xlsx", A=[], B=[]))
