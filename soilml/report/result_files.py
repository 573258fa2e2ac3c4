"""The files of a result: JSON with numbers in SI units, and the page with the same numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from soilml.report.page import Provenance, Report

#: What is written to a file: its text, or a function of the path.
Content = str | Callable[[Path], object]


def json_text(content: Any) -> str:
    """The content as indented JSON; numbers that are not finite become null, as JSON has none."""
    return json.dumps(finite_or_null(content), indent=2, allow_nan=False) + "\n"


def finite_or_null(value: Any) -> Any:
    """The content with None for every number that is not finite."""
    if isinstance(value, dict):
        return {key: finite_or_null(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_null(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def report_texts(
    report: Report,
    origin: Provenance,
    content: Mapping[str, Any],
    names: tuple[str, str],
    folder: Path,
) -> dict[Path, Content]:
    """The page and the JSON file, by their paths; `content` is the result in SI units."""
    from soilml.report.page import page

    html, json_name = names
    entry = {"report": report.as_json(origin)}
    return {
        folder / html: page(report, origin),
        folder / json_name: json_text({**content, **entry}),
    }
