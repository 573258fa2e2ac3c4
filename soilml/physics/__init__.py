"""The forward model: from a gear, a soil and operating conditions to forces at equilibrium.

`model` is the entry point. A gear (`gears`) gives the contact at a sinkage, and `contact` the
stresses and their integrals. `forces` applies the effects (`effects`) to both. `sinkage_search`
finds the sinkage at which the soil carries the load, and `equilibrium` the forces and readings
there.
Gears, soils and effects can be imported from `soilml`; the names below are beside those.
"""

from soilml.physics.contact import Contact, Stress
from soilml.physics.gears.base import Gear
from soilml.physics.load_case import LoadCase
from soilml.physics.model import Profile
from soilml.physics.pull_efficiency import pull_efficiency, traffic_class

__all__ = [
    "Contact", "Gear", "LoadCase", "Profile", "Stress", "pull_efficiency", "traffic_class",
]  # fmt: skip
