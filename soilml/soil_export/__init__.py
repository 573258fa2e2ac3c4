"""Soil parameters for other simulators: a fit or a model file, in the units of each program."""

from soilml.soil_export.folder import SoilExport, export_soil
from soilml.soil_export.source_soil import SourceSoil, read_source_soil
from soilml.soil_export.targets import TARGETS

__all__ = ["TARGETS", "SoilExport", "SourceSoil", "export_soil", "read_source_soil"]
