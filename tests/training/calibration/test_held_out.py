"""What files of slip carry of their errors: rows, and the share in common."""

import numpy as np
import pytest

from training.calibration.held_out import common_share, measure_held_out
from training.dataset import Dataset


def steady_rows():
    """Thousand runs of eight rows; slip and load are constant in each."""
    rng, run, n = np.random.default_rng(0), np.repeat(np.arange(1000), 8), 8000
    slip, load = rng.uniform(0.0, 0.6, n)[run], rng.uniform(10.0, 40.0, n)[run]
    soil, noise = rng.normal(size=n)[run], rng.normal(size=n)
    return Dataset(
        measured={"torque": 0.1 * load, "load": load},
        features=np.column_stack([slip, soil, noise]),
        targets=slip[:, None],
        run=run,
        row=np.arange(n) * 3 + 5,
        feature_names=("slip", "soil", "noise"),
        target_names=("slip",),
        lower=np.asarray([0.0]),
        upper=np.asarray([0.6]),
        recipe="{}",
        dropped=0,
    )


def sensor(share, data):
    """Estimates of std 0.1, of which this share of the error variance is the soil's."""
    features = data.features
    error = np.sqrt(share) * features[:, 1] + np.sqrt(1.0 - share) * features[:, 2]
    mean = features[:, :1] + 0.1 * error[:, None]
    return mean, np.full_like(mean, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.6, 0.95])
def test_the_share_of_error_in_common_is_found(share):
    data = steady_rows()
    estimates = sensor(share, data)
    assert common_share(*estimates, data)[0] == pytest.approx(share, abs=0.06)
    assert len(measure_held_out(*estimates, data).rows) == 1000
