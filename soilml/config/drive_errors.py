"""What a rover's drives report beside the torque on the soil: `[drive]` of a model file."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.io.toml_settings import Settings


@dataclass(frozen=True)
class DriveErrors:
    """Constant of the motors, losses of the drives, and errors of the force balance.

    Standard deviations are those of errors that stay alike from row to row. `loss`, N m, is the
    friction between motor and wheel; the torque on the soil is the reading less it. `gain_std` is
    a share of the torque, in which errors of the model are. `pull_std` is a share of the weight.
    """

    torque_per_ampere: float | None = None  # N m at the wheel for each ampere
    loss: float = 0.0  # N m, of each wheel
    loss_std: float = 0.2  # N m
    gain_std: float = 0.07
    pull_std: float = 0.015  # Constant error of the pitch, and of the pull
    slope_std: float = 0.005  # rad, error of the pitch of a row
    speed_std: float = 0.005  # Error of the rim speed of a row, as a share of it


#: Key of each field in the file.
KEYS = {
    "torque_per_ampere": "torque_per_ampere",
    "loss": "loss_Nm",
    "loss_std": "loss_Nm_std",
    "gain_std": "gain_std",
    "pull_std": "pull_std",
    "slope_std": "slope_rad_std",
    "speed_std": "rim_speed_std",
}


def take_drive(settings: Settings) -> DriveErrors:
    """Read `[drive]`; every key may be left out.

    Raises `InputError` for an unknown key or a value out of bounds.
    """
    known = DriveErrors()
    constant = None
    if "torque_per_ampere" in settings:
        constant = _number(settings, "torque_per_ampere", 0.0, 1e-6, 1e6, "N m/A")
    found = DriveErrors(
        constant,
        _number(settings, "loss_Nm", known.loss, 0.0, 1e5, "N m"),
        _number(settings, "loss_Nm_std", known.loss_std, 0.0, 1e5, "N m"),
        _number(settings, "gain_std", known.gain_std, 0.0, 1.0, "as a share of the torque"),
        _number(settings, "pull_std", known.pull_std, 1e-4, 1.0, "as a share of the weight"),
        _number(settings, "slope_rad_std", known.slope_std, 0.0, 0.5, "rad"),
        _number(settings, "rim_speed_std", known.speed_std, 0.0, 0.2, "as a share of the speed"),
    )
    settings.finish()
    return found


def _number(
    settings: Settings, key: str, default: float, low: float, high: float, unit: str
) -> float:
    value = settings.number(key, default)
    if not low <= value <= high:
        settings.fail(f"{key} is {value:g}; needed is a number from {low:g} to {high:g}, {unit}")
    return value
