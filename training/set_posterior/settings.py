"""How much is simulated and learned of a wheel's answers, as a spec says it."""

from __future__ import annotations

from soilml.io.toml_settings import Settings
from training.set_posterior.response_surface import ResponseSettings

#: With fewer ways to drive no network learns how a wheel answers.
LEAST_DESIGNS = 512
#: More than these, and a laptop works for days.
MOST = {"designs": 10**7, "hidden": 1024, "epochs": 10**5}


def take_response_settings(settings: Settings, seed: int) -> ResponseSettings:
    """Read [set_posterior]; raises `InputError` naming the key."""
    own = settings.table("set_posterior")
    counts = {key: own.count(key) for key in MOST}
    for key, most in MOST.items():
        if counts[key] > most:
            own.fail(f"{key} is {counts[key]}; needed is at most {most}")
    if counts["designs"] < LEAST_DESIGNS:
        own.fail(f"designs is {counts['designs']}; needed are {LEAST_DESIGNS} or more")
    own.finish()
    return ResponseSettings(**counts, seed=seed)
