"""The posterior of the full model: what rows, noise and prior together allow to be known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification.diagnostics import with_warnings
from soilml.identification.fit_result import Fit
from soilml.identification.free_parameters import FreeParameter
from soilml.identification.observations import Observations
from soilml.identification.predictions import input_noise, predicted, readings, stack_readings
from soilml.numerics.importance_sampling import (
    LEAST_EFFECTIVE_SIZE,
    ImportanceSample,
    importance_sample,
)
from soilml.quantities import column

Floats = NDArray[np.float64]

#: Fractions of the posterior below the ends of the interval that is reported.
INTERVAL = np.asarray([0.05, 0.95])
#: Effective samples below which neither mean nor spread of the samples mean anything.
FEWEST = 50.0
#: Standard deviations that a Gaussian exceeds once in a thousand times.
RARE = 3.09
#: Most model evaluations in one call, which bounds memory.
CELLS = 200_000


def posterior(case: Case, data: Observations, free: Sequence[FreeParameter]) -> Fit:
    r"""Mean, covariance and 90 % interval of the exact posterior, by importance sampling.

    .. math::
        p(\theta | y) \propto p(\theta) \prod_i \frac{1}{\sigma_i(\theta)}
        \exp\left[-\frac{(y_i - f(s_i, W_i; \theta))^2}{2 \sigma_i(\theta)^2}\right]

    Its mean is the estimate with the least expected squared error that any method can have on data
    that come from this model, prior and noise: the Bayes limit. Noise that is a share is a share
    of the prediction, and noise of slip and load adds to it as in the nonlinear method, at the
    best sample. Needs all noise declared. A parameter that the rows do not determine comes out as
    its prior. References: Tarantola, Inverse Problem Theory, 2005, section 1.5; Cornuet et al.
    2012 for the sampling. Residuals beyond the declared noise are taken for noise too, as in the
    nonlinear method: the posterior is drawn again with all noise larger by as much (of sets
    that the model does hold for, one in a thousand is). That is no cure where it lacks an effect.
    """
    found, misfit, surplus = settled_samples(case, data, free)
    values = np.stack([f.prior.at(found.u[:, i]) for i, f in enumerate(free)], axis=1)
    mean = found.mean(values)
    off = values - mean
    low, high = found.quantiles(values, INTERVAL)
    middle = np.asarray([f.prior.fraction(float(m)) for f, m in zip(free, mean, strict=True)])
    covariance = (off.T * found.weights) @ off
    fit = Fit(
        method="posterior",
        names=tuple(f.path for f in free),
        units=tuple(f.unit for f in free),
        values=mean,
        covariance=covariance,
        warnings=_unsettled(found),
        rows_used=len(data.slip),
        left={f.path: float(np.sqrt(covariance[i, i]) / f.prior.std) for i, f in enumerate(free)},
        misfit=misfit,
        channels=tuple(column(c.name) for c in data.channels),
        low=low,
        high=high,
    )
    return with_warnings(fit, case, data, free, middle, surplus=surplus, undeclared=False)


def settled_samples(
    case: Case, data: Observations, free: Sequence[FreeParameter]
) -> tuple[ImportanceSample, float, bool]:
    """Weighted samples of the posterior, misfit, and whether noise had to be taken for larger."""
    found, misfit, cells = sampled(case, data, free)
    surplus = misfit > most_misfit(cells - len(free))
    if surplus:
        found, _, _ = sampled(case, data, free, larger=float(np.sqrt(misfit)))
    return found, misfit, surplus


def sampled(
    case: Case,
    data: Observations,
    free: Sequence[FreeParameter],
    seed: int = 0,
    larger: float = 1.0,
) -> tuple[ImportanceSample, float, int]:
    """Weighted fractions of the priors, misfit of the best of them, and how many readings.

    `larger` multiplies all noise.
    """
    if any(not c.declared for c in data.channels):
        names = ", ".join(column(c.name) for c in data.channels if not c.declared)
        raise FitError(f"the posterior method needs the noise of {names}: declare it in [noise]")
    reading, declared = readings(data)
    best: dict[str, Floats] = {}

    def log_density(u: Floats) -> Floats:
        step = max(CELLS // len(data.slip), 1)
        parts = [_log(u[i : i + step]) for i in range(0, len(u), step)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _log(u: Floats) -> Floats:
        y = stack_readings(data, predicted(case, free, u, data.at))
        std = _noise(case, data, y, declared)
        if not best:
            first = np.nan_to_num(((y - reading) / std) ** 2, nan=np.inf).sum(axis=1)
            best["extra"] = input_noise(case, data, free, u[int(np.argmin(first))])
        std = larger * np.hypot(std, best["extra"])
        logs = -0.5 * (((y - reading) / std) ** 2).sum(axis=1) - np.log(std).sum(axis=1)
        return np.where(np.isfinite(logs), logs, -np.inf)

    found = importance_sample(log_density, len(free), seed)
    if not np.isfinite(found.evidence):
        raise FitError(
            "the model carries these loads nowhere in the prior: check load_N, kphi, n and [gear]"
        )
    if found.effective < FEWEST:
        raise FitError(
            f"the samples are worth {found.effective:.0f} only, too few for a mean and a spread: "
            "the rows allow too narrow a part of the prior; try the nonlinear method, or narrow "
            "[soil.prior]"
        )
    top = found.u[[int(np.argmax(found.weights))]]
    y = stack_readings(data, predicted(case, free, top, data.at))
    std = np.hypot(_noise(case, data, y, declared), best["extra"])
    cost = float((((y - reading) / std) ** 2).sum())
    return found, cost / max(reading.size - len(free), 1), reading.size


def _noise(case: Case, data: Observations, y: Floats, declared: Floats) -> Floats:
    """Standard deviations (sets, cells): those of [noise] at the predictions, others as given."""
    std, start = np.broadcast_to(declared, y.shape).copy(), 0
    for c in data.channels:
        kept = np.isfinite(c.reading)
        cells = slice(start, start + int(kept.sum()))
        start = cells.stop
        noise = case.noise.get(column(c.name))
        if noise is not None:
            own = declared[cells] == noise.std(c.reading[kept])
            expected = noise.std(y[:, cells])
            std[:, cells] = np.where(own & (expected > 0), expected, std[:, cells])
    return std


def _unsettled(found: ImportanceSample) -> tuple[str, ...]:
    if found.effective >= 0.5 * LEAST_EFFECTIVE_SIZE:
        return ()
    return (
        f"the samples are worth {found.effective:.0f} only: the values may stray by "
        f"{100 / np.sqrt(found.effective):.0f} % of their std",
    )


def most_misfit(freedom: int) -> float:
    """Misfit that one set in a thousand exceeds by noise alone (Wilson and Hilferty 1931)."""
    if freedom < 1:
        return np.inf
    step = 2.0 / (9.0 * freedom)
    return float((1.0 - step + RARE * np.sqrt(step)) ** 3)
