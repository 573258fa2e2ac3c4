"""The language of the pages: sentences of bounded length, and standard terms."""

import re
from pathlib import Path

import pytest
from prose import sentences

ROOT = Path(__file__).parents[2]
#: Written by the training of a file, in its own words.
CARDS = set((ROOT / "exported").glob("*.md")) - {ROOT / "exported/README.md"}
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/**/*.md", "exported/*.md", "examples/*/*.md")
    for page in ROOT.glob(pattern)
    if page not in CARDS
)
MOST_WORDS = 40
#: Words that stand for a standard term, and the term.
HOUSE_WORDS = {
    r"\btold\b": "identified, determined, detected or reported",
    r"\bas usual\b": "with typical model and sensor errors",
    r"\bdriven alike\b|\bnearly alike\b": "replicates",
    r"\bfuller\b": "more complete",
    r"\bmended\b": "fixed",
    r"\b(hold|holds|held|contains?) the truth\b|% (hold|holds|held)\b": "coverage",
    r"\bintervals? (\w+ ){0,4}(hold|holds|held)\b": "coverage",
    r"\bmemory of a (stream|set)\b|\b[Aa] memory\b": "state",
    r"\b[Bb]elieve\b": "use",
}


def name_of(page):
    return str(page.relative_to(ROOT))


def house_words(text):
    """Each house word of a text, with the term that it stands for."""
    return [
        f"{m[0]!r}: {term}" for word, term in HOUSE_WORDS.items() for m in re.finditer(word, text)
    ]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_sentences_are_short(page):
    found = [s for s in sentences(page.read_text()) if s.words > MOST_WORDS]
    assert not found, "\n".join(f"{name_of(page)}:{s.line}: {s.words}: {s.text}" for s in found)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_terms_are_those_of_the_field(page):
    text = re.sub(r"```.*?```|`[^`\n]*`|\]\([^)]*\)", "X", page.read_text(), flags=re.DOTALL)
    assert house_words(text) == []


def test_few_sentences_are_long():
    every = [s for page in PAGES for s in sentences(page.read_text())]
    assert len(every) > 2000
    assert sum(s.words > 30 for s in every) < 0.02 * len(every)


def test_the_readme_has_few_links():
    assert len(re.findall(r"\]\(", (ROOT / "README.md").read_text())) <= 25
