"""Errors of sensors and of the model, as a model file states them: noise, bias, discrepancy.

Noise is of each reading; a bias is shared by all readings of a sensor. Both have an absolute part
and one relative to the reading: `0.05`, `"2 %"` or `"2 % + 0.05"`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.parameters import Parameter
from soilml.quantities import CHANNELS, column

#: Largest share of a reading, and largest constant part, in the unit of any column.
MOST_SHARE, MOST_CONSTANT = 100.0, 1e9
_SHARE = re.compile(r"\s*([0-9.eE+-]+)\s*%\s*(?:\+\s*([0-9.eE+-]+)\s*)?")

#: What a model file for the board knows of a sensor's bias: by column, the name of its offset and
#: the name of its relative error.
KNOWN_PARTS: dict[str, tuple[str | None, str | None]] = {
    column("slip"): ("slip_bias", None),
    column("load"): (None, "load_gain"),
    column("torque"): ("torque_bias", "torque_gain"),
    column("sinkage"): ("sinkage_bias", None),
    column("drawbar_pull"): ("drawbar_pull_bias", None),
}
#: The effect of the catalogue that stands for each of these errors.
EFFECT_OF_ERROR = {
    "slip_bias": "slip-offset", "load_gain": "load-gain", "torque_bias": "torque-offset",
    "torque_gain": "torque-gain", "sinkage_bias": "sinkage-offset",
    "drawbar_pull_bias": "drawbar-offset",
}  # fmt: skip
#: Forms of a noise or bias in a message; a bias may be zero.
NEEDED = "a number in the column's unit, '2 %' of the reading, or '2 % + 0.05'"


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a sensor, from an absolute and a relative part in quadrature."""

    constant: float = 0.0  # In the unit of the column
    share: float = 0.0  # As a fraction of the reading

    def std(self, reading: Any) -> Any:
        """Standard deviation (...) at readings (...), in their unit."""
        relative = self.share * np.abs(reading)
        if self.constant == 0.0:
            return relative
        return np.sqrt(self.constant**2 + relative**2)  # in half the time of hypot

    def as_setting(self) -> Any:
        """As it is written in TOML."""
        text = f"{100 * self.share:.15g} %"
        if self.share and self.constant:
            return f"{text} + {self.constant!r}"
        return text if self.share else self.constant


@dataclass(frozen=True)
class NoiseOfReading:
    """What a key holds that may be `0.05`, `"2 %"` or `"2 % + 0.05"`, zero included."""

    needed: str = NEEDED

    def take(self, settings: Settings, key: str, kind: str = "") -> Noise:
        """The two parts; raises `InputError` for another form, and for a part that is negative or
        too large.
        """
        value = settings.take(key, (int, float, str), self.needed)
        match = _SHARE.fullmatch(value) if isinstance(value, str) else None
        try:
            share = float(match[1]) / 100.0 if match else 0.0
            constant = float((match[2] or 0.0) if match else value)
            if isinstance(value, str) and not match:
                raise ValueError
        except ValueError:
            settings.fail(f"{key} is {value!r}; needed is {self.needed}")
        if not (math.isfinite(share + constant) and share >= 0.0 and constant >= 0.0):
            settings.fail(
                f"{key} is {value!r}; a standard deviation is a finite number, zero or more"
            )
        if share > MOST_SHARE or constant > MOST_CONSTANT:
            settings.fail(
                f"{key} is {value!r}; a standard deviation is at most {100 * MOST_SHARE:g} % and "
                f"{MOST_CONSTANT:g}"
            )
        return Noise(constant, share)


def take_noise(settings: Settings, key: str) -> Noise:
    """Read `key = 0.05`, `key = "2 %"` or `key = "2 % + 0.05"`."""
    noise = NoiseOfReading().take(settings, key)
    if noise == Noise():
        shown = settings.content[key]
        settings.fail(f"{key} is {shown!r}; a standard deviation must be above zero")
    return noise


