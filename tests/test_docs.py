"""What README and docs show works as shown, and every link leads somewhere."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest

from soilml import read_case, read_table
from soilml.cli import main
from soilml.cli.main import COMMANDS, GROUPS
from soilml.io.read_table import RUNS
from soilml.log_import import read_map

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/**/*.md", "exported/*.md", "examples/*/*.md")
    for page in ROOT.glob(pattern)
)
#: pages beside README whose Python blocks are run; docs/physics.md ends with a user's effect
RUN = (
    "docs/physics.md",
    "docs/sets.md",
    "docs/driving.md",
    "docs/advice.md",
    "docs/import.md",
    "docs/pull.md",
    "docs/reports.md",
    "docs/papers/slip_models.md",
    "docs/start/board.md",
    "docs/start/research.md",
    "docs/how-to/choose-wheels.md",
    "docs/how-to/map.md",
    "exported/README.md",
)


def blocks(page, language):
    text = (ROOT / page).read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


def name_of(page):
    return str(page.relative_to(ROOT))


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_python_blocks_run(page, monkeypatch, tmp_path):
    """In a folder that has the repository's examples, and the table that the page shows."""
    for folder in ("examples", "exported"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    for table in blocks(page, "csv"):
        (tmp_path / "runs.csv").write_text(table)
    monkeypatch.chdir(tmp_path)
    assert blocks(page, "python")
    for block in blocks(page, "python"):
        exec(block, {"__name__": "documented"})


def test_the_estimates_of_the_readme_are_answered(monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict = {}
    _, board = blocks("README.md", "python")
    exec(board, names)
    assert names["one"].mean.shape == names["all_"].mean.shape == (3,)
    assert bool(names["one"].in_range) and bool(names["all_"].in_range)


def test_the_analyses_of_the_readme_find_the_hidden_effect(monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(blocks("README.md", "python")[0], names)
    assert names["fit"].names == ("cohesion", "friction_angle", "shear_modulus")
    exact = names["fit"].exact_model
    assert any(remark.code == "excess-residuals" for remark in exact.warnings)
    assert names["fit"].explanations[0].effect == "slip-sinkage"
    assert names["report"].status == "named"
    assert names["report"].cause_set == (("slip-sinkage",),)


def test_the_model_file_is_valid(tmp_path):
    (tmp_path / "model.toml").write_text(blocks("docs/model-file.md", "toml")[0])
    case = read_case(tmp_path / "model.toml")
    assert case.soil.friction_angle == 0.60
    assert set(case.prior) == {"cohesion", "friction_angle", "shear_modulus", "slip-sinkage.n1"}


@pytest.mark.long
def test_the_recipe_and_the_spec_can_be_generated_and_trained(tmp_path, monkeypatch):
    model = blocks("docs/model-file.md", "toml")[0]
    extra, worlds, spec = blocks("docs/recipes-and-specs.md", "toml")
    (tmp_path / "recipe.toml").write_text(f"rows = 60000\nseed = 1\n{model}{extra}{worlds}")
    (tmp_path / "spec.toml").write_text(spec)
    monkeypatch.chdir(tmp_path)
    assert main(["generate", "recipe.toml", "data.parquet", "--rows", "3000"]) == 0
    assert main(["train", "spec.toml", "data.parquet", "model.onnx"]) == 0


def test_the_recipe_of_my_wheel_is_valid(tmp_path):
    from datagen.recipe import read_recipe

    (tmp_path / "recipe.toml").write_text(blocks("docs/how-to/train-my-wheel.md", "toml")[0])
    recipe = read_recipe(tmp_path / "recipe.toml")
    assert recipe.rows == 60000


def test_the_prior_of_bearing_is_valid(tmp_path):
    model = blocks("docs/model-file.md", "toml")[0]
    (bearing,) = blocks("docs/how-to/priors-for-bearing.md", "toml")
    inside = bearing.removeprefix("[soil.prior]\n")
    (tmp_path / "model.toml").write_text(model.replace("[soil.prior]", "[soil.prior]\n" + inside))
    assert {"kphi", "n"} < set(read_case(tmp_path / "model.toml").prior)


def test_the_map_of_a_log_is_valid(tmp_path):
    (tmp_path / "map.toml").write_text(blocks("docs/import.md", "toml")[0])
    (wheel,) = read_map(tmp_path / "map.toml").wheels
    assert wheel.channels["motor_current"].torque_constant.relative == pytest.approx(0.03)
    assert len(wheel.channels) == 6


def test_the_table_of_runs_is_valid(tmp_path):
    (tmp_path / "runs.csv").write_text(blocks("docs/runs.md", "csv")[0])
    table = read_table(tmp_path / "runs.csv", RUNS)
    assert np.isnan(table["drawbar_pull_N"]).all()


def test_an_effect_of_ones_own_pulls_back(tmp_path, capsys):
    *_, effect = blocks("docs/physics.md", "python")
    (tmp_path / "mine.py").write_text(effect)
    model = blocks("docs/model-file.md", "toml")[0]
    (tmp_path / "model.toml").write_text(f'{model}[[effect]]\nname = "cable-drag"\nforce = 2.0\n')
    command = ["simulate", str(tmp_path / "model.toml"), "--slip", "0.3", "--load", "60"]
    assert main(command) == 2
    assert "cable-drag" in capsys.readouterr().err
    assert main([*command, "--effects", str(tmp_path / "mine.py")]) == 0
    with_drag = float(capsys.readouterr().out.splitlines()[1].split(",")[3])
    (tmp_path / "model.toml").write_text(model)
    assert main(command) == 0
    without = float(capsys.readouterr().out.splitlines()[1].split(",")[3])
    assert without - with_drag == pytest.approx(2.0)


def test_the_question_of_a_design_is_that_of_the_example():
    (toml,) = blocks("docs/how-to/choose-wheels.md", "toml")
    example = (ROOT / "examples/design/rover.toml").read_text()
    assert toml == "".join(line for line in example.splitlines(keepends=True)[1:])


@pytest.mark.long
def test_the_answer_of_a_design_is_what_the_command_prints(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(ROOT)
    page = (ROOT / "docs/how-to/choose-wheels.md").read_text()
    command = re.findall(r"```\nsoilml (design .*)\n```", page)[1].split()
    assert main([*command, "--out", str(tmp_path / "design.json")]) == 0
    verdict = capsys.readouterr().out.splitlines()[0]
    (printed,) = blocks("docs/how-to/choose-wheels.md", "text")[1].splitlines()
    # searches and quantiles may differ by rounding between processors
    shown, expected = (re.findall(r"-?\d+(?:\.\d+)?", line) for line in (verdict, printed))
    assert [float(x) for x in shown] == pytest.approx([float(x) for x in expected], rel=0.1)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_on_the_page(command):
    two = [
        f"{group} {word}" for group, own in GROUPS.items() for word in own if own[word] == command
    ]
    page = (ROOT / "docs/command-line.md").read_text()
    assert any(f"\nsoilml {name} " in page for name in (command, *two))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_to_files(page):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists(), f"{name_of(page)} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_named_files_exist(page):
    named = r"`((?:soilml|datagen|training|tests|bench|tools|docs|examples|exported)/[\w/.]+)`"
    for path in re.findall(named, page.read_text()):
        assert (ROOT / path).exists(), f"{name_of(page)} names {path}"


@pytest.mark.parametrize("page", [p for p in PAGES if p.name != "CHANGELOG.md"], ids=name_of)
def test_named_modules_exist(page):
    named = r"`((?:soilml|datagen|training)(?:\.[a-z_]\w*)+)"
    for path in set(re.findall(named, page.read_text())):
        parent, _, last = path.rpartition(".")
        try:
            importlib.import_module(path)
        except ModuleNotFoundError:
            owner = importlib.import_module(parent)
            assert hasattr(owner, last), f"{name_of(page)} names {path}"
