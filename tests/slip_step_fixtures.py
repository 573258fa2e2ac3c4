"""The slip filter of the example rover as files, once for all tests."""

from pathlib import Path

import numpy as np
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
    words = ["export", "slip", str(SLIP_EXAMPLE / "rover.toml"), str(work / "rover.onnx")]
    assert main([*words, "--c", str(work / "rover.c"), "--draws", str(SOILS)]) == 0
    return work


@pytest.fixture(scope="session")
def slip_stream(slip_files):
    from soilml.onboard.slip_stream import SlipStream

    return SlipStream.load(slip_files / "rover.onnx")


@pytest.fixture(scope="session")
def slip_in_c(slip_files):
    """The C file, compiled."""
    from compiled_c import COMPILERS, CompiledModel, compile_library

    if not COMPILERS:
        pytest.skip("no C compiler")
    library = compile_library(slip_files / "rover.c", slip_files / "rover.so", COMPILERS[0], "-O2")
    return CompiledModel(slip_files / "rover.h", library)


def slip_row(slip_drive, i, **changed):
    """Row `i` of the drive; `changed` replaces one number, that of the first wheel."""
    row = {name: getattr(slip_drive, name)[i].copy() for name in ("rim_speed", "torque", "load")}
    row |= {"slope": float(slip_drive.slope[i]), "elapsed": 1.0}
    for name, value in changed.items():
        if np.ndim(row[name]):
            row[name][0] = value
        else:
            row[name] = value
    return row


class DrivenInC:
    """A state of the C file along rows."""

    def __init__(self, model):
        self.model, self.state = model, model.new("state")
        model.call("start", self.state)

    def step(self, row):
        """Code and estimate."""
        own, answer = self.model.new("row"), self.model.new("estimate")
        for name, value in row.items():
            if np.ndim(value):
                getattr(own, name)[:] = value
            else:
                setattr(own, name, value)
        return self.model.call("step", self.state, own, answer, self.model.work), answer
