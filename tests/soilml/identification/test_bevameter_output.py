"""The JSON of plate and shear tests."""

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, K, N, plates, shear

from soilml.identification.bevameter import (
    bevameter,
)
from soilml.identification.bevameter.scatter import (
    SpreadEstimate,
)


def test_json_of_the_result_holds_every_test():
    found = bevameter(plates(repeats=1), shear(repeats=1))
    content = found.as_json()
    assert set(content["estimates"]) == {*("n", "kc", "kphi"), *("cohesion", "friction_angle")} | {
        "shear_modulus"
    }
    entry = content["plate_tests"][1]
    assert (entry["test"], entry["plate_m"]) == ("0.1_0", 0.1)
    assert entry["n"] == pytest.approx(N, rel=1e-3)
    assert entry["k"] == pytest.approx(KC / 0.1 + KPHI, rel=1e-3) and entry["misfit"] < 1e-6
    entry = content["shear_tests"][2]
    assert (entry["test"], entry["normal_stress_Pa"]) == ("20000_0", 20e3)
    assert entry["strength_Pa"] == pytest.approx(C + 20e3 * np.tan(PHI), rel=0.01)
    assert entry["shear_modulus_m"] == pytest.approx(K, rel=0.02)
    assert content["soil"] == found.soil and content["remarks"] == [
        r.as_json() for r in found.remarks
    ]
    assert bevameter(plates()).as_json()["shear_tests"] == []
    assert bevameter(shear=shear()).as_json()["plate_tests"] == []
    assert isinstance(found.estimates()["n"], SpreadEstimate)
