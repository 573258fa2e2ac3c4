"""The slip filter of the example rover as files, once for all tests of this folder."""

from pathlib import Path

import pytest

from soilml import read_case, read_table
from soilml.cli import main
from soilml.onboard.slip_stream import SlipStream
from soilml.slip_filter.drive import read_drive

EXAMPLE = Path(__file__).parents[3] / "examples" / "slip"
SOILS = 256


@pytest.fixture(scope="session")
def case():
    return read_case(EXAMPLE / "rover.toml")


@pytest.fixture(scope="session")
def drive(case):
    return read_drive(read_table(EXAMPLE / "drive.csv"), case)


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """rover.onnx, rover.c and rover.h."""
    work = tmp_path_factory.mktemp("slip_step")
    words = ["export-slip", str(EXAMPLE / "rover.toml"), str(work / "rover.onnx")]
    assert main([*words, "--c", str(work / "rover.c"), "--soils", str(SOILS)]) == 0
    return work


@pytest.fixture(scope="session")
def stream(folder):
    return SlipStream.load(folder / "rover.onnx")
