"""What commands print, and what they refuse."""

import csv
import io
import re

from soilml.cli import main

#: A number with more digits than anybody reads; an SI unit in the name of a column, and one beside
#: a number or as a cell.
RAW = re.compile(r"\d\.\d{6,}")
SI_COLUMN = re.compile(r"_(Pa|rad|m)(?!_s)(?=[\s_]|$)")
SI_UNIT = re.compile(r"(?<=[\d.] )(Pa|rad)\b|  (Pa|rad)\b")


def check_tables(text):
    """Tables of at most 80 columns, with rounded numbers in usual units.

    A table is the lines about a line of dashes, and below it up to a blank line.
    """
    lines, found = text.splitlines(), []
    for i, line in enumerate(lines):
        if line and set(line) <= {"-", " "}:
            found.append(lines[i - 1])
            for row in lines[i:]:
                if not row or row.startswith("!"):
                    break
                found.append(row)
    assert found and not SI_COLUMN.search(found[0]), text
    for line in found:
        assert len(line) <= 80 and not RAW.search(line) and not SI_UNIT.search(line), line


def rows_of(text):
    """The rows of a CSV text as dictionaries."""
    return list(csv.DictReader(io.StringIO(text)))


def printed(words, capsys):
    """Output and error text of a command that succeeds."""
    capsys.readouterr()
    assert main([str(word) for word in words]) == 0, words
    return capsys.readouterr()


def rows_printed(words, capsys):
    """The rows that a command prints as CSV."""
    return rows_of(printed([*words, "--format", "csv"], capsys).out)


def refused(words, capsys, said, folder=None):
    """Expect status 2, one line that says `said` beside hints, and no change of files."""
    before = _contents(folder)
    capsys.readouterr()
    assert main([str(word) for word in words]) == 2, words
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if line.startswith("soilml")]
    assert len(lines) == 1 and said in lines[0], captured.err
    assert captured.out == ""
    assert _contents(folder) == before


def _contents(folder):
    files = sorted(folder.rglob("*")) if folder else []
    return {path: path.is_file() and path.read_bytes() for path in files}
