"""Pages of benchmarks: one section is replaced, the others and the other pages stay."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "bench"))

import benchmarks_file  # noqa: E402
from benchmarks_file import (  # noqa: E402
    TITLES,
    page_file,
    sections,
    write_first_page,
    write_page,
)

ORDER = ["Speed", "Accuracy"]


@pytest.fixture
def pages(tmp_path, monkeypatch):
    """A folder with a page of two sections, and a first page that was measured on machine A."""
    monkeypatch.setattr(benchmarks_file, "machine", lambda: "machine A")
    write_page(
        "sets", ORDER, {"Accuracy": "1e-6\n\n### Detail\n\nfine", "Speed": "10 / s"}, tmp_path
    )
    write_page("board", ["Latency"], {"Latency": "60 us"}, tmp_path)
    write_first_page(["speed", "accuracy"], "| what | 1 |", tmp_path)
    monkeypatch.setattr(benchmarks_file, "machine", lambda: "machine B")
    return tmp_path


def test_sections_stand_in_their_order_and_one_is_replaced(pages):
    assert list(sections("sets", pages)) == ORDER
    before = page_file("board", pages).read_text()
    write_page("sets", ORDER, {"Speed": "20 / s"}, pages)
    assert sections("sets", pages) == {"Speed": "20 / s", "Accuracy": "1e-6\n\n### Detail\n\nfine"}
    assert page_file("board", pages).read_text() == before
    assert f"# {TITLES['sets']}\n\n**Machine.** machine B\n" in page_file("sets", pages).read_text()


def test_the_pages_of_the_repository_are_as_they_are_written(monkeypatch):
    """Each page has a title of `TITLES`, and the first one names its sections."""
    first = page_file("").read_text()
    for name, title in TITLES.items():
        assert page_file(name).read_text().startswith(f"# {title}\n\n**Machine.** ")
        assert f"| {'; '.join(sections(name))} |" in first
    assert {file.stem for file in page_file("sets").parent.glob("*.md")} == set(TITLES)
