"""What files of slip carry of their errors."""

import numpy as np

from training.calibration.recalibration import measure_held_out
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


def test_a_file_carries_one_row_of_each_run():
    data = steady_rows()
    found = measure_held_out(*sensor(0.6, data), data)
    assert len(found.rows) == 1000 and len({*data.run[np.isin(data.row, found.rows)]}) == 1000
