"""What a file promises of the advised reading is what it then leaves."""

import sys
from pathlib import Path

import numpy as np
import pytest

from soilml import Estimator
from soilml.identification.model_error_inputs import with_exact_model

pytestmark = pytest.mark.long

BENCH = Path(__file__).parents[3] / "bench"


@pytest.mark.parametrize("mode", [lambda file: file, with_exact_model], ids=["default", "exact"])
def test_a_file_leaves_what_it_promised_in_the_mode_in_which_it_answers(mode, monkeypatch):
    monkeypatch.syspath_prepend(str(BENCH))
    for name in ("promises", "advice"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    from promises import promises

    rows = promises(mode(Estimator.load("wheel")), soils=16, rows=2)
    left, found = (
        np.sqrt(np.mean([np.square(row[key]) for row in rows], axis=0))
        for key in ("promised", "answered")
    )
    # over 120 soils the ratio is 1.02 to 1.07 by default and .96 to .99 with the exact model; that
    # of 60 soils differs from seed to seed by up to .06, that of 16 by twice as much
    np.testing.assert_allclose(left, found, rtol=0.2)
