"""soilml: what soil does the rover drive on.

Names are loaded on first use, so that the onboard runtime loads only what it needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOME = {
    "Case": "soilml.case",
    "read_case": "soilml.case",
    "Force": "soilml.contact",
    "EFFECTS": "soilml.effects",
    "BearingFriction": "soilml.effects",
    "Bulldozing": "soilml.effects",
    "DepthCohesion": "soilml.effects",
    "DrawbarGain": "soilml.effects",
    "DrawbarOffset": "soilml.effects",
    "ExitAngle": "soilml.effects",
    "Grousers": "soilml.effects",
    "LateralSlip": "soilml.effects",
    "LoadGain": "soilml.effects",
    "LoadTransfer": "soilml.effects",
    "Multipass": "soilml.effects",
    "Rate": "soilml.effects",
    "ShearSoftening": "soilml.effects",
    "SidewallShear": "soilml.effects",
    "SinkageGain": "soilml.effects",
    "SinkageOffset": "soilml.effects",
    "SlipScale": "soilml.effects",
    "SlipSinkage": "soilml.effects",
    "Slope": "soilml.effects",
    "SmallWheelStiffness": "soilml.effects",
    "StressShift": "soilml.effects",
    "TorqueGain": "soilml.effects",
    "TorqueOffset": "soilml.effects",
    "TrackGrousers": "soilml.effects",
    "WheelFlexibility": "soilml.effects",
    "SoilmlError": "soilml.errors",
    "Estimate": "soilml.estimate",
    "GEARS": "soilml.gears",
    "LinearWheel": "soilml.gears",
    "Midstance": "soilml.gears",
    "Track": "soilml.gears",
    "Wheel": "soilml.gears",
    "METHODS": "soilml.identification",
    "identify": "soilml.identification",
    "Model": "soilml.model",
    "Estimator": "soilml.onboard",
    "Operating": "soilml.operating",
    "read_table": "soilml.reading",
    "Soil": "soilml.soils",
    "soil": "soilml.soils",
    "soil_catalogue": "soilml.soils",
    "Status": "soilml.status",
    "Table": "soilml.table",
}

__all__ = ["__version__", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"soilml has no {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