def take_bias(settings: Settings) -> dict[str, Noise]:
    """Read `[bias]`: by column, the standard deviation of its offset, its relative error, or both.

    Raises `InputError` for a column without a bias, and for a part that it cannot have: slip,
    sinkage and drawbar pull have an offset, load has a relative error, torque has both.
    """
    settings.permit(KNOWN_PARTS)
    found = {}
    for key, (offset, gain) in KNOWN_PARTS.items():
        if key not in settings:
            continue
        bias = NoiseOfReading().take(settings, key)
        if bias.share and gain is None:
            settings.fail(f"{key} has a bias in its own unit; needed is a number without %")
        if bias.constant and offset is None:
            settings.fail(f"{key} has a relative bias; needed is '1 %'")
        found[key] = bias
    settings.finish()
    return found


def checked_sensors(bias: Mapping[str, Noise]) -> dict[str, float]:
    """Declared errors above zero as standard deviations of the faults that `gap` may find."""
    return {EFFECT_OF_ERROR[name]: std for name, std in common_errors(bias).items() if std > 0.0}


def unestimated_bias(bias: Mapping[str, Noise], effects: Collection[str]) -> dict[str, Noise]:
    """The declared errors without those for which a model has one of these effects instead."""
    left = {}
    for key, declared in bias.items():
        offset, gain = (EFFECT_OF_ERROR.get(part or "") in effects for part in KNOWN_PARTS[key])
        left[key] = Noise(0.0 if offset else declared.constant, 0.0 if gain else declared.share)
    return left


def common_errors(bias: Mapping[str, Noise]) -> dict[str, float]:
    """Standard deviations of the errors that all readings share, by name, of declared columns.

    A column that is declared has no error other than the one declared.
    """
    errors: dict[str, float] = {}
    for key, declared in bias.items():
        offset, gain = KNOWN_PARTS[key]
        errors |= {offset: declared.constant} if offset else {}
        errors |= {gain: declared.share} if gain else {}
    return errors


#: Correlation lengths in slip and in the logarithm of the load, where none is given: errors of a
#: terramechanics model keep their sign over about a third of the slips from 0 to 1, and over loads
#: within a factor of two.
SLIP_LENGTH, LOG_LOAD_LENGTH = 0.3, 0.6
_LENGTH = Parameter("1", 1e-6, 1e6, "correlation length")


LEARNED = "learned"  # Key of a discrepancy that `gap` found


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
    # Correlation lengths: l_s in slip, and l_W in the natural logarithm of the load
    slip_length: Annotated[float, _LENGTH] = SLIP_LENGTH
    log_load_length: Annotated[float, _LENGTH] = LOG_LOAD_LENGTH
    learned: bool = False  # `gap` found it beside a fit; a further analysis finds it anew

    def amplitude(self, span: float) -> float:
        """Standard deviation a of the model error, in the unit of the column.

        `span` is the range of the channel's readings, which `range_with_zero` returns.

        >>> Discrepancy(share=0.02).amplitude(50.0)
        1.0
        """
        return math.hypot(self.constant, self.share * span)

    def as_setting(self) -> Any:
        """The amplitude as it is written in TOML."""
        return Noise(self.constant, self.share).as_setting()


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
    form = NoiseOfReading(
        "a number in the column's unit, '2 %' of the readings' range, or '2 % + 0.1'"
    )
    settings.permit(keys)
    parts = {k: form.take(settings, k) for k in keys if k in settings}
    common = take_declared(Discrepancy, settings, constant=0.0, share=0.0)
    if settings.content and not parts:
        settings.fail(f"no channel has a discrepancy; give torque_Nm = '2 %', or {keys[1]}, ...")
    return {k: replace(common, share=n.share, constant=n.constant) for k, n in parts.items()}


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
    if any(one.learned for one in discrepancy.values()):
        settings[LEARNED] = True
    return settings
