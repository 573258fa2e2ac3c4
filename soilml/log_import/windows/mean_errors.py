"""Standard errors of means of autocorrelated samples, and of travel over rim displacement."""

from __future__ import annotations

import numpy as np

from soilml.arrays import Floats

#: Samples are first averaged to at most this many, which lowers the noise in their correlations.
_MOST_VALUES = 256
_RIPPLE = -0.3  # Correlation below which samples count as having a ripple
_COSINES = 6  # Cosines that measure slow noise: few enough to lie below the frequency of grousers
#: Fewest independent samples, and degrees of freedom, that an error counts with.
_FEWEST, _LEAST_FREEDOM = 4.0, 4.0
#: Degrees of freedom of a window's own error, and those that the usual error counts with.
_OWN, _USUAL = 8.0, 4.0
_FEWEST_WINDOWS = 4  # Fewest windows that tell what is usual
#: Most parts that a window is divided into, for its rates; least share of their slow variance that
#: is no noise of the places.
_PARTS, _LEAST_SLOW = 128, 0.1


def time_and_window(values: Floats) -> tuple[float, int, float]:
    r"""Integrated autocorrelation time of samples (n,), in samples, and the last lag M of its sum.

    The third number is the lowest correlation: well below zero where the samples have a ripple.

    .. math:: \tau = 1 + 2 \sum_{k=1}^{M} \rho_k

    summed by the initial monotone sequence of Geyer, "Practical Markov chain Monte Carlo", Stat.
    Sci. 7 (1992), section 3.3: the sums of neighbouring pairs, as long as they are positive and do
    not grow. The bias from the mean is corrected to first order, by
    :math:`1 + (2 M + 1) / n`: Wolff, Comput. Phys. Commun. 156 (2004), equation 49. It is at
    least 1.
    """
    n = values.size
    centred = values - values.mean()
    variance = float(np.mean(centred**2))
    # below rounding, a constant has no autocorrelation
    if n < 4 or variance <= 1e-24 * max(1e-300, float(np.mean(values**2))):
        return 1.0, 0, 0.0
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(centred, size)
    rho = np.fft.irfft(spectrum * np.conj(spectrum), size)[: n // 2 * 2] / (n * variance)
    pairs = rho[::2] + rho[1::2]
    below = np.flatnonzero(pairs <= 0.0)
    count = max(1, int(below[0])) if below.size else pairs.size
    tau = 2.0 * float(np.minimum.accumulate(pairs[:count]).sum()) - 1.0
    last = 2 * count - 1
    time = float(np.clip(tau * (1.0 + (2.0 * last + 1.0) / n), 1.0, n / 2.0))
    return time, last, float(rho.min())


def mean_error(values: Floats, step: float) -> tuple[float, float, float]:
    r"""Mean of samples (n,), its standard error, and the autocorrelation time in s.

    .. math:: \sigma^2 = \frac{\tau}{n} s^2 \frac{1}{1 - \tau / n} \frac{\nu}{\nu - 2},
              \quad \nu = \frac{n}{2 M + 1}

    The variance of the estimate of tau is :math:`2 (2 M + 1) / n \, \tau^2` (Sokal, "Monte Carlo
    methods in statistical mechanics", 1997, equation 3.19), that of a chi-squared variable with
    :math:`\nu` degrees of freedom over :math:`\nu`: the last factor makes the error the standard
    deviation of the t distribution that follows. NaN are left out.

    Where a ripple hides slow noise, the correlations turn negative and the sum ends too early. The
    error is then at least that of `slow_error`.
    """
    own = values[np.isfinite(values)]
    if own.size == 0:
        return float("nan"), float("nan"), float("nan")
    if own.size < 4:
        return float(own.mean()), float("nan"), step
    total, width = own.size, -(-own.size // _MOST_VALUES)
    own = own[: total // width * width].reshape(-1, width).mean(axis=1)
    tau, last, lowest = time_and_window(own)
    independent = max(own.size / tau, _FEWEST)
    freedom = max(own.size / (2.0 * last + 1.0), _LEAST_FREEDOM)
    variance = float(np.var(own)) / independent / (1.0 - 1.0 / independent)
    error = float(np.sqrt(variance * freedom / (freedom - 2.0)))
    return (
        float(own.mean()),
        max(error, slow_error(own)) if lowest < _RIPPLE else error,
        tau * width * step,
    )


def slow_error(values: Floats) -> float:
    r"""Standard error of the mean of samples (n,) by their slowest variations; 0 for few samples.

    .. math:: \sigma^2 = \frac{1}{n} \frac{1}{B} \sum_{j=1}^{B} \Lambda_j^2 \frac{B}{B - 2}, \quad
        \Lambda_j = \sqrt{2 / n} \sum_{t=1}^{n} \cos(\pi j (t - 1/2) / n) \, y_t

    The spectral density at frequency zero from B cosines, with B degrees of freedom: Lazarus and
    others, "HAR inference", J. Bus. Econ. Stat. 36 (2018), section 2. A ripple of more than B / 2
    periods does not enter.
    """
    n = values.size
    if n < 2 * _COSINES:
        return 0.0
    return float(np.sqrt(np.sum(_slow_powers(values)) / (n * (_COSINES - 2.0))))


def _slow_powers(values: Floats) -> Floats:
    """The squares of Lambda_j of samples (n,), (B,)."""
    n = values.size
    phase = np.pi * (np.arange(n) + 0.5) / n
    weights = np.sqrt(2.0 / n) * np.cos(np.arange(1, _COSINES + 1)[:, None] * phase)
    return np.asarray((weights @ values) ** 2)


def pooled_errors(errors: Floats, lengths: Floats) -> Floats:
    r"""Errors (windows,) of means, each drawn to the usual one; NaN stay.

    .. math:: \tilde\sigma^2 = (\nu \sigma^2 + \nu_0 S / t) / (\nu + \nu_0)

    The error of one window comes from some ten independent pieces, and is by chance half or twice
    as large as it should be. S is the median over windows of the squared error times the length t,
    which does not depend on the length. From Smyth, "Linear models and empirical Bayes methods",
    Stat. Appl. Genet. Mol. Biol. 3 (2004), equation 6, here with fixed degrees of freedom.
    """
    known = np.isfinite(errors) & (errors > 0.0)
    if known.sum() < _FEWEST_WINDOWS:
        return errors
    usual = float(np.median(errors[known] ** 2 * lengths[known]))
    with np.errstate(invalid="ignore"):
        pooled = np.sqrt((_OWN * errors**2 + _USUAL * usual / lengths) / (_OWN + _USUAL))
    return np.asarray(np.where(known, pooled, errors))


def travel_ratio(
    step: float,
    rim: Floats,
    ground: Floats,
    rim_is_place: bool,
    ground_is_place: bool,
    interval: float = 0.0,
) -> tuple[float, float, float, float]:
    r"""Ratio k of travel to rim displacement, its standard error, and both mean speeds, m/s.

    `rim` and `ground` (n,) are speeds in m/s, or places in m. The mean speed of a place is the
    slope of its least-squares line. `interval` is the sampling interval of the slower place, s,
    where it is interpolated to the step.

    What the two differ by, :math:`E = x - k R`, wanders by real fluctuations of slip and is
    blurred by noise of the places. Its rates from part to part of the window have a long-run
    variance S, in which the noise of the places cancels: what it adds to one part it takes from
    the next. The slope of a line over the time t has the variance :math:`6 S / (5 t)`, to which
    that of the noise is added. For two speeds the error is that of the mean of the rates.
    """
    both = np.isfinite(rim) & np.isfinite(ground)
    if both.sum() < 8:
        return (float("nan"),) * 4
    time: Floats = step * np.arange(rim.size, dtype=np.float64)
    rim_rate = _slope(time[both], rim[both]) if rim_is_place else float(rim[both].mean())
    rate = _slope(time[both], ground[both]) if ground_is_place else float(ground[both].mean())
    if rim_rate == 0.0:
        return float("nan"), float("nan"), rim_rate, rate
    ratio = rate / rim_rate
    if not (rim_is_place or ground_is_place):
        error = mean_error((ground - ratio * rim)[both], step)[1]
        return ratio, error / abs(rim_rate), rim_rate, rate
    places = [
        own if is_place else step * np.cumsum(np.where(np.isfinite(own), own, np.nanmean(own)))
        for own, is_place in ((ground, ground_is_place), (rim, rim_is_place))
    ]
    error = _slope_error(time[both], (places[0] - ratio * places[1])[both], interval)
    return ratio, error / abs(rim_rate), rim_rate, rate


def _slope(time: Floats, values: Floats) -> float:
    centred = time - time.mean()
    return float(centred @ values / (centred @ centred))


def _slope_error(time: Floats, difference: Floats, interval: float) -> float:
    r"""Standard error of the mean rate of a place (n,) that wanders and is noisy, m/s.

    .. math:: \sigma^2 = \frac{6}{5} \sigma_s^2 + \frac{12 \sigma_p^2}{m t^2}

    with the slow error of the rates between the means of m parts, less what the noise of the
    places adds to it; the noise of a mean is that of second differences.
    """
    span = float(time[-1] - time[0])
    residual = difference - difference.mean() - _slope(time, difference) * (time - time.mean())
    count = min(_PARTS, residual.size // 2)
    if interval > 0.0:
        # between two samples a place is a straight line, in which noise looks like real motion
        count = max(min(count, int(span / (2.0 * interval))), min(2 * _COSINES + 1, count))
    edges = np.linspace(0, residual.size, count + 1).astype(int)
    means = np.asarray([part.mean() for part in np.split(residual, edges[1:-1])])
    powers, rate = _slow_powers(np.diff(means) * count / span), count / span
    noise = float(np.mean(np.diff(means, 2) ** 2)) / 6.0
    added = 2.0 * noise * rate**2 * (1.0 - np.cos(np.pi * np.arange(1, _COSINES + 1) / count))
    slow = max(float(np.sum(powers - added)), _LEAST_SLOW * float(np.sum(powers)))
    slow /= (count - 1.0) * (_COSINES - 2.0)
    return float(np.sqrt(1.2 * slow + 12.0 * noise / (count * span**2)))
