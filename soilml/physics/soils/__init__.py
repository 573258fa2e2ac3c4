"""The parameters of a soil, and the catalogue of published soils."""

from soilml.physics.soils.catalogue import SoilEntry, soil, soil_catalogue
from soilml.physics.soils.soil import Soil

__all__ = ["Soil", "SoilEntry", "soil", "soil_catalogue"]
