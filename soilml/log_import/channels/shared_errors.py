"""Errors that all rows share, from the uncertain constants of the map: the table [bias]."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.log_import.mapping.uncertain_value import Uncertain
from soilml.quantities import column

#: What [bias] of a model file can say of a quantity: an offset, a share, or both.
_FORMS = {
    "slip": (True, False),
    "load": (False, True),
    "torque": (True, True),
    "sinkage": (True, False),
    "drawbar_pull": (True, False),
}


@dataclass(frozen=True)
class SharedError:
    """The effect of one uncertain constant on one quantity of the rows: its rms change."""

    constant: str
    quantity: str
    rms: float


def largest_errors(
    found: Sequence[tuple[Mapping[str, Noise], Sequence[SharedError]]],
) -> tuple[dict[str, Noise], list[SharedError]]:
    """What `shared_errors` gave for several wheels as one table [bias]: the largest errors of all.

    Rows of several wheels share one table.
    """
    bias: dict[str, Noise] = {}
    for own, _ in found:
        for key, noise in own.items():
            other = bias.get(key, noise)
            bias[key] = replace(
                noise,
                share=max(noise.share, other.share),
                constant=max(noise.constant, other.constant),
            )
    return bias, [part for _, parts in found for part in parts]


def shared_errors(
    quantities: Callable[[Mapping[str, float]], Mapping[str, Floats]],
    constants: Mapping[str, Uncertain],
) -> tuple[dict[str, Noise], list[SharedError]]:
    """The errors that rows share, by column, and what each constant adds to them.

    quantities: Quantities (rows,) by name, of values of the constants.
    constants: Constants with their standard deviations.
    Each constant is changed by one standard deviation. The change of a quantity counts as relative
    or as an offset, whichever describes the rows better, and as [bias] can state it. Constants are
    taken as independent.
    """
    base = {name: constant.value for name, constant in constants.items()}
    usual = quantities(base)
    share: dict[str, float] = {}
    offset: dict[str, float] = {}
    parts = []
    for name, constant in constants.items():
        if constant.std == 0.0:
            continue
        up = quantities(base | {name: constant.value + constant.std})
        down = quantities(base | {name: constant.value - constant.std})
        for key, (has_offset, has_share) in _FORMS.items():
            if key not in usual:
                continue
            change = np.asarray((np.asarray(up[key]) - np.asarray(down[key])) / 2.0, dtype=float)
            reading = np.asarray(usual[key], dtype=float)
            good = np.isfinite(change) & np.isfinite(reading)
            if not good.any() or not np.any(change[good]):
                continue
            change, reading = np.broadcast_arrays(change[good], reading[good])
            rms = float(np.sqrt(np.mean(change**2)))
            parts.append(SharedError(name, key, rms))
            size = float(np.sqrt(np.mean(reading**2)))
            gain = float(change @ reading) / (len(reading) * size**2) if size else 0.0
            relative_is_better = np.sum((change - gain * reading) ** 2) < np.sum(
                (change - change.mean()) ** 2
            )
            as_share = has_share and size > 0.0 and (relative_is_better or not has_offset)
            if len(reading) == 1 and has_share and has_offset:
                as_share = not name.endswith(("offset", "idle_current"))
            if as_share:
                share[key] = float(np.hypot(share.get(key, 0.0), rms / size))
            else:
                offset[key] = float(np.hypot(offset.get(key, 0.0), rms))
    bias = {
        column(key): Noise(constant=offset.get(key, 0.0), share=share.get(key, 0.0))
        for key in _FORMS
        if key in usual and (key in share or key in offset)
    }
    return bias, parts
