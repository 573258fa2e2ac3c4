"""The examples in docstrings, run as doctests."""

import doctest
from importlib import import_module

import pytest

MODULES = (
    "soilml.physics.effects.base",
    "soilml.physics.effects.soil_changes",
    "soilml.physics.gears.wheel",
    "soilml.physics.model",
    "soilml.physics.operating_point",
    "soilml.physics.soils.catalogue",
)


@pytest.mark.parametrize("name", MODULES)
def test_examples_print_what_they_show(name):
    failed, attempted = doctest.testmod(import_module(name))
    assert attempted > 0 and failed == 0
