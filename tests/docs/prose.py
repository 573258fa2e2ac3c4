"""Sentences of a Markdown page, from paragraphs and lists, without code, tables and headings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

#: Words whose point ends no sentence.
ABBREVIATIONS = ("e.g.", "i.e.", "eq.", "eqs.", "fig.", "figs.", "sec.", "al.", "no.", "vs.", "cf.")
_CODE = re.compile(r"`[^`\n]*`")
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)\s]*\)")
_SKIPPED = re.compile(r"^(\||#|:::|:\w+:|\$\$|<|---|===|!\[)")
_ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+")
_END = re.compile(r"(?<=[.!?])[*_\")]*\s+(?=[A-Z`*_\"(\[\d$])")


@dataclass(frozen=True)
class Sentence:
    """A sentence and the line on which its paragraph begins."""

    line: int
    text: str

    @property
    def words(self) -> int:
        """Parts between spaces that have a letter or a digit; formulas and code count as one."""
        text = re.sub(r"\$[^$]*\$", "X", self.plain)
        return sum(bool(re.search(r"\w", part)) for part in text.split())

    @property
    def plain(self) -> str:
        """The text in which code and the targets of links are left out."""
        return _CODE.sub("X", _LINK.sub(r"\1", self.text))


def sentences(page: str) -> Iterator[Sentence]:
    """The sentences of a page in its order."""
    for line, text in _paragraphs(page):
        begin = 0
        masked = _CODE.sub(lambda code: f"`{'x' * (len(code[0]) - 2)}`", text)
        for end in _END.finditer(masked):
            words = text[begin : end.start()].split()
            if words and words[-1].lower().lstrip("(") in ABBREVIATIONS:
                continue
            yield Sentence(line, text[begin : end.start()].strip())
            begin = end.end()
        if text[begin:].strip():
            yield Sentence(line, text[begin:].strip())


def _paragraphs(page: str) -> Iterator[tuple[int, str]]:
    """Paragraphs and items of lists, each on one line, with the number of their first line."""
    found: list[str] = []
    first, fence, comment = 0, "", False
    head = page.startswith("---\n")
    for number, line in enumerate([*page.splitlines(), ""], 1):
        if head:
            head = not (number > 1 and line == "---")
            continue
        bare = line.strip().lstrip("> ")
        mark = re.match(r"(`{3,}|~{3,}|\$\$$)", bare)
        if fence or mark:
            if found:
                yield first, " ".join(found)
                found = []
            if not fence and mark:
                fence = mark[1]
            elif bare.startswith(fence):
                fence = ""
            continue
        comment = (comment or bare.startswith("<!--")) and "-->" not in bare
        ends = comment or not bare or bool(_SKIPPED.match(bare)) or bool(_ITEM.match(line))
        if ends and found:
            yield first, " ".join(found)
            found = []
        if comment or not bare or _SKIPPED.match(bare):
            continue
        if not found and line.startswith("    ") and not _ITEM.match(line):
            continue
        if not found:
            first = number
        found.append(_ITEM.sub("", line).strip().lstrip("> "))
