"""The reference sets and their stored posteriors."""

from dataclasses import replace

import numpy as np
import pytest

from soilml.errors import InputError
from training.benchmark.bayes_limit_file import load_limit, save_limit
from training.benchmark.sets.exact_posterior import exact_set_posterior
from training.benchmark.sets.reference_sets import (
    ANY_WHEEL,
    ONE_WHEEL,
    as_any_wheel_sets,
    generate_reference_sets,
    packaged_posteriors,
    with_noise_of_reading,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def some():
    return generate_reference_sets(2)


def test_the_stored_posteriors_are_of_these_sets(some):
    limit = load_limit(packaged_posteriors(), some)
    truth = np.concatenate([r.sets.truth for r in some])
    std = np.sqrt(np.diagonal(limit.covariance, axis1=1, axis2=2))
    assert np.sqrt(np.mean(((limit.mean - truth) / std) ** 2)) < 2.0


def test_the_stored_posterior_of_a_set_is_reproduced(some):
    limit = load_limit(packaged_posteriors(), some)
    for i in (0, 3, len(some) // 2):
        again = exact_set_posterior(some[i].family, some[i].sets, 0)
        std = np.sqrt(np.diag(again.covariance))
        assert np.all(np.abs(again.mean - limit.mean[i]) < 0.1 * std)


def test_posteriors_of_other_rows_are_refused(some, tmp_path):
    one = some[0]
    path = tmp_path / "limit.parquet"
    save_limit(path, [one], [exact_set_posterior(one.family, one.sets, 0)])
    assert load_limit(path, [one]).mean.shape == (1, 3)
    torque = 1.01 * one.sets.readings["torque"]
    other = replace(one, sets=replace(one.sets, readings=one.sets.readings | {"torque": torque}))
    with pytest.raises(InputError, match=r"stale.*make limit"):
        load_limit(path, [other], "compute it again: make limit")


def test_both_families_have_the_same_response_of_the_reference_wheel(some):
    own = [r for r in some if r.label == ONE_WHEEL]
    for one, other in zip(own, as_any_wheel_sets(own), strict=True):
        design = np.broadcast_to(
            [
                other.sets.context_of(0)[k]
                for k in (
                    "wheel_radius",
                    "wheel_width",
                    "n",
                    "bearing_modulus",
                    "cohesion_max",
                    "shear_modulus_max",
                )
            ],
            (one.rows, 6),
        )
        rows, x = one.sets.rows(0), other.sets.origin.x
        designs = np.column_stack(
            [rows["slip"], design[:, :2], rows["load"], design[:, 2:4], design[:, 4:]]
        )
        as_any = other.family.responses(designs, x[None])
        alone = one.family.responses(one.sets.origin.designs[0], one.sets.origin.x[None])
        shift = np.log([0.15, 0.15, np.e]) * [1.0, 1.0, 0.0]
        assert np.allclose(as_any + shift, alone, atol=1e-9)


def test_bearing_is_known_in_some_sets_of_any_wheel_only(some):
    near = [r.sets.origin.normal_std[0] > 0.0 for r in some if r.label == ANY_WHEEL]
    assert any(near) and not all(near)


def test_noise_of_the_reading_is_the_same_share_of_it(some):
    for one, other in zip(some, with_noise_of_reading(some), strict=True):
        before, after = one.sets.readings, other.sets.readings
        assert np.array_equal(after["torque"], before["torque"])
        share = one.sets.origin.noise["torque"][1]
        assert after["torque_std"] / after["torque"] == pytest.approx(share)
        assert np.array_equal(after["sinkage_std"] > 1.0, before["sinkage_std"] > 1.0)
