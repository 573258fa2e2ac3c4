"""Inputs of any kind, and those that once failed: only our errors leave our functions.

`make fuzz FUZZ_EXAMPLES=5000` tries more. Hypothesis prints what fails; as a file in
`corpus/TARGET/` it is tried ever after.
"""

import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

sys.path.insert(0, str(Path(__file__).parent))

from targets import TARGETS, check

pytestmark = pytest.mark.slow

CORPUS = Path(__file__).parent / "corpus"
KEPT = sorted(path for path in CORPUS.rglob("*") if path.is_file())
#: Examples of a target of share 1; by default the same ones each time.
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "0"))


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_what_once_failed(path):
    check(path.parent.name, path.read_bytes())


@pytest.mark.parametrize("name", TARGETS)
def test_only_our_errors_leave(name):
    @settings(
        max_examples=max(1, round((EXAMPLES or 20) * TARGETS[name].share)),
        deadline=None,
        database=None,
        derandomize=not EXAMPLES,
        suppress_health_check=list(HealthCheck),
    )
    @given(TARGETS[name].inputs)
    def one(content):
        check(name, content)

    one()
