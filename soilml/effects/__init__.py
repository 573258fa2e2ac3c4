"""The catalogue of effects: a new effect is one new file and one line here."""

from soilml.effects.base import Effect, EffectCard
from soilml.effects.bearing_friction import BearingFriction
from soilml.effects.bulldozing import Bulldozing
from soilml.effects.depth_cohesion import DepthCohesion
from soilml.effects.drawbar_gain import DrawbarGain
from soilml.effects.drawbar_offset import DrawbarOffset
from soilml.effects.exit_angle import ExitAngle
from soilml.effects.grousers import Grousers
from soilml.effects.lateral_slip import LateralSlip
from soilml.effects.load_gain import LoadGain
from soilml.effects.load_transfer import LoadTransfer
from soilml.effects.multipass import Multipass
from soilml.effects.rate import Rate
from soilml.effects.shear_softening import ShearSoftening
from soilml.effects.sidewall_shear import SidewallShear
from soilml.effects.sinkage_gain import SinkageGain
from soilml.effects.sinkage_offset import SinkageOffset
from soilml.effects.slip_scale import SlipScale
from soilml.effects.slip_sinkage import SlipSinkage
from soilml.effects.slope import Slope
from soilml.effects.small_wheel_stiffness import SmallWheelStiffness
from soilml.effects.stress_shift import StressShift
from soilml.effects.torque_gain import TorqueGain
from soilml.effects.torque_offset import TorqueOffset
from soilml.effects.track_grousers import TrackGrousers
from soilml.effects.wheel_flexibility import WheelFlexibility

#: Effect by the name that `[[effect]] name` takes in a model file.
EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        SlipSinkage,
        Grousers,
        TrackGrousers,
        Bulldozing,
        ExitAngle,
        StressShift,
        SmallWheelStiffness,
        WheelFlexibility,
        ShearSoftening,
        SidewallShear,
        DepthCohesion,
        Rate,
        Multipass,
        LateralSlip,
        Slope,
        LoadTransfer,
        BearingFriction,
        TorqueOffset,
        TorqueGain,
        LoadGain,
        DrawbarOffset,
        DrawbarGain,
        SinkageOffset,
        SinkageGain,
        SlipScale,
    )
}

__all__ = [
    "EFFECTS",
    "BearingFriction",
    "Bulldozing",
    "DepthCohesion",
    "DrawbarGain",
    "DrawbarOffset",
    "Effect",
    "EffectCard",
    "ExitAngle",
    "Grousers",
    "LateralSlip",
    "LoadGain",
    "LoadTransfer",
    "Multipass",
    "Rate",
    "ShearSoftening",
    "SidewallShear",
    "SinkageGain",
    "SinkageOffset",
    "SlipScale",
    "SlipSinkage",
    "Slope",
    "SmallWheelStiffness",
    "StressShift",
    "TorqueGain",
    "TorqueOffset",
    "TrackGrousers",
    "WheelFlexibility",
]
