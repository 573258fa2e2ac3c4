"""What README and docs show works as shown, and every link leads somewhere."""

import re
from pathlib import Path

import pytest

from soilml import read_case
from soilml.cli import main

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/**/*.md", "exported/*.md", "examples/*/*.md")
    for page in ROOT.glob(pattern)
)
#: pages whose Python blocks are run
RUN = (
    "docs/concepts/sets.md",
    "docs/how-to/judge-a-model.md",
    "docs/how-to/train.md",
    "exported/README.md",
)


def blocks(page, language):
    text = (ROOT / page).read_text()
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


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


def test_the_analyses_of_the_first_page_find_the_hidden_effect(monkeypatch):
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(blocks("docs/index.md", "python")[0], names)
    assert names["fit"].names == ("cohesion", "friction_angle", "shear_modulus")
    assert any(remark.code == "excess-residuals" for remark in names["fit"].warnings)
    assert names["fit"].explanations[0].effects == ("slip-sinkage",)
    assert names["report"].status == "named"
    assert names["report"].cause_set == (("slip-sinkage",),)


def test_the_model_file_is_valid(tmp_path):
    (tmp_path / "model.toml").write_text(blocks("docs/reference/model-file.md", "toml")[0])
    case = read_case(tmp_path / "model.toml")
    assert case.soil.friction_angle == 0.60
    assert set(case.prior) == {"cohesion", "friction_angle", "shear_modulus", "slip-sinkage.n1"}


@pytest.mark.long
def test_the_recipe_and_the_spec_can_be_generated_and_trained(tmp_path, monkeypatch):
    model = blocks("docs/reference/model-file.md", "toml")[0]
    extra, worlds, spec = blocks("docs/reference/model-file.md", "toml")[-3:]
    (tmp_path / "recipe.toml").write_text(f"rows = 60000\nseed = 1\n{model}{extra}{worlds}")
    (tmp_path / "spec.toml").write_text(spec)
    monkeypatch.chdir(tmp_path)
    assert main(["generate", "recipe.toml", "data.parquet", "--rows", "3000"]) == 0
    assert main(["train", "spec.toml", "data.parquet", "model.onnx"]) == 0


@pytest.mark.long
def test_the_answer_of_a_design_is_what_the_command_prints(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(ROOT)
    page = (ROOT / "docs/how-to/choose-wheels.md").read_text()
    command = re.findall(r"```\nsoilml (plan wheels .*)\n```", page)[1].split()
    assert main([*command, "--out", str(tmp_path / "design.json")]) == 0
    verdict = capsys.readouterr().out.splitlines()[0]
    (printed,) = blocks("docs/how-to/choose-wheels.md", "text")[1].splitlines()
    # searches and quantiles may differ by rounding between processors
    shown, expected = (re.findall(r"-?\d+(?:\.\d+)?", line) for line in (verdict, printed))
    assert [float(x) for x in shown] == pytest.approx([float(x) for x in expected], rel=0.1)


def test_links_lead_to_files_and_named_files_exist(subtests):
    named = r"`((?:soilml|datagen|training|tests|bench|tools|docs|examples|exported)/[\w/.]+)`"
    for page in PAGES:
        text = page.read_text()
        targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text)
        files = [page.parent / t for t in targets if not t.startswith(("http://", "https://"))]
        with subtests.test(str(page.relative_to(ROOT))):
            assert not [f for f in files if not f.exists()]
            assert not [path for path in re.findall(named, text) if not (ROOT / path).exists()]
