"""Blocks of pages are what their commands print."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import page_probes  # noqa: E402
import pages  # noqa: E402

OUTPUT = "Title\n\nRates by soil, %\n\n soil  rate\n ----  ----\n sand  12.3\n\nEnd\n"
PAGE = "Text.\n\n<!-- output: python x.py | Rates | 2 -->\nold\n<!-- end of output -->\n\nMore.\n"


def test_a_block_becomes_the_paragraphs_that_its_command_prints():
    written = pages.with_blocks(PAGE, {"python x.py": OUTPUT}.__getitem__)
    assert "```text\nRates by soil, %\n\n soil  rate\n ----  ----\n sand  12.3\n```" in written
    assert written.startswith("Text.\n\n<!-- output: python x.py | Rates | 2 -->\n")
    assert written.endswith("<!-- end of output -->\n\nMore.\n")
    assert pages.with_blocks(written, {"python x.py": OUTPUT}.__getitem__) == written


def test_a_stale_page_is_told_and_written(tmp_path, capsys):
    page = tmp_path / "page.md"
    command = "python -c \"print('Rates: 7')\""
    page.write_text(f"<!-- output: {command} | Rates -->\nRates: 5\n<!-- end of output -->\n")
    assert pages.run(["--check", str(page)]) == 1
    assert "stale" in capsys.readouterr().out
    assert pages.run([str(page)]) == 0
    assert "Rates: 7" in page.read_text()
    assert pages.run(["--check", str(page)]) == 0


SCRIPT = """\
G = 9.81
COUNT = 1000


def weight(mass):
    return mass * G


def run():
    print(f"weight of {COUNT} kg: {weight(COUNT):.1f} N")
"""


def smaller(script):
    script.COUNT = 2


def ran_small(path, text, capsys):
    path.write_text(text)
    page_probes.run_small(path, smaller)
    return capsys.readouterr().out


def test_a_small_run_tells_another_number_and_no_new_arrangement(tmp_path, capsys):
    path = tmp_path / "script.py"
    kept = ran_small(path, SCRIPT, capsys)
    assert kept == "weight of 2 kg: 19.6 N\n"
    arranged = SCRIPT.replace("mass * G", "G * (mass + mass) / 2.0").replace("weight(", "force(")
    assert pages.agree(kept, ran_small(path, arranged, capsys))
    assert not pages.agree(kept, ran_small(path, SCRIPT.replace("9.81", "1.62"), capsys))


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
