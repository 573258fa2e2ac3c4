"""The page of constants beside the sources."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs/site"))

import constant_listing  # noqa: E402


def differences(room: str) -> list[str]:
    """Lines of a room that the page lacks, or has though the sources do not."""
    stated = constant_listing.PAGE.read_text()
    begin = stated.index(f"## {constant_listing.ROOMS[room]}\n")
    end = stated.find("\n## ", begin) + 1 or len(stated) + 1
    known, found = stated[begin : end - 1].splitlines(), constant_listing.listing(room).splitlines()
    return sorted({*known} ^ {*found})
