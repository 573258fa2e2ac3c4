"""soilml: what soil does the rover drive on.

Names are loaded on first use, so that the onboard runtime loads only what it needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "Case": "soilml.config.case",
    "read_case": "soilml.config.case",
    "Force": "soilml.physics.contact",
    "EFFECTS": "soilml.physics.effects",
    "BearingFriction": "soilml.physics.effects",
    "Bulldozing": "soilml.physics.effects",
    "DepthCohesion": "soilml.physics.effects",
    "DrawbarGain": "soilml.physics.effects",
    "DrawbarOffset": "soilml.physics.effects",
    "ExitAngle": "soilml.physics.effects",
    "Grousers": "soilml.physics.effects",
    "LateralSlip": "soilml.physics.effects",
    "LoadGain": "soilml.physics.effects",
    "LoadTransfer": "soilml.physics.effects",
    "Multipass": "soilml.physics.effects",
    "Rate": "soilml.physics.effects",
    "ShearSoftening": "soilml.physics.effects",
    "SidewallShear": "soilml.physics.effects",
    "SinkageGain": "soilml.physics.effects",
    "SinkageOffset": "soilml.physics.effects",
    "SlipScale": "soilml.physics.effects",
    "SlipSinkage": "soilml.physics.effects",
    "Slope": "soilml.physics.effects",
    "SmallWheelStiffness": "soilml.physics.effects",
    "StressShift": "soilml.physics.effects",
    "TorqueGain": "soilml.physics.effects",
    "TorqueOffset": "soilml.physics.effects",
    "TrackGrousers": "soilml.physics.effects",
    "WheelFlexibility": "soilml.physics.effects",
    "SoilmlError": "soilml.errors",
    "Estimate": "soilml.onboard.estimate",
    "GEARS": "soilml.physics.gears",
    "LinearWheel": "soilml.physics.gears",
    "Midstance": "soilml.physics.gears",
    "Track": "soilml.physics.gears",
    "Wheel": "soilml.physics.gears",
    "METHODS": "soilml.identification",
    "identify": "soilml.identification",
    "Model": "soilml.physics.model",
    "Estimator": "soilml.onboard.estimator",
    "Operating": "soilml.physics.operating_point",
    "read_table": "soilml.io.read_table",
    "Soil": "soilml.physics.soils",
    "soil": "soilml.physics.soils",
    "soil_catalogue": "soilml.physics.soils",
    "Status": "soilml.row_status",
    "Table": "soilml.io.table",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"soilml has no {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
