"""Fusion by the correlation of the errors that files carry, on simulated errors."""

import numpy as np
import pytest
from made_estimates import made_estimate

from soilml.errors import InputError
from soilml.onboard.estimate import Reason
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.joint_errors import joint_errors
from soilml.onboard.multi_sensor import fuse_estimates

pytestmark = pytest.mark.slow

PRIOR = PriorSummary(np.asarray([0.3]), np.asarray([0.2]), np.asarray([-0.9]), np.asarray([1.5]))
ROWS = 2000


class Sensors:
    """Sensors whose errors have a correlation; each reading's std is drawn."""

    def __init__(self, common=0.6, sizes=(0.05, 0.08), seed=0):
        self.common, self.sizes = common, sizes
        self.rng = np.random.default_rng(seed)

    def draw(self, rows):
        """Truth (rows,), mean and std (sensors, rows)."""
        shape = len(self.sizes), rows
        truth, shared, own = (self.rng.normal(size=size) for size in (rows, (1, rows), shape))
        error = np.sqrt(self.common) * shared + np.sqrt(1.0 - self.common) * own
        std = np.asarray(self.sizes)[:, None] * self.rng.uniform(0.7, 1.4, shape)
        truth = 0.3 + 0.2 * truth
        return truth, truth + std * error, std

    def files(self):
        """Held-out errors of each sensor, of which the first is of an earlier file."""
        truth, means, stds = self.draw(ROWS)
        earlier = {"repeats": [1], "repeat_std": [[1.0]], "repeat_coverage_factor": [[1.645]]}
        return [
            HeldOutErrors.of({"rows": range(ROWS), "truth": truth, "mean": m, "std": s} | more)
            for m, s, more in zip(means, stds, (earlier, {}), strict=True)
        ]


def estimate(mean, std, errors):
    return made_estimate(
        np.asarray(mean)[..., None], np.asarray(std)[..., None], PRIOR, errors=errors
    )


def rmse(found, truth):
    return np.sqrt(np.mean((found.mean[:, 0] - truth) ** 2))


def cover(found, truth):
    return np.mean((found.low[:, 0] <= truth) & (truth <= found.high[:, 0]))


def z_rms(found, truth):
    return np.sqrt(np.mean(((found.mean[:, 0] - truth) / found.std[:, 0]) ** 2))


@pytest.mark.parametrize("common", [0.0, 0.4, 0.8])
def test_fused_estimates_are_calibrated_whatever_the_correlation(common):
    sensors = Sensors(common)
    files = sensors.files()
    assert joint_errors(tuple(files))[0].correlation[0, 1] == pytest.approx(common, abs=0.05)
    truth, mean, std = sensors.draw(20000)
    each = [estimate(mean[i], std[i], files[i]) for i in range(2)]
    fused = fuse_estimates(each)
    assert rmse(fused.estimate, truth) < 1.002 * min(rmse(e, truth) for e in each)
    assert cover(fused.estimate, truth) == pytest.approx(0.9, abs=0.015)
    assert z_rms(fused.estimate, truth) == pytest.approx(1.0, abs=0.04)
    assert np.mean(fused.disagreement**2) == pytest.approx(1.0, abs=0.1)


def test_two_estimates_of_one_file_are_refused():
    file = Sensors().files()[0]
    with pytest.raises(InputError, match="give one of each file"):
        fuse_estimates([estimate([0.3], 0.05, file), estimate([0.31], 0.05, file)])


def test_readings_that_disagree_widen_the_estimate_and_contradict_beyond_four_deviations():
    files = Sensors().files()
    near, far, contradictory = (
        fuse_estimates([estimate([0.3], 0.05, files[0]), estimate([0.3 + d], 0.05, files[1])])
        for d in (0.05, 0.15, 0.2)
    )
    assert far.disagreement[0] == pytest.approx(3.0 * near.disagreement[0])
    widening = far.estimate.std[0, 0] / near.estimate.std[0, 0]
    assert widening == pytest.approx(far.disagreement[0] / 2.0, rel=0.01)
    independent = 0.2 / np.sqrt(2.0 * 0.05**2)
    assert independent < 4.0 < contradictory.disagreement[0]
    answer = contradictory.estimate
    assert not answer.in_range[0] and answer.reason[0] == Reason.CONTRADICTORY
    np.testing.assert_array_equal(answer.mean[0], answer.prior.mean)
    assert not contradictory.used.any()


def test_fused_rows_keep_shape_ends_and_reasons():
    """One file alone in a row keeps its interval; none gives the prior."""
    files = Sensors().files()
    one, other = (
        made_estimate([[[m], [0.4]]], 0.1, PRIOR, [[first, False]], factor=1.0, errors=file)
        for m, first, file in ((0.3, True, files[0]), (0.4, False, files[1]))
    )
    found = fuse_estimates([one, other])
    assert found.estimate.mean.shape == (1, 2, 1)
    assert found.estimate.low[0, 0] == pytest.approx([0.2])
    assert found.estimate.high[0, 0] == pytest.approx([0.4])
    assert found.estimate.mean[0, 1] == pytest.approx(PRIOR.mean)
    assert found.estimate.std[0, 1] == pytest.approx(PRIOR.std)
    assert found.estimate.low[0, 1] == pytest.approx(PRIOR.mean - 1.6448536 * PRIOR.std)
    assert found.used.tolist() == [[[True, False]], [[False, False]]]
    assert found.estimate.reason.tolist() == [[Reason.ESTIMATED, Reason.OUT_OF_RANGE]]
