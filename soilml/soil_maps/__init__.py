"""Soil along the way of a rover: a field of soil parameters, and what the rover can do on it."""

from soilml.soil_maps.workflow import SoilMap, soil_map

__all__ = ["SoilMap", "soil_map"]
