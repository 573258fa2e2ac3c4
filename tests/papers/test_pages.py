"""The pages on the source papers link to what is there, and their model files are valid."""

import re
from pathlib import Path

import pytest

from soilml import Operating, read_case

PAGES = sorted((Path(__file__).parents[2] / "docs/papers").glob("*.md"))
MODELS = [
    block
    for page in PAGES
    for block in re.findall(r"```toml\n(.*?)```", page.read_text(), flags=re.DOTALL)
    if "[gear]" in block
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_pictures_are_there(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("block", MODELS, ids=lambda block: block.split('"')[1])
def test_a_model_file_of_a_page_carries_a_load(block, tmp_path):
    (tmp_path / "model.toml").write_text(block)
    case = read_case(tmp_path / "model.toml")
    assert case.model(case.soil, Operating(slip=0.2, load=12.0)).torque > 0
