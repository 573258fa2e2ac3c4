"""Blocks of pages are what their commands print."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import page_probes  # noqa: E402
import pages  # noqa: E402


def test_a_stale_page_is_told_and_written(tmp_path, capsys):
    page = tmp_path / "page.md"
    command = "python -c \"print('Rates: 7')\""
    page.write_text(f"<!-- output: {command} | Rates -->\nRates: 5\n<!-- end of output -->\n")
    assert pages.run(["--check", str(page)]) == 1
    assert "stale" in capsys.readouterr().out
    assert pages.run([str(page)]) == 0
    assert "Rates: 7" in page.read_text()
    assert pages.run(["--check", str(page)]) == 0


def commands():
    """Commands of the blocks of all pages; one for each script that has a small run."""
    found = [command for page in pages.pages() for command in pages.commands_of(page)]
    scripts = {page_probes.script_of(command): command for command in found}
    small = {command for script, command in scripts.items() if script in page_probes.PROBES}
    return [c for c in dict.fromkeys(found) if c in small or not pages.has_small_run(c)]


def test_each_small_run_is_of_a_script_of_a_page_and_is_recorded():
    scripts = {page_probes.script_of(command) for command in commands()}
    assert set(page_probes.PROBES) <= scripts
    records = {page_probes.record(script) for script in page_probes.PROBES}
    assert set(page_probes.RECORDS.iterdir()) == records


#: Commands that compute for half a minute; tests/papers compute each number of the first.
LONG = (
    "python -m soilml paper numbers",
    "python -m soilml pull examples/rover/rover.toml examples/rover/runs.csv --out build/rover.csv",
    "python examples/map/compare.py",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [pytest.param(c, marks=[pytest.mark.long] if c in LONG else []) for c in commands()],
)
def test_no_page_is_stale(command):
    """`python tools/pages.py PAGE` runs the whole command, and writes block and record."""
    assert pages.is_fresh(command), f"run again, with its page: {command}"
