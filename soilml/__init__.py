"""soilml estimates the strength of the soil that a rover drives on.

The names below are loaded on first use, so that the runtime on board loads only what it needs.
Effects of the catalogue (`soilml.physics.effects`) can be imported from here too.
"""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False  # typing takes longer to import than all this; type checkers read it as true
if TYPE_CHECKING:
    from typing import Any

__version__ = "0.3.0"

#: public name -> the module that defines it; effects of the catalogue come in addition
_HOME = {
    "Case": "soilml.config.case",
    "read_case": "soilml.config.case",
    "Noise": "soilml.config.measurement_noise",
    "SoilmlError": "soilml.errors",
    "simulate": "soilml.fitting.simulation",
    "gap": "soilml.gap",
    "adapt": "training.adaptation",
    "train": "training.train",
    "METHODS": "soilml.identification",
    "identify": "soilml.identification",
    "read_table": "soilml.io.read_table",
    "Table": "soilml.io.table",
    "Prior": "soilml.numerics.prior",
    "advise": "soilml.experiment_design.next_rows",
    "estimate": "soilml.onboard.table_estimates",
    "pull": "soilml.traction",
    "Estimate": "soilml.onboard.estimate",
    "Estimator": "soilml.onboard.estimator",
    "SoilTracker": "soilml.onboard.tracking",
    "Parameter": "soilml.parameters",
    "Force": "soilml.physics.contact",
    "EFFECTS": "soilml.physics.effects",
    "Effect": "soilml.physics.effects",
    "EffectCard": "soilml.physics.effects",
    "effect": "soilml.physics.effects",
    "GEARS": "soilml.physics.gears",
    "LinearWheel": "soilml.physics.gears",
    "Midstance": "soilml.physics.gears",
    "Track": "soilml.physics.gears",
    "Wheel": "soilml.physics.gears",
    "Model": "soilml.physics.model",
    "Operating": "soilml.physics.operating_point",
    "Soil": "soilml.physics.soils",
    "soil": "soilml.physics.soils",
    "soil_catalogue": "soilml.physics.soils",
    "design": "soilml.rover_design",
    "export_soil": "soilml.soil_export",
    "soil_map": "soilml.soil_maps",
    "Status": "soilml.row_status",
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name == "__all__":
        return ["__version__", *_HOME, *_effects()]
    if not name.startswith("_") and name in _effects():
        return _effects()[name]
    raise AttributeError(f"soilml has no {name!r}")


def __dir__() -> list[str]:
    return sorted(__getattr__("__all__"))


def _effects() -> dict[str, Any]:
    """Effects of the catalogue by class name."""
    catalogue = import_module("soilml.physics.effects").EFFECTS
    return {effect.__name__: effect for effect in catalogue.values()}
