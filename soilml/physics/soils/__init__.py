"""Soils: what they are, and the published ones."""

from soilml.physics.soils.catalogue import SoilEntry, soil, soil_catalogue
from soilml.physics.soils.soil import Soil

__all__ = ["Soil", "SoilEntry", "soil", "soil_catalogue"]
