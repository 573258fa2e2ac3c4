"""The slip filter of the example rover as files, once for all tests."""

from pathlib import Path

import pytest

SLIP_EXAMPLE = Path(__file__).parents[1] / "examples" / "slip"
SOILS = 256


@pytest.fixture(scope="session")
def slip_case():
    from soilml import read_case

    return read_case(SLIP_EXAMPLE / "rover.toml")


@pytest.fixture(scope="session")
def slip_drive(slip_case):
    from soilml import read_table
    from soilml.slip_filter.drive import read_drive

    return read_drive(read_table(SLIP_EXAMPLE / "drive.csv"), slip_case)


@pytest.fixture(scope="session")
def slip_files(tmp_path_factory):
    """Folder with rover.onnx, rover.c and rover.h."""
    from soilml.cli import main

    work = tmp_path_factory.mktemp("slip_step")
    words = ["export-slip", str(SLIP_EXAMPLE / "rover.toml"), str(work / "rover.onnx")]
    assert main([*words, "--c", str(work / "rover.c"), "--draws", str(SOILS)]) == 0
    return work


@pytest.fixture(scope="session")
def slip_stream(slip_files):
    from soilml.onboard.slip_stream import SlipStream

    return SlipStream.load(slip_files / "rover.onnx")
