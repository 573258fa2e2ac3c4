"""Wheels and soils to choose from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from soilml.physics.gears import Track, Wheel
from soilml.physics.gears.base import Gear
from soilml.physics.soils import soil_catalogue


@dataclass(frozen=True)
class WheelChoice:
    """A running gear of the list, with the load (N) that it usually carries."""

    label: str
    source: str
    gear: Callable[[], Gear]
    load: float


#: Running gears by the name that the page sends.
WHEELS: dict[str, WheelChoice] = {
    "example": WheelChoice(
        "Wheel of the README, 150 × 120 mm",
        "radius 150 mm, width 120 mm: the wheel of the examples and of the released model files",
        lambda: Wheel(radius=0.15, width=0.12),
        60.0,
    ),
    "nagatani2009": WheelChoice(
        "Force-sensor wheel, 55 × 64 mm",
        "Nagatani et al. 2009: wheel with force sensors in its rim",
        lambda: Wheel(radius=0.055, width=0.064),
        28.92,
    ),
    "kls1": WheelChoice(
        "Wheel of the KLS-1 tests, 85 × 80 mm",
        "the smooth wheel of the tests on the lunar simulant KLS-1",
        lambda: Wheel(radius=0.085, width=0.080),
        58.9,
    ),
    "comin2017": WheelChoice(
        "Wheel beside the wheel-legs, 150 × 180 mm",
        "Comin and Saaj 2017: the wheel that wheel-legs are compared with",
        lambda: Wheel(radius=0.15, width=0.18),
        490.5,
    ),
    "wang2018": WheelChoice(
        "Track of the tracked robot, 600 mm long",
        "Wang et al. 2018: one of two tracks of a robot of 130 kg",
        lambda: Track(radius=0.1, width=0.08, base=0.6),
        637.6,
    ),
}
#: What the page shows first.
FIRST_WHEEL, FIRST_SOIL = "example", "wong1989/dry_sand"


def choices() -> dict[str, Any]:
    """The lists of the page."""
    from soilml import __version__

    return {
        "version": __version__,
        "wheels": [
            {"id": key, "label": wheel.label, "note": wheel.source} for key, wheel in WHEELS.items()
        ],
        "soils": [
            {"id": name, "label": f"{entry.text} – {name}", "note": _source(entry)}
            for name, entry in soil_catalogue().items()
        ],
        "first": {"wheel": FIRST_WHEEL, "soil": FIRST_SOIL},
    }


def _source(entry: Any) -> str:
    assumed = f"; assumed, not printed there: {', '.join(entry.assumed)}" if entry.assumed else ""
    return f"{entry.source}{assumed}"
