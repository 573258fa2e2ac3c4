"""Examples in docstrings are run, from the root of the repository."""

import doctest
import importlib
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
MODULES = sorted(
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for package in ("soilml", "datagen", "training")
    for file in (ROOT / package).rglob("*.py")
    if ">>> " in file.read_text()
)


def test_examples_print_what_they_show(monkeypatch, subtests):
    monkeypatch.chdir(ROOT)
    for name in MODULES:
        with subtests.test(name):
            failed, tried = doctest.testmod(
                importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE
            )
            assert tried and not failed
