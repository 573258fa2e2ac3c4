"""The page of constants has every constant of the sources with its present value."""

import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "docs/site"))

import constant_listing  # noqa: E402


def test_constants_are_those_of_the_page():
    """Compared without their headings, so that a constant may move from file to file."""
    found = Counter(row for room in constant_listing.ROOMS for row in constant_listing.rows(room))
    stated = Counter(
        line for line in constant_listing.PAGE.read_text().splitlines() if line.startswith("| `")
    )
    assert len(found) > 200
    assert found == stated, "renew: python docs/site/constant_listing.py"


def test_values_are_written_without_brackets_and_quotes():
    source = "#: Shares of each.\nSHARES = {'torque': 0.02, 'load': (1e-9, 3)}\nN = 4\n"
    assert list(constant_listing._constants(source)) == [
        "| `SHARES` | torque: 0.02; load: 1e-09, 3 | Shares of each |"
    ]
