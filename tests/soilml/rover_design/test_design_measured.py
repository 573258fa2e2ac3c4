"""Wheels whose pull was measured, where their data are at hand."""

import importlib.util
import os
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / "examples/design/measured.py"
DATA = Path(os.environ.get("SOILML_DATA") or "absent")


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "ding2011").is_dir(), reason="needs SOILML_DATA")
def test_measured_pulls_lie_in_the_bands_and_lugs_are_understated():
    spec = importlib.util.spec_from_file_location("design_measured", SCRIPT)
    measured = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(measured)
    found = {name: values for name, *values in measured.largest_pulls(DATA)}
    for pull, _, low, high in found.values():
        assert low <= pull <= high
    for soil in ("HIT-LSS1", "KLS-1"):
        smooth, lugged = found[f"{soil}, smooth"], found[f"{soil}, lugs of 10 mm"]
        assert lugged[0] - smooth[0] > 9.0  # measured
        assert 0.5 < lugged[1] - smooth[1] < 3.0  # by the model
