"""The language of the pages: sentences of bounded length."""

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
    if page not in CARDS and page.name != "CHANGELOG.md" and "decisions" not in page.parts
)
MOST_WORDS = 30


def name_of(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_sentences_are_short(page):
    found = [s for s in sentences(page.read_text()) if s.words > MOST_WORDS]
    assert not found, "\n".join(f"{name_of(page)}:{s.line}: {s.words}: {s.text}" for s in found)


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
