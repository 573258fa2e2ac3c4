"""The fault detector in C against that in Python."""

import numpy as np
import pytest
from compiled_c import COMPILERS, ROOT

from datagen.recipe import read_recipe
from soilml import Estimator, simulate

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not COMPILERS, reason="no C compiler")]
#: Largest relative difference of a misfit, of which C leaves out what changes no answer.
SAME = 0.02


def rows_of(rng, factor):
    """Rows of all channels on the recipe's soil, with its noise and a torque of so much."""
    slip, load = rng.uniform(0.08, 0.5, 16), rng.uniform(45.0, 105.0, 16)
    table = simulate(read_recipe("wheel").case, slip, load, seed=int(rng.integers(1000)))
    rows = {"slip": slip, "torque": factor * table["torque_Nm"], "load": load}
    rows |= {"sinkage": table["sinkage_m"], "drawbar_pull": table["drawbar_pull_N"]}
    return {name: np.asarray(values, np.float32) for name, values in rows.items()}


@pytest.mark.parametrize("declared", [{}, {"slip_bias": 0.0, "load_gain": 0.0}])
@pytest.mark.parametrize("name", ["wheel", "wheel_small"])
def test_misfit_and_flag_are_those_of_python(name, declared, compiled):
    model, estimator = compiled(name), Estimator.load(ROOT / "exported" / f"{name}.onnx")
    estimator, rng, flags = estimator.on(**declared), np.random.default_rng(4), []
    for factor in (1.0, 1.2, 1.6, 0.5, 0.25, 3.0):
        rows = rows_of(rng, factor)
        memory, state = model.start(**declared), estimator.start()
        for first in (0, 8):
            part = {key: values[first : first + 8] for key, values in rows.items()}
            code, answer = model.update(memory, model.rows(**part))
            expected, state = estimator.step(state, **part)
            assert code >= 0
        before, check = bytes(memory), model.new("check")
        assert model.call("set_check", memory, check, model.work) == 0
        assert bytes(memory) == before
        scale = max(1.0, float(expected.exact_misfit))
        assert abs(check.misfit - float(expected.exact_misfit)) < SAME * scale
        assert check.disagrees == bool(expected.disagrees)
        flags.append(check.disagrees)
        assert model.answer(memory)[1]["misfit"] == pytest.approx(answer["misfit"], rel=SAME)
    assert {*flags} == {False, True}


def test_a_check_before_the_first_row_is_refused(compiled):
    model = compiled("wheel_small")
    code = model.call("set_check", model.start(), model.new("check"), model.work)
    assert code == model.codes["NO_ROWS"]
    code = model.call("set_check", model.new("memory"), model.new("check"), model.work)
    assert code == model.codes["NOT_STARTED"]
