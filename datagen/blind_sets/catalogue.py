"""The catalogue of hidden mechanisms, by tier."""

from __future__ import annotations

from datagen.blind_sets.alternative_laws import ALTERNATIVE_FORMS
from datagen.blind_sets.catalogued import TEXTBOOK_FORMS
from datagen.blind_sets.mechanism import Mechanism
from datagen.blind_sets.rig_and_sensors import RIG_MECHANISMS, SENSOR_MECHANISMS
from datagen.blind_sets.uncatalogued import UNCATALOGUED_MECHANISMS

#: Tier -> mechanism by its key. A: textbook form, soil, wheel and rig; B: alternative form; C: in
#: no catalogue of the analyst; S: sensors.
MECHANISMS: dict[str, dict[str, Mechanism]] = {
    tier: {mechanism.key: mechanism for mechanism in mechanisms}
    for tier, mechanisms in (
        ("A", (*TEXTBOOK_FORMS, *RIG_MECHANISMS)),
        ("B", ALTERNATIVE_FORMS),
        ("C", UNCATALOGUED_MECHANISMS),
        ("S", SENSOR_MECHANISMS),
    )
}

#: Mechanisms hidden together that data can distinguish.
PAIRS = (
    ("slip-sinkage", "bulldozing"),
    ("slip-sinkage", "exit-angle"),
    ("grousers", "exit-angle"),
    ("slip-sinkage", "grousers"),
    ("exit-angle", "multipass"),
)

#: Tiers without a mechanism, and the fault of their readings or soil instead.
TIERS_WITHOUT_MECHANISM = {
    "N0": "nothing",
    "N1": "run-to-run scatter of the soil",
    "N2": "autocorrelated noise",
    "N3": "outliers",
    "N4": "more noise than declared",
    "D": "a smooth discrepancy alone",
}


def mechanism_keys(tier: str) -> list[str]:
    """Keys of the mechanisms that a plan of this tier may name; pairs are joined by a plus sign."""
    if tier == "M":
        return ["+".join(pair) for pair in PAIRS]
    return [""] if tier in TIERS_WITHOUT_MECHANISM else list(MECHANISMS[tier])


def active_mechanisms(tier: str, key: str) -> list[Mechanism]:
    """The mechanisms in a plan of this tier; raises `KeyError` for a key that the tier lacks."""
    if tier in TIERS_WITHOUT_MECHANISM:
        return []
    if tier == "M":
        return [MECHANISMS["A"][name] for name in key.split("+")]
    return [MECHANISMS[tier][key]]
