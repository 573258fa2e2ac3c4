"""The exact posterior of a simulated set: true physics, and the noise that the set truly has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from training.benchmark.sets.posterior_summary import ExactSetPosterior, Unknowns, posterior
from training.set_posterior.monomials import monomials, terms
from training.set_posterior.response_surface import NEAR
from training.set_posterior.wheel_family import ABSENT, CHANNELS, SimulatedSets, WheelFamily

Floats = NDArray[np.float64]

#: Degree of the polynomial through the physics of a set's rows, by the number of unknowns.
DEGREES = {1: 10, 2: 8, 3: 6, 4: 5, 5: 5}
#: Points that it is fitted to, for each of its terms, and samples that it is checked at.
POINTS, CHECKED = 2.0, 32
#: A set is flagged whose polynomial is off by more than this share of a reading's noise, rms.
TOLERANCE = 0.05


def exact_posterior(family: WheelFamily, sets: SimulatedSets, index: int) -> ExactSetPosterior:
    r"""The posterior of one set by the sampler that analytic identification has.

    The likelihood is that of the noise that the set was made with: a share of the *true* value, not
    of its reading. With T_i(x) the torques of the wheel's own physics, sigma_i their noise, tau_i
    the bias that all rows share,

    .. math:: r_i = \frac{y_i - T_i}{\sigma_i}, \quad g_i = \frac{\tau_i}{\sigma_i}, \qquad
        \log p(y | x) = -\frac12 \left(r^T r - \frac{(g^T r)^2}{1 + g^T g}\right)
        - \sum_i \log \sigma_i - \frac12 \log(1 + g^T g)

    The physics of the rows is taken by a polynomial of the unknowns, fitted to this set alone and
    checked at samples of the posterior: a set is flagged where it is not exact to a small share of
    the noise. Physics itself is asked where some soils of the prior do not carry the load.
    """
    unknowns = Unknowns.of(family, sets, index)
    designs, truth = sets.origin.designs[index], sets.origin.x[index]
    answers = _fitted(unknowns, designs)

    def physics(x: Floats) -> Floats:
        return np.concatenate(
            [
                family.answers(designs, piece[None])
                for piece in np.split(x, range(4096, len(x), 4096))
            ],
            axis=1,
        )

    likelihood = log_likelihood(sets, index, answers or physics)
    found, samples = posterior(unknowns, likelihood, truth)
    if answers is None:
        return found
    places = (np.arange(CHECKED) + 0.5) / CHECKED
    drawn = np.searchsorted(np.cumsum(samples.weights), places).clip(max=len(samples.u) - 1)
    x = np.vstack([truth, unknowns.x(samples.u[drawn])])
    off = _apart(sets, index, answers(x), physics(x))
    return replace(found, flagged=found.flagged or not off < TOLERANCE)


def log_likelihood(
    sets: SimulatedSets, index: int, answers: Callable[[Floats], Floats]
) -> Callable[[Floats], Floats]:
    """Log density (n,) of a set's readings at coordinates (n, axes), -inf without equilibrium.

    `answers` gives channels (rows, n, 3) as `Family.answers` does. The factor (2 pi)^(-k / 2) of k
    readings is left out.
    """
    rows = sets.rows(index)

    def logs(x: Floats) -> Floats:
        values = _values(sets, index, answers(x))
        total = np.zeros(values.shape[1])
        for k, name in enumerate(CHANNELS):
            read = rows[f"{name}_std"] < ABSENT
            if not read.any():
                continue
            value, y = values[read, :, k], rows[name][read, None]
            std = _std(sets, index, name, read, value)
            r = (y - value) / std
            total -= np.log(std).sum(axis=0) + 0.5 * (r**2).sum(axis=0)
            if name == "torque":
                g = _std(sets, index, "torque_bias", read, value) / std
                size = 1.0 + (g**2).sum(axis=0)
                total += 0.5 * ((g * r).sum(axis=0) ** 2 / size - np.log(size))
        return np.where(np.isfinite(total), total, -np.inf)

    return logs


def _values(sets: SimulatedSets, index: int, y: Floats) -> Floats:
    """Torque, sinkage and drawbar pull (rows, n, 3) in SI units from a family's answers."""
    length, load = sets.origin.length[index], sets.rows(index)["load"][:, None]
    with np.errstate(over="ignore"):
        return np.stack(
            [np.exp(y[..., 0]) * load * length, np.exp(y[..., 1]) * length, y[..., 2] * load],
            axis=-1,
        )


def _std(
    sets: SimulatedSets, index: int, name: str, read: NDArray[np.bool_], value: Floats
) -> Floats:
    """Noise of values (rows, n); nil where the sets have none of this name."""
    if name not in sets.origin.noise:
        return np.zeros_like(value)
    constant, share = (part[index][read, None] for part in sets.origin.noise[name])
    return np.asarray(np.hypot(constant, share * value))


def _fitted(unknowns: Unknowns, designs: Floats) -> Callable[[Floats], Floats] | None:
    """Channels (rows, n, 3) as polynomials of coordinates; None where a soil carries no load."""
    family, p = unknowns.family, unknowns.count
    these = terms(p, DEGREES[p])
    reach = np.ones(p)
    if p > family.free:
        reach[family.free :] = NEAR * unknowns.near
    count = int(POINTS * len(these))
    u = qmc.Sobol(p, rng=1).random(1 << (count - 1).bit_length())[:count]
    nodes = -np.cos(np.pi * u)  # denser at the ends, as Chebyshev's are
    x = np.zeros((count, len(family.axes)))
    x[:, :p] = nodes * reach
    y = family.answers(designs, x[None])
    if not np.isfinite(y).all():
        return None
    project = np.linalg.pinv(monomials(nodes, these))
    coefficients = project @ y

    def answers(x: Floats) -> Floats:
        return np.asarray(monomials(x[:, :p] / reach, these) @ coefficients)

    return answers


def _apart(sets: SimulatedSets, index: int, y: Floats, true: Floats) -> float:
    """Rms difference of two answers over the noise, of the channels that are read."""
    a, b = _values(sets, index, y), _values(sets, index, true)
    rows, squares = sets.rows(index), []
    for k, name in enumerate(CHANNELS):
        read = rows[f"{name}_std"] < ABSENT
        if read.any():
            std = _std(sets, index, name, read, b[read, :, k])
            squares.append(((a[read, :, k] - b[read, :, k]) / std) ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))
