"""The sources of the documentation site, without Sphinx: tree, tutorials, messages, symbols."""

import ast
import re
import shlex
import sys
from pathlib import Path

import notebooks
import numpy as np
import pytest

import soilml
from soilml.cli import main
from soilml.cli.main import COMMANDS, parser

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs/site"))

import command_listing  # noqa: E402
import error_listing  # noqa: E402
import page_tree  # noqa: E402

PAGES = [
    page
    for pattern in ("CHANGELOG.md", "docs/**/*.md", "exported/*.md", "examples/*/README.md")
    for page in ROOT.glob(pattern)
    if "decisions" not in page.parts
]
NOTEBOOKS = sorted(page for page in PAGES if page.read_text().startswith("---\nkernelspec"))


def named_in_trees():
    """Pages in the tree of the first page, as paths; some folders have all their pages in one."""
    index = ROOT / "docs/index.md"
    trees = re.findall(r"```\{toctree\}\n(.*?)```", index.read_text(), flags=re.DOTALL)
    named = re.findall(r"^[\w./-]+$", "\n".join(trees), flags=re.MULTILINE)
    found = {index, *((index.parent / f"{name}.md").resolve() for name in named)}
    for first in page_tree.FOLDERS:
        found |= set((ROOT / first).parent.glob("*.md"))
    return found


def test_every_page_is_in_the_tree_and_every_entry_is_a_page():
    assert named_in_trees() == set(PAGES)


@pytest.mark.parametrize("page", NOTEBOOKS, ids=lambda page: page.stem)
def test_notebooks_have_cells_that_parse_and_commands_that_exist(page):
    assert notebooks.cells(page)
    for cell in notebooks.cells(page):
        ast.parse(notebooks.COMMAND.sub("pass", cell))
    for line in notebooks.commands(page):
        program, *words = shlex.split(line)
        assert program == "soilml", line
        parser(words).parse_args(words)


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder with the files of the repository that pages use, in which they run."""
    for folder in ("examples", "exported"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    return tmp_path


@pytest.mark.slow
def test_a_wrong_bearing_moves_the_estimate_and_a_prior_of_it_does_not(clone, capsys):
    notebooks.run(ROOT / "docs/how-to/priors-and-noise.md")
    moved = [
        max(abs(float(one)) for one in re.findall(r"([+-][\d.]+) std off", line))
        for line in capsys.readouterr().out.splitlines()
    ]
    right, wrong, prior, with_sinkage, second_answer = moved
    assert wrong > 3.0 > max(right, prior, with_sinkage, second_answer)


@pytest.mark.slow
def test_the_tutorial_of_the_board_tells_what_happened(clone):
    names = notebooks.run(ROOT / "docs/tutorials/board.md")
    truth = np.degrees([0.62, 0.50])
    assert abs(names["phi"][[59, -1]] - truth).max() < 3 * names["width"][[59, -1]].max()
    assert not names["in_mm"].in_range
    assert (clone / "demo/tutorials/board/wheel.c").exists()


@pytest.mark.slow
def test_the_effect_of_the_page_is_neutral_by_default_and_acts(clone, capsys):
    notebooks.run(ROOT / "docs/how-to/effects.md")
    assert "neutral: True" in capsys.readouterr().out
    model = (ROOT / "examples/wheel/model.toml").read_text()
    torque = {}
    for share in ("0.0", "0.02"):
        effect = f'[[effect]]\nname = "cable-torque"\nshare = {share}\n'
        Path("model.toml").write_text(model + effect)
        command = ["simulate", "model.toml", "--slip", "0.3", "--load", "60"]
        assert main([*command, "--effects", "mine.py", "--format", "csv"]) == 0
        row, reading = capsys.readouterr().out.splitlines()[:2]
        torque[share] = float(reading.split(",")[row.split(",").index("torque_Nm")])
    assert main(command) == 2
    assert "cable-torque" in capsys.readouterr().err
    assert torque["0.02"] - torque["0.0"] == pytest.approx(0.02 * 0.15 * 60)


def test_every_command_has_its_help_on_the_page():
    assert command_listing.MARK in (ROOT / f"{command_listing.PAGE}.md").read_text()
    texts = command_listing.helps()
    assert set(texts) == set(COMMANDS)
    assert all(text.startswith(f"usage: soilml {name} ") for name, text in texts.items())


def test_every_message_belongs_to_one_group_of_the_page():
    found = list(error_listing.messages())
    assert len(found) > 400
    assert error_listing.faults(error_listing.PAGE.read_text(), found) == []


def test_every_public_name_is_in_the_reference():
    pages = (ROOT / "docs/reference/api.md").read_text()
    modules = re.findall(r"automodule:: (\S+)", pages)
    named = set(re.findall(r"(?:autoclass|autofunction):: \S+\.(\w+)", pages))
    for module in modules:
        imported = __import__(module, fromlist=["__all__"])
        named |= set(getattr(imported, "__all__", vars(imported)))
    values = {"__version__", "EFFECTS", "GEARS", "METHODS"}
    assert set(soilml.__all__) - values <= named
