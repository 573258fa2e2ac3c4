"""Soil parameters for other simulators: a fit or a model file, in the units of each program."""

from soilml.soil_export.folder import SoilExport, export_soil
from soilml.soil_export.known_soil import KnownSoil, read_known_soil
from soilml.soil_export.targets import TARGETS

__all__ = ["TARGETS", "KnownSoil", "SoilExport", "export_soil", "read_known_soil"]
