"""What commands print, and what they refuse."""

import csv
import io

from soilml.cli import main


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
