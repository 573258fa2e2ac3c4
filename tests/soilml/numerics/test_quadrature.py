"""Sine and versine as matrix products."""

import numpy as np
import pytest

from soilml.numerics.quadrature import crowded_ends, crowded_start, sine_and_versine


@pytest.mark.parametrize("nodes", [crowded_start(14), crowded_ends(24)])
@pytest.mark.parametrize(("dtype", "error"), [(np.float64, 2e-14), (np.float32, 2e-6)])
def test_both_keep_their_digits_at_any_angle(nodes, dtype, error):
    angle = np.concatenate([np.geomspace(1e-7, 1.0, 60), np.linspace(1.0, 2.5, 60)]).reshape(2, 60)
    sine, versine = sine_and_versine(nodes, angle.astype(dtype))
    assert sine.shape == versine.shape == (2, len(nodes[0]), 60)
    assert sine.dtype == versine.dtype == dtype
    each = nodes[0][:, None] * angle.astype(dtype).astype(float)[:, None, :]
    whole = each > 1e-12  # smaller versines are no float32 numbers
    np.testing.assert_allclose(sine[whole], np.sin(each)[whole], rtol=error)
    np.testing.assert_allclose(versine[whole], (2.0 * np.sin(0.5 * each) ** 2)[whole], rtol=error)


def test_the_sine_of_pi_vanishes():
    sine, versine = sine_and_versine((np.asarray([1.0]), np.asarray([1.0])), np.asarray([[np.pi]]))
    np.testing.assert_allclose(sine, 0.0, atol=1e-13)
    np.testing.assert_allclose(versine, 2.0, rtol=1e-14)
