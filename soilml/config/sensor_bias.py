"""Errors that all readings of a sensor share, as they are declared in `[bias]`."""

from __future__ import annotations

from collections.abc import Mapping

from soilml.config.measurement_noise import Noise
from soilml.config.share_and_constant import take_share_and_constant
from soilml.io.toml_settings import Settings
from soilml.quantities import column

#: What a model file for the board knows of a sensor's bias: by column, the name of its offset and
#: the name of its relative error.
KNOWN_PARTS: dict[str, tuple[str | None, str | None]] = {
    column("slip"): ("slip_bias", None),
    column("load"): (None, "load_gain"),
    column("torque"): ("torque_bias", "torque_gain"),
    column("sinkage"): ("sinkage_bias", None),
    column("drawbar_pull"): ("drawbar_pull_bias", None),
}


#: The same as effects of the catalogue: of an offset, and of a relative error.
_EFFECTS: dict[str, tuple[str, str]] = {
    column("slip"): ("slip-offset", ""),
    column("load"): ("", "load-gain"),
    column("torque"): ("torque-offset", "torque-gain"),
    column("sinkage"): ("sinkage-offset", ""),
    column("drawbar_pull"): ("drawbar-offset", ""),
}
#: Forms of a bias in a message; unlike noise, it may be zero.
NEEDED = "a number in the column's unit, '2 %' of the reading, or '2 % + 0.05'"


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
        share, constant = take_share_and_constant(settings, key, NEEDED)
        bias = Noise(constant=constant, share=share)
        if bias.share and gain is None:
            settings.fail(f"{key} has a bias in its own unit; needed is a number without %")
        if bias.constant and offset is None:
            settings.fail(f"{key} has a relative bias; needed is '1 %'")
        found[key] = bias
    settings.finish()
    return found


def checked_sensors(bias: Mapping[str, Noise]) -> dict[str, float]:
    """Standard deviations of faults of sensors, by effect, as `gap` takes them: those above zero.

    A declared error becomes the size of the fault that an analysis may find.
    """
    sizes: dict[str, float] = {}
    for key, declared in bias.items():
        offset, gain = _EFFECTS[key]
        sizes |= {offset: declared.constant} if offset else {}
        sizes |= {gain: declared.share} if gain else {}
    return {name: size for name, size in sizes.items() if size > 0.0}


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
