"""Inputs that once failed, and a slice of `make fuzz`: only our errors leave our functions."""

import sys
import warnings
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from fuzz_run import CORPUS, EXAMPLES, fuzz
from targets import TARGETS, check

KEPT = sorted(path for path in CORPUS.rglob("*") if path.is_file())


@pytest.mark.slow
@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_what_once_failed(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(TARGETS[path.parent.name], path.read_bytes())


def test_every_target_has_inputs_that_once_failed_or_none_ever_did():
    assert KEPT and {path.parent.name for path in KEPT} <= set(TARGETS)


@pytest.mark.slow
@pytest.mark.parametrize("name", TARGETS)
def test_a_slice_of_the_fuzzing(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tried, _, failing = fuzz(name, max(1, round(0.5 * EXAMPLES * TARGETS[name].share)), 0)
    assert failing is None and tried > 0
