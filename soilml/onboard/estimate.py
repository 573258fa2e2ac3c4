"""An estimate with its uncertainty, and the summary of the prior that it started from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import NOT_IDENTIFIED_ABOVE, Z_90

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PriorSummary:
    """Mean, standard deviation and range of each quantity before any measurement, each (q,)."""

    mean: Floats
    std: Floats
    lower: Floats
    upper: Floats


@dataclass(frozen=True)
class Estimate:
    """Posterior mean, standard deviation and covariance of q quantities, in SI units.

    The leading dimensions ``...`` are those of the readings; an estimate from several readings of
    one soil has none.

    Attributes
    ----------
    names, units : tuple of str
        Name and SI unit of each quantity, for example ``cohesion`` in ``Pa``.
    mean, std : ndarray, shape (..., q)
        Posterior mean and standard deviation. The mean lies inside the range of the prior.
    covariance : ndarray, shape (..., q, q)
        Posterior covariance; its diagonal is ``std**2``.
    low, high : ndarray, shape (..., q)
        Ends of the 90 % interval, inside the range of the prior.
    in_range : ndarray of bool, shape (...)
        False where the readings lie outside the training domain, or are inconsistent with any soil
        of the prior. Mean and standard deviation are then those of the prior.
    prior : PriorSummary
        The prior of the same quantities.

    Examples
    --------
    >>> from soilml.onboard import Estimator
    >>> estimate = Estimator.load("exported/wheel.onnx")(slip=0.3, torque=2.1, load=60.0)
    >>> mean, std = estimate["friction_angle"]
    >>> f"{mean:.2f} +- {std:.2f} rad"
    '0.51 +- 0.05 rad'
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Floats
    std: Floats
    covariance: Floats
    low: Floats
    high: Floats
    in_range: NDArray[np.bool_]
    prior: PriorSummary

    @staticmethod
    def gaussian(
        names: tuple[str, ...],
        units: tuple[str, ...],
        prior: PriorSummary,
        mean: Floats,
        covariance: Floats,
        std: Floats,
        in_range: NDArray[np.bool_],
        coverage_factor: Floats,
    ) -> Estimate:
        """An estimate whose 90 % interval is ``mean -+ coverage_factor * std``.

        The interval is cut at the ends of the prior's range. Where `in_range` is false, the
        coverage factor of a Gaussian is used instead of the calibrated one, (q,).
        """
        half = np.where(in_range[..., None], coverage_factor, Z_90) * std
        return Estimate(
            names=names,
            units=units,
            mean=mean,
            std=std,
            covariance=covariance,
            low=np.clip(mean - half, prior.lower, prior.upper),
            high=np.clip(mean + half, prior.lower, prior.upper),
            in_range=in_range,
            prior=prior,
        )

    @staticmethod
    def from_prior(
        names: tuple[str, ...],
        units: tuple[str, ...],
        prior: PriorSummary,
        shape: tuple[int, ...] = (),
    ) -> Estimate:
        """The prior itself as an estimate of a given leading shape, with `in_range` false."""
        q = len(names)
        mean, std = (np.broadcast_to(x, (*shape, q)).copy() for x in (prior.mean, prior.std))
        covariance = np.broadcast_to(np.diag(prior.std**2), (*shape, q, q)).copy()
        in_range, factor = np.zeros(shape, dtype=bool), np.full(q, Z_90)
        return Estimate.gaussian(names, units, prior, mean, covariance, std, in_range, factor)

    @staticmethod
    def stack(estimates: Sequence[Estimate], shape: tuple[int, ...]) -> Estimate:
        """Estimates of the same quantities as one; `shape` is put before their own dimensions."""
        first = estimates[0]
        parts = {
            key: np.reshape(
                [getattr(e, key) for e in estimates], (*shape, *getattr(first, key).shape)
            )
            for key in ("mean", "std", "covariance", "low", "high", "in_range")
        }
        return Estimate(names=first.names, units=first.units, prior=first.prior, **parts)

    @property
    def abstains(self) -> NDArray[np.bool_]:
        """Whether each quantity is still mostly the prior, (..., q), or the row is out of range."""
        vague = self.std > NOT_IDENTIFIED_ABOVE * self.prior_std
        return np.asarray(vague | ~np.asarray(self.in_range)[..., None])

    @property
    def prior_std(self) -> Floats:
        """Standard deviation of the prior, (q,)."""
        return self.prior.std

    def __getitem__(self, name: str) -> tuple[Floats, Floats]:
        """Mean and standard deviation (...) of one quantity."""
        i = self.names.index(name)
        return self.mean[..., i], self.std[..., i]
