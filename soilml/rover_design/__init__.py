"""Wheels of a rover for a slope: designs compared over soils and typical errors of the model."""

from __future__ import annotations

from soilml.rover_design.report import DesignReport, design
from soilml.rover_design.study import DesignStudy, read_study

__all__ = ["DesignReport", "DesignStudy", "design", "read_study"]
