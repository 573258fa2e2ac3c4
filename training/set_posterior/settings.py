"""The settings [set_posterior] of a spec."""

from __future__ import annotations

from soilml.io.toml_settings import Settings
from training.set_posterior.response_surface import ResponseSettings

#: With fewer operating conditions no network learns the response of a wheel.
LEAST_DESIGNS = 512
#: Upper limits, beyond which training takes days on a laptop.
UPPER_LIMITS = {"designs": 10**7, "hidden": 1024, "epochs": 10**5}


def take_response_settings(settings: Settings, seed: int) -> ResponseSettings:
    """Read [set_posterior]; raises `InputError` naming the key."""
    table = settings.table("set_posterior")
    counts = {key: table.count(key) for key in UPPER_LIMITS}
    for key, most in UPPER_LIMITS.items():
        if counts[key] > most:
            table.fail(f"{key} is {counts[key]}; needed is at most {most}")
    if counts["designs"] < LEAST_DESIGNS:
        table.fail(f"designs is {counts['designs']}; needed are {LEAST_DESIGNS} or more")
    table.finish()
    return ResponseSettings(**counts, seed=seed)
