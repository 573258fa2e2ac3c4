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


PAGE = """---
kernelspec: none
---
# A heading that is not counted, whatever its length may be

One two three. Four `code. With. Points.` five; see eq. 4 of Wong et al. 1989
([a link](page.md)). *Six* seven eight.

| a table | is skipped |
- An item
  of two lines.
1. Another item. It ends.

```
code is skipped. All of it.
```

    indented code is skipped
"""


def test_sentences_are_read_from_paragraphs_and_items():
    found = [(s.line, s.words) for s in sentences(PAGE)]
    assert found == [(6, 3), (6, 13), (6, 3), (10, 5), (12, 2), (12, 2)]


def test_the_readme_has_few_links():
    assert len(re.findall(r"\]\(", (ROOT / "README.md").read_text())) <= 25


def test_house_words_are_found():
    assert house_words("their 90 % intervals often hold, as usual") != []
    assert len(house_words("Each parameter is told; a fault is mended.")) == 2
    assert house_words("A file holds one subject.") == []
