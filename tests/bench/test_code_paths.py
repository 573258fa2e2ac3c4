"""The counter of files, functions and arrows, and how much of the code a reading passes."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "bench"))

import code_paths  # noqa: E402

FIRST = """
import second

def outer():
    return sorted([2, 1], key=second.negated), inner(), [x for x in range(3)]

def inner():
    return second.negated(3) + second.negated(4)
"""
SECOND = """
def negated(x):
    return -x

def unused():
    return 0
"""


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """A package of two files, of which the first calls the second."""
    (tmp_path / "first.py").write_text(FIRST)
    (tmp_path / "second.py").write_text(SECOND)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in ("first", "second"):
        sys.modules.pop(name, None)


def test_files_functions_and_arrows_are_counted_once(modules):
    import first

    found = code_paths.count(first.outer, (f"{modules}/",))
    names = (str(modules / "first.py"), str(modules / "second.py"))
    assert found.files == set(names)
    assert len(found.functions) == 3
    assert found.arrows == {names}
    assert code_paths.count(first.outer, (f"{modules / 'other'}/",)).files == frozenset()
    assert sys.getprofile() is None


@pytest.mark.slow
def test_commands_pass_no_more_files_than_their_goals(tmp_path):
    counted = {call.name: call for call in code_paths.counted_calls(tmp_path)}
    assert sum(call.goal is not None for call in counted.values()) == 3
    for call in counted.values():
        if call.goal is not None:
            assert 2 < len(call.found().files) <= call.goal, call.name
