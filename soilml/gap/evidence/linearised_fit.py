"""Evidence of a fit's neighbourhood as a linear model, for many amplitudes of a discrepancy."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats, Integers

KEPT = 64  # Divisions that are kept: fits share them, because amplitudes are those of a grid


@dataclass(frozen=True)
class Division:
    r"""The whitened process with one channel apart from the others, which have an amplitude.

    .. math::
        V^{-1} = V_0^{-1} - V_0^{-1} \Phi\, \tau^2 (I + \tau^2 \Phi^T V_0^{-1} \Phi)^{-1} \Phi^T
        V_0^{-1}, \quad |V| = |V_0| \prod_k (1 + \tau^2 \lambda_k)

    with the covariance V_0 of all but the channel's own discrepancy, its functions Phi, and the
    eigenvalues lambda of Phi^T V_0^-1 Phi: one decomposition serves all amplitudes tau.
    """

    own: NDArray[np.bool_]  # (q,) functions of the channel
    reduce: (
        Floats  # (r, r), the inverse of the factor of V_0 times the amplitudes, others' functions
    )
    across: Floats  # (r, k) of the channel's own functions with the others, reduced
    value: Floats  # (k,) eigenvalues
    vector: Floats  # (k, k) eigenvectors
    log_determinant: float  # of V_0, whitened by noise and scatter


@dataclass(frozen=True)
class ProcessDivisions:
    """Products of the whitened functions of a process, and its divisions by channel."""

    gram: Floats  # (q, q)
    channel: NDArray[np.int64]  # (q,)
    #: those of all channels but the last, where they are known
    but_last: ProcessDivisions | None = None
    _kept: dict[tuple[int, bytes], Division] = field(default_factory=dict)
    _reduced: dict[bytes, tuple[Floats, float]] = field(default_factory=dict)

    def reduce(self, amplitude: Floats) -> Floats:
        """The inverse of the factor of V times the amplitudes (channels,), (q, q)."""
        return self._reduced_at(amplitude)[0]

    def _reduced_at(self, amplitude: Floats) -> tuple[Floats, float]:
        """The same, and the logarithm of the determinant of V."""
        key = amplitude.tobytes()
        if key not in self._reduced:
            while len(self._reduced) >= KEPT:
                self._reduced.pop(next(iter(self._reduced)))
            self._reduced[key] = _reduced(self.gram, amplitude[self.channel])
        return self._reduced[key]

    def at(self, amplitude: Floats, channel: int) -> Division:
        """The division with one channel apart, others at their amplitudes (channels,)."""
        others = np.delete(amplitude, channel)
        key = channel, others.tobytes()
        if key not in self._kept:
            while len(self._kept) >= KEPT:
                self._kept.pop(next(iter(self._kept)))
            self._kept[key] = self._divided(amplitude, channel)
        return self._kept[key]

    def _divided(self, amplitude: Floats, channel: int) -> Division:
        own = self.channel == channel
        if self.but_last is not None and channel == len(amplitude) - 1:
            reduce, log_determinant = self.but_last._reduced_at(amplitude[:-1])
        else:
            beside = self.gram[np.ix_(~own, ~own)]
            reduce, log_determinant = _reduced(beside, amplitude[self.channel[~own]])
        across = reduce @ self.gram[np.ix_(~own, own)]
        value, vector = np.linalg.eigh(self.gram[np.ix_(own, own)] - across.T @ across)
        return Division(
            own=own,
            reduce=reduce,
            across=across,
            value=np.maximum(value, 0.0),
            vector=vector,
            log_determinant=log_determinant,
        )


def _reduced(gram: Floats, t: Floats) -> tuple[Floats, float]:
    """The inverse of the factor of I + T G T, times T, and the logarithm of its determinant."""
    factor = np.linalg.cholesky(np.eye(len(t)) + t[:, None] * gram * t)
    inverse = np.linalg.solve(factor, np.diag(t))
    return np.asarray(inverse), 2.0 * float(np.log(np.diag(factor)).sum())


@dataclass(frozen=True)
class LinearisedFit:
    """A fit's neighbourhood as a linear model, reduced to products with the process."""

    divisions: ProcessDivisions
    cross: Floats  # (q, p + 1) of the process with Jacobian and residual
    plain: Floats  # (p + 1, p + 1) of Jacobian and residual
    precision: Floats  # (p, p) of priors and tests of the soil
    prior_gradient: Floats  # (p,) half the derivative of -2 ln prior density
    movable: NDArray[np.bool_]  # (p,) not at a bound
    constant: float  # -2 ln prior density of the coordinates

    def along(self, amplitude: Floats, channel: int) -> Floats:
        """Evidence (b,) with each of `AMPLITUDES` in one channel, others at `amplitude`."""
        every = np.arange(len(self.plain))[None, :]
        return np.asarray(self.along_each(amplitude, channel, every)[0])

    def along_each(self, amplitude: Floats, channel: int, columns: Integers) -> Floats:
        """The same of k models, (k, b), each with some columns of Jacobian and residual.

        columns (k, r): Numbers of the coordinates, and that of the residual last.
        """
        part = self.divisions.at(amplitude, channel)
        beside = part.reduce @ self.cross[~part.own]
        rotated = part.vector.T @ (self.cross[part.own] - part.across.T @ beside)
        square = AMPLITUDES[:, None] ** 2
        shrink = square / (1.0 + square * part.value)  # (b, functions)
        plain = self.plain - beside.T @ beside
        explained = (shrink[:, None, :] * rotated.T) @ rotated  # (b, p + 1, p + 1)
        growth = np.log1p(square * part.value).sum(axis=1)
        value = self._evidence(plain - explained, columns) + part.log_determinant + growth
        others = amplitude_penalty(np.delete(amplitude, channel))
        return np.asarray(value + others + _AMPLITUDE_PENALTY)

    def of_columns(self, columns: Integers) -> LinearisedFit:
        """The model with some columns (r,), as in `along_each`."""
        own = columns[:-1]
        return replace(
            self,
            cross=self.cross[:, columns],
            plain=self.plain[np.ix_(columns, columns)],
            precision=self.precision[np.ix_(own, own)],
            prior_gradient=self.prior_gradient[own],
            movable=self.movable[own],
        )

    def step_and_precision(self, product: Floats) -> tuple[Floats, Floats]:
        """Step (p,) to the optimum, and marginal precisions (p,); see `product`."""
        _, step, h = self._solve(product[None], np.arange(len(product))[None, :])
        return step[0, 0], 1.0 / np.diag(np.linalg.inv(h[0, 0]))

    def slope_and_curvature(self, product: Floats) -> tuple[Floats, Floats]:
        """Gradient (p,) and curvature (p, p) of ln p, bounds ignored; see `product`."""
        p = len(self.prior_gradient)
        return product[:p, p] - self.prior_gradient, product[:p, :p] + self.precision

    def product(self, amplitude: Floats) -> Floats:
        """Products (p + 1, p + 1) of Jacobian and residual under amplitudes (channels,)."""
        reduced = self.divisions.reduce(amplitude) @ self.cross
        return np.asarray(self.plain - reduced.T @ reduced)

    def _evidence(self, product: Floats, columns: Integers) -> Floats:
        """Evidence (k, b) without ln|V|; see `_solve`.

        In one Cholesky factor of curvature and gradient, those at a bound after the others, the
        last row has the gradient divided by the factor of the curvature.
        """
        order = np.argsort(~self.movable[columns[:, :-1]], axis=1, kind="stable")
        own = np.take_along_axis(columns[:, :-1], order, axis=1)
        columns = np.column_stack([own, columns[:, -1]])
        both = product + self._of_priors
        try:
            factor = np.linalg.cholesky(both[:, columns[:, :, None], columns[:, None, :]])
        except np.linalg.LinAlgError:  # not positive definite, by rounding
            return self._solve(product, columns)[0]
        gain = (factor[..., -1, :-1] ** 2 * self.movable[own]).sum(axis=-1)
        growth = 2.0 * np.log(factor.diagonal(axis1=-2, axis2=-1)[..., :-1]).sum(axis=-1)
        return np.asarray((product[:, -1, -1, None] - gain + growth + self.constant).T)

    @cached_property
    def _of_priors(self) -> Floats:
        """What priors add to products (p + 1, p + 1); the last makes them positive definite."""
        gradient = -self.prior_gradient[:, None]
        last = gradient.T @ np.linalg.solve(self.precision, gradient)
        return np.block([[self.precision, gradient], [gradient.T, last]])

    def _solve(self, product: Floats, columns: Integers) -> tuple[Floats, Floats, Floats]:
        """Evidence (k, b) without ln|V|, steps (k, b, r - 1) and curvature (k, b, r - 1, r - 1).

        `product`, (b, p + 1, p + 1), has the products of Jacobian and residual under each
        covariance; `columns`, (k, r), are those of each of k models.
        """
        own, last = columns[:, :-1], len(product[0]) - 1
        inner = own[:, :, None], own[:, None, :]
        movable = self.movable[own]  # (k, r - 1)
        h = np.moveaxis(product[:, inner[0], inner[1]], 0, 1) + self.precision[inner][:, None]
        gradient = np.moveaxis(product[:, own, last], 0, 1) - self.prior_gradient[own][:, None]
        gradient = np.where(movable[:, None], gradient, 0.0)
        both = (movable[:, :, None] & movable[:, None, :])[:, None]
        held = np.where(both, h, np.eye(own.shape[1]))  # coordinates at a bound stay there
        step = np.linalg.solve(held, gradient[..., None])[..., 0]
        value = product[:, last, last] - (gradient * step).sum(axis=-1) + np.linalg.slogdet(h)[1]
        return np.asarray(value + self.constant), np.asarray(step), np.asarray(h)


