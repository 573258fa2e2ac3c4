"""One step of the slip filter as ONNX and as C, beside the filter in Python, number by number."""

import ctypes
import subprocess
import sys

import numpy as np
import pytest
from slip_step_fixtures import SLIP_EXAMPLE, SOILS, DrivenInC, slip_row

from soilml.cli import main
from soilml.errors import InputError, ModelFileError
from soilml.onboard.slip_stream import FLAGS, SlipStream
from soilml.slip_filter.drive import WIDE, _after
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import force_table


@pytest.fixture(scope="module")
def answers(slip_case, slip_drive, slip_stream):
    """What Python and the graph say of each row of the drive, and their beliefs after it."""
    load = slip_case.rover.loads(np.deg2rad(np.linspace(-25.0, 25.0, 21)))
    table = force_table(slip_case, (float(load.min()), float(load.max())), SOILS)
    filter_ = SlipFilter(table, slip_case.rover.weight, slip_case.drive)
    belief, state, found = filter_.start(), slip_stream.start(), []
    for i in range(len(slip_drive.time)):
        row = slip_row(slip_drive, i)
        *readings, _ = row.values()
        one, belief = filter_.step(belief, *readings)
        other, state = slip_stream.step(state, **row)
        found.append((one, other, belief, state))
    return found


def test_the_graph_has_the_belief_of_python_row_by_row(answers):
    for one, _other, belief, state in answers:
        weight = state.grounds[:, 0]
        assert np.abs(weight - belief.weight).max() < 1e-3 * belief.weight.max()
        k = belief.mean.shape[2]
        for number, own in enumerate((*belief.mean, *belief.cov)):
            part = state.grounds[:, 1 + number * k : 1 + (number + 1) * k]
            assert np.abs(part - own).max() < 1e-3 * np.abs(own).max() + 1e-7
        assert state.recent[0] == pytest.approx(belief.apart, rel=1e-3, abs=1e-9)
        assert state.recent[2] == pytest.approx(one.misfit, rel=2e-3, abs=1e-3)


def test_the_flags_are_those_of_the_batch(answers):
    misfit, seen = [], set()
    for one, other, _, _ in answers:
        misfit.append(one.misfit)
        own = set(_after(one.no_soil, one.beyond, misfit, one.slip, 4))
        seen |= own
        near = abs(one.no_soil - 0.5) < 0.01 or abs(one.beyond - 0.5) < 0.01
        wide = "not-determined"
        assert near or own - {wide} == set(other.flags) - {wide}
        if other.answered:  # the width is read off another interpolation
            width = np.max(other.slips[2] - other.slips[0])
            assert abs(width - WIDE) < 1e-3 or (wide in other.flags) == (width > WIDE)
    assert {"no-soil", "not-determined"} <= seen


def test_wrong_input_is_one_line(slip_stream, slip_drive, tmp_path, capsys):
    state, rim, load = slip_stream.start(), slip_drive.rim_speed[0], slip_drive.load[0]
    with pytest.raises(InputError, match="needed are 4 numbers, of front-left"):
        slip_stream.step(state, rim[:3], rim, load, 0.0)
    with pytest.raises(InputError, match="slope is not finite"):
        slip_stream.step(state, rim, rim, load, np.nan)
    with pytest.raises(InputError, match="load is 0; possible is 1e-06 to"):
        slip_stream.step(state, rim, rim, 0.0 * load, 0.0)
    wheel = SLIP_EXAMPLE.parents[1] / "exported" / "wheel.onnx"
    with pytest.raises(ModelFileError, match="no file of soilml export slip"):
        SlipStream.load(wheel)
    with pytest.raises(ModelFileError, match="there is no such file"):
        SlipStream.load(tmp_path / "none.onnx")
    model = SLIP_EXAMPLE.parent / "wheel" / "model.toml"
    assert main(["export", "slip", str(model), str(tmp_path / "a.onnx")]) == 2
    assert "no [rover]" in capsys.readouterr().err and not (tmp_path / "a.onnx").exists()


def test_loads_are_those_of_the_rover(slip_case, slip_stream):
    for slope, roll in ((0.0, 0.0), (0.2, 0.0), (-0.1, 0.15), (0.25, -0.1)):
        assert slip_stream.loads(slope, roll) == pytest.approx(
            slip_case.rover.loads(slope, roll), rel=1e-6
        )


def test_on_board_it_needs_numpy_and_onnxruntime_alone(slip_files):
    code = "import sys; from soilml.onboard.slip_stream import SlipStream as S; "
    code += f"s = S.load({str(slip_files / 'rover.onnx')!r}); s.start(); "
    code += "print(*{m.split('.')[0] for m in sys.modules})"
    words = [sys.executable, "-c", code]
    loaded = set(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split())
    assert {"numpy", "onnxruntime", "soilml"} <= loaded
    assert not loaded & {"scipy", "onnx", "jinja2", "matplotlib", "pyarrow", "torch", "training"}


@pytest.mark.slow
def test_c_computes_the_numbers_of_the_graph(slip_in_c, slip_drive, slip_stream):
    own, state = DrivenInC(slip_in_c), slip_stream.start()
    begun = np.frombuffer(own.state, np.float32)
    assert np.array_equal(begun[: state.grounds.size].reshape(state.grounds.shape), state.grounds)
    for i in range(len(slip_drive.time)):
        row = slip_row(slip_drive, i)
        other, state = slip_stream.step(state, **row)
        code, answer = own.step(row)
        assert code == (0 if other.answered else 1)
        assert answer.flags == sum(1 << FLAGS.index(name) for name in other.flags)
        assert answer.speed == pytest.approx(other.speed, abs=2e-3 * other.speed_std)
        assert answer.speed_std == pytest.approx(other.speed_std, rel=2e-3)
        assert list(answer.speeds) == pytest.approx(other.speeds, abs=0.02 * other.speed_std)
        assert np.ravel(answer.slips) == pytest.approx(other.slips.ravel(), abs=2e-2)
    before = bytes(own.state)
    assert own.step(row | {"slope": np.nan})[0] == -1
    assert bytes(own.state) == before
    library = slip_in_c.library
    library.rover_identity.restype = library.rover_message.restype = ctypes.c_char_p
    told = library.rover_identity().decode()
    assert all(
        slip_stream.metadata[name] in told
        for name in ("graph_sha256", "metadata_sha256", "case_sha256")
    )
    texts = {library.rover_message(code) for code in (0, 1, -1, -2, -3)}
    assert len(texts) == 5 and library.rover_message(7) == b"unknown code"
    assert slip_in_c.numbers["ROVER_WORK_BYTES"] < 300_000  # of 512 grounds; once 570 kB
