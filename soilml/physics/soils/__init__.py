"""The parameters of a soil, and the catalogue of published soils."""

from soilml.physics.soils.catalogue import Soil, SoilEntry, soil, soil_catalogue

__all__ = ["Soil", "SoilEntry", "soil", "soil_catalogue"]
