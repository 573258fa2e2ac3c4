"""The language of the pages: sentences of bounded length."""

import ast
import re
from pathlib import Path

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
#: Words of this house in the place of the field's: what a reader of English has to guess.
HOUSE_WORDS = re.compile(
    r"\b(takes?|taken|took) (the |its )?(model|sensors?|stress) as\b"
    r"|\btak(es?|en) as (right|given)\b|\btells? of\b|\btold by\b|\b(leaves?|left) open\b"
    r"|\bspeaks? against\b|\bas usual\b"
    r"|\b(files?|states?|rows?|model|fit|batch) (does not |do not )?carr(y|ies)\b(?! the load)"
    r"|\b(does not|do not) hold\b",
    re.IGNORECASE,
)
#: Texts that trained files have in their cards, which a training writes.
WRITTEN = ("training/export/model_card.py",)


def name_of(page):
    return str(page.relative_to(ROOT))


def test_sentences_are_short_and_in_the_words_of_the_field():
    found = [
        f"{name_of(page)}:{s.line}: {s.words} words: {s.text}"
        for page in PAGES
        for s in sentences(page.read_text())
        if s.words > MOST_WORDS or HOUSE_WORDS.search(s.plain)
    ]
    assert not found, "\n".join(found)


def texts(file):
    """Strings of a module that are no docstrings."""
    found, docstrings = [], set()
    for node in ast.walk(ast.parse(file.read_text())):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            docstrings.add(id(body[0].value))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.append(node)
    return [node.value for node in found if id(node) not in docstrings]


def test_messages_use_the_words_of_the_field():
    found = [
        (name_of(file), text)
        for package in ("soilml", "datagen", "training")
        for file in sorted((ROOT / package).rglob("*.py"))
        if name_of(file) not in WRITTEN
        for text in texts(file)
        if HOUSE_WORDS.search(text)
    ]
    assert not found


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
