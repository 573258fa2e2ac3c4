"""Formulas as MathML, which browsers draw themselves: no script and no font is loaded."""

from __future__ import annotations

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

#: Names of functions stand apart from what is beside them; not inside of scripts, which are pairs.
_FUNCTION = re.compile(
    r"(?<!<msup>)(?<!<msub>)(?<!<munder>)<mi>(sin|cos|tan|exp|log|ln|arc\w+)</mi>(?=(<m[is])?)"
)


def _apart(found: re.Match[str]) -> str:
    after = '<mspace width="0.17em"/>' if found[2] else ""
    return f'<mspace width="0.1em"/><mi>{found[1]}</mi>{after}'


def _mathml(formula: str, display: str) -> str:
    """MathML of a formula, an element for each line: blank lines and two backslashes separate."""
    lines = re.split(r"\n\s*\n", formula.strip())
    if r"\begin" not in formula:
        lines = [one.replace("&", "") for line in lines for one in line.split(r"\\")]
    try:
        elements = [convert(" ".join(line.split()), display=display) for line in lines]
        return _FUNCTION.sub(_apart, "".join(elements))
    except Exception as error:
        raise ExtensionError(f"this formula cannot be drawn: {formula}") from error


def _inline(translator, node: nodes.math) -> None:  # type: ignore[no-untyped-def]
    translator.body.append(_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def _block(translator, node: nodes.math_block) -> None:  # type: ignore[no-untyped-def]
    translator.body.append(f'<div class="math">{_mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer as `mathml`."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
