"""Soils: what they are, and the published ones."""

from soilml.soils.base import Soil
from soilml.soils.catalogue import SoilEntry, soil, soil_catalogue

__all__ = ["Soil", "SoilEntry", "soil", "soil_catalogue"]
