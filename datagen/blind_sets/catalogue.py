"""The catalogue of hidden causes, by tier."""

from __future__ import annotations

from datagen.blind_sets.alternative_laws import FORMS
from datagen.blind_sets.catalogued import KNOWN
from datagen.blind_sets.mechanism import Cause
from datagen.blind_sets.rig_and_sensors import RIG, SENSORS
from datagen.blind_sets.uncatalogued import UNKNOWN

#: Tier -> cause by its key. A: the usual form; B: another form; C: in no catalogue; S: sensors.
CAUSES: dict[str, dict[str, Cause]] = {
    tier: {cause.key: cause for cause in causes}
    for tier, causes in (
        ("A", (*KNOWN, *RIG)),
        ("B", FORMS),
        ("C", UNKNOWN),
        ("S", SENSORS),
    )
}

#: Causes that can be told apart from data, hidden together.
PAIRS = (
    ("slip-sinkage", "bulldozing"),
    ("slip-sinkage", "exit-angle"),
    ("grousers", "exit-angle"),
    ("slip-sinkage", "grousers"),
    ("exit-angle", "multipass"),
)

#: Tiers that hide nothing, and what is wrong with their readings or soil instead.
NOTHING = {
    "N0": "nothing",
    "N1": "soil that differs from run to run",
    "N2": "samples that depend on the one before",
    "N3": "outliers",
    "N4": "more noise than declared",
}


def keys(tier: str) -> list[str]:
    """The causes that a plan of this tier may name; pairs are joined by a plus sign."""
    if tier == "M":
        return ["+".join(pair) for pair in PAIRS]
    return [""] if tier in NOTHING else list(CAUSES[tier])


def hidden(tier: str, cause: str) -> list[Cause]:
    """The causes that act in a plan of this tier; raises `KeyError` for a name it has not."""
    if tier in NOTHING:
        return []
    if tier == "M":
        return [CAUSES["A"][name] for name in cause.split("+")]
    return [CAUSES[tier][cause]]