#: Amplitudes of the discrepancy that are tried, in usual ones: none, then steps of a factor of
#: about 1.6, which change the evidence by less than 1 near its maximum.
AMPLITUDES = np.asarray([0.0, 0.15, 0.25, 0.4, 0.6, 1.0, 1.6, 2.5, 4.0, 6.3, 10.0, 16.0, 25.0])
NO_DISCREPANCY = 0.5  # Prior probability that a channel has no discrepancy at all
#: Prior probability that the discrepancy of a channel has a cause which the catalogue lacks, and
#: the scale of its amplitude, in usual ones: 20 % of a range.
UNKNOWN_CAUSE, UNKNOWN_SCALE = 0.02, 10.0


def _amplitude_masses() -> Floats:
    """Prior probability of each of `AMPLITUDES`.

    With probability `NO_DISCREPANCY` a channel has none. Otherwise its amplitude is exponentially
    distributed with a mean of one usual amplitude, or, with probability `UNKNOWN_CAUSE`, that of a
    cause which the catalogue lacks: half-Cauchy with the scale `UNKNOWN_SCALE`, whose heavy tail
    does not reward effects that explain a part of it (Gelman, Bayesian Analysis 1(3), 2006).
    """
    positive = AMPLITUDES[1:]
    edges = np.concatenate([[0.0], np.sqrt(positive[1:] * positive[:-1]), [np.inf]])
    usual, unknown = 1.0 - np.exp(-edges), 2.0 / np.pi * np.arctan(edges / UNKNOWN_SCALE)
    cumulative = (1.0 - UNKNOWN_CAUSE) * usual + UNKNOWN_CAUSE * unknown
    return np.concatenate([[NO_DISCREPANCY], (1.0 - NO_DISCREPANCY) * np.diff(cumulative)])


#: -2 ln of the prior probability of each of `AMPLITUDES`.
_AMPLITUDE_PENALTY = -2.0 * np.log(_amplitude_masses())


def amplitude_penalty(amplitudes: Floats) -> Floats:
    """-2 ln prior probability of amplitudes (..., channels) out of `AMPLITUDES`, (...)."""
    nearest = np.abs(amplitudes[..., None] - AMPLITUDES).argmin(axis=-1)
    return np.asarray(_AMPLITUDE_PENALTY[nearest].sum(axis=-1))
