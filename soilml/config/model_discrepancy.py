"""Model discrepancy: how far the model is usually from the readings, beyond their noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.measurement_noise import share_and_constant_as_setting, take_share_and_constant
from soilml.io.toml_settings import Settings
from soilml.quantities import CHANNELS, column

#: Correlation lengths in slip and in the logarithm of the load, where none is given: errors of a
#: terramechanics model keep their sign over about a third of the slips from 0 to 1, and over loads
#: within a factor of two.
SLIP_LENGTH, LOG_LOAD_LENGTH = 0.3, 0.6


@dataclass(frozen=True)
class Discrepancy:
    r"""A smooth error of the model in one channel, as a Gaussian process of zero mean.

    .. math::
        \operatorname{cov}[\delta(s, W), \delta(s', W')] = a^2
        e^{-(s - s')^2 / (2 l_s^2) - (\ln W - \ln W')^2 / (2 l_W^2)}

    References: Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2.
    """

    constant: float = 0.0  # Absolute part of the amplitude a, in the unit of the column
    # Relative part of the amplitude, as a fraction of the range of the channel's readings
    share: float = 0.0
    slip_length: float = SLIP_LENGTH  # Correlation length l_s in slip
    # Correlation length l_W in the natural logarithm of the load
    log_load_length: float = LOG_LOAD_LENGTH

    def amplitude(self, span: float) -> float:
        """Standard deviation a of the model error, in the unit of the column.

        `span` is the range of the channel's readings, which `range_with_zero` returns.

        >>> Discrepancy(share=0.02).amplitude(50.0)
        1.0
        """
        return math.hypot(self.constant, self.share * span)

    def as_setting(self) -> Any:
        """The amplitude as it is written in TOML."""
        return share_and_constant_as_setting(self.share, self.constant)


def range_with_zero(readings: NDArray[np.float64]) -> float:
    """max(y, 0) - min(y, 0) of the readings that are not NaN; zero where there is none.

    It includes zero, so that a channel with nearly equal readings has the range of its size.

    >>> range_with_zero(np.asarray([9.0, np.nan, 10.0]))
    10.0
    """
    known = readings[np.isfinite(readings)]
    return float(np.max(known, initial=0.0) - np.min(known, initial=0.0))


def take_discrepancy(settings: Settings) -> dict[str, Discrepancy]:
    """Read the table [discrepancy]: an amplitude by column, and lengths that all columns share."""
    keys = [column(name) for name in CHANNELS]
    needed = "a number in the column's unit, '2 %' of the readings' range, or '2 % + 0.1'"
    settings.permit(keys)
    parts = {k: take_share_and_constant(settings, k, needed) for k in keys if k in settings}
    common = Discrepancy(
        slip_length=_take_length(settings, "slip_length", SLIP_LENGTH),
        log_load_length=_take_length(settings, "log_load_length", LOG_LOAD_LENGTH),
    )
    settings.finish()
    if settings.content and not parts:
        settings.fail(f"no channel has a discrepancy; give torque_Nm = '2 %', or {keys[1]}, ...")
    return {key: replace(common, share=s, constant=c) for key, (s, c) in parts.items()}


def discrepancy_as_settings(discrepancy: dict[str, Discrepancy]) -> dict[str, Any]:
    """The keys of the table [discrepancy]; a default length is not written.

    Raises `ValueError` where two channels differ in a correlation length, which the table cannot
    state.
    """
    settings = {key: one.as_setting() for key, one in discrepancy.items()}
    for name, usual in (("slip_length", SLIP_LENGTH), ("log_load_length", LOG_LOAD_LENGTH)):
        lengths = {getattr(one, name) for one in discrepancy.values()}
        if len(lengths) > 1:
            raise ValueError(f"channels differ in {name}: {sorted(lengths)}; one can be written")
        if lengths and lengths != {usual}:
            settings[name] = lengths.pop()
    return settings


def _take_length(settings: Settings, key: str, default: float) -> float:
    length = settings.number(key, default)
    if not (math.isfinite(length) and length > 0.0):
        settings.fail(f"{key} is {length:g}; a correlation length must be above zero")
    return length
