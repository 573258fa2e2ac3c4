"""The forward model: from a gear, a soil and operating conditions to forces at equilibrium.

`model` is the entry point. A gear (`gears`) gives the contact at a sinkage, and `contact` the
stresses and their integrals. `forces` applies the effects (`effects`) to both. `sinkage_search`
finds the sinkage at which the soil carries the load, and `equilibrium` the forces and readings
there.
"""

from soilml.physics.contact import Contact, Force, Stress
from soilml.physics.effects import EFFECTS, Effect, EffectCard
from soilml.physics.gears import GEARS, Gear, LinearWheel, Midstance, Track, Wheel
from soilml.physics.load_case import LoadCase
from soilml.physics.model import Model, Profile
from soilml.physics.operating_point import Operating
from soilml.physics.pull_efficiency import pull_efficiency, traffic_class
from soilml.physics.soils import Soil, soil, soil_catalogue

__all__ = [
    "EFFECTS",
    "GEARS",
    "Contact",
    "Effect",
    "EffectCard",
    "Force",
    "Gear",
    "LinearWheel",
    "LoadCase",
    "Midstance",
    "Model",
    "Operating",
    "Profile",
    "Soil",
    "Stress",
    "Track",
    "Wheel",
    "pull_efficiency",
    "soil",
    "soil_catalogue",
    "traffic_class",
]
