"""Results, priors of free parameters, warnings, and a parameter that a method holds fixed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from soilml.fitting.coordinates import select_free
from soilml.fitting.misfit import misfit_limit
from soilml.identification.trained_estimator import SAME_PRIOR, narrower_priors
from soilml.numerics.prior import Prior


def test_priors_that_nobody_gave_are_those_of_natural_soils(case):
    bare = replace(case, prior={"cohesion": Prior(0.0, 500.0)})
    names = ["cohesion", "friction_angle", "shear_modulus", "n", "friction_angle"]
    free = select_free(bare, names)
    assert [f.path for f in free] == names[:4]
    assert [f.assumed for f in free] == [False, True, True, True]
    # 0 to 10 kPa, 10 to 55 degrees, 1 mm to 0.1 m, and exponents from loose to layered soil
    assert free[0].prior == Prior(0.0, 500.0)
    np.testing.assert_allclose(
        np.rad2deg([free[1].prior.lower, free[1].prior.upper]), [10.0, 55.0], atol=0.3
    )
    assert free[2].prior == Prior(0.001, 0.1, log=True) and free[3].prior == Prior(0.3, 1.8)
    assert select_free(replace(case, prior={}), ["cohesion"])[0].prior == Prior(0.0, 10000.0)
    assert [f.unit for f in free] == ["Pa", "rad", "m", "1"]
    assert free[3].nominal == case.soil.n
    assert [f.path for f in select_free(case, None)] == list(case.prior)


def test_noise_alone_exceeds_the_limit_of_the_misfit_once_in_a_thousand():
    from scipy.stats import chi2

    for freedom in (1, 5, 40):
        assert misfit_limit(freedom) == pytest.approx(chi2.ppf(0.999, freedom) / freedom, rel=0.04)
    assert misfit_limit(0) == np.inf


@pytest.mark.parametrize(
    ("own", "used"),
    [
        (Prior(0.0, 3000.0), None),  # the file's
        (Prior(500.0, 3000.0), (500.0, 3000.0)),
        (Prior(0.0, 2500.0), (0.0, 2500.0)),
        (Prior(30.0, 2970.0), None),  # within a hundredth: the same
        (Prior(0.0, 4000.0), None),  # wider
        (Prior(-500.0, 2000.0), None),  # only one end lies in the file's
        (Prior(1000.0, 4000.0), None),
        (Prior(-30.0, 2000.0), (0.0, 2000.0)),  # within the slack, cut to the file's
        (Prior(1000.0, 3030.0), (1000.0, 3000.0)),
        (Prior(1.0, 2000.0, log=True), None),
    ],
)
def test_a_narrower_prior_is_used_where_it_lies_in_that_of_the_file(own, used):
    assert SAME_PRIOR == 0.02
    file = SimpleNamespace(
        names=("cohesion",), prior=SimpleNamespace(lower=[0.0], upper=[3000.0])
    )  # fmt: skip
    found = narrower_priors(file, SimpleNamespace(prior={"cohesion": own}))
    assert found == ({} if used is None else {"cohesion": used})
    assert narrower_priors(file, SimpleNamespace(prior={})) == {}
