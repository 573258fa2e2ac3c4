"""Parameters that are no numbers are refused, whatever they are given to."""

from dataclasses import replace

import numpy as np
import pytest

from soilml import EFFECTS, Model, Operating, Track, Wheel, soil
from soilml.errors import InputError

SAND, WHEEL = soil("wong1989/dry_sand"), Model(Wheel(radius=0.15, width=0.12))
NO_NUMBERS = ["much", "0.3", b"0.3", 10**400, [0.1, [0.2]], {}, np.ma.array([0.1], mask=[True])]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: f"{value!r:.12}")
def test_what_is_no_number_is_named_in_one_line(value):
    at = Operating(slip=0.1, load=60.0)
    tries = {
        "slip": lambda: WHEEL(SAND, replace(at, slip=value)),
        "cohesion": lambda: WHEEL(replace(SAND, cohesion=value), at),
        "n1": lambda: (WHEEL + EFFECTS["slip-sinkage"](n1=value))(SAND, at),
        "radius": lambda: Model(Wheel(radius=value, width=0.12))(SAND, at),
        "base": lambda: Model(Track(radius=0.1, width=0.1, base=value))(SAND, at),
    }
    for name, call in tries.items():
        with pytest.raises(InputError, match=f"{name} is .*; needed is a number") as raised:
            call()
        assert "\n" not in str(raised.value) and len(str(raised.value)) < 200


def test_arrays_that_do_not_fit_together_are_named():
    with pytest.raises(InputError, match=r"together: at.slip \(3,\), at.load \(2,\)"):
        WHEEL(SAND, Operating(slip=np.full(3, 0.1), load=np.full(2, 60.0)))
    with pytest.raises(InputError, match=r"soil.cohesion \(4,\), at.slip \(3,\)"):
        WHEEL(
            soil("wong1989/dry_sand", cohesion=np.full(4, 9.0)),
            Operating(slip=np.full(3, 0.1), load=60.0),
        )
