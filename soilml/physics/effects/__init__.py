"""The catalogue of effects: a new effect is one new file and one line here."""

from soilml.physics.effects.base import Effect, EffectCard
from soilml.physics.effects.rig.bearing_friction import BearingFriction
from soilml.physics.effects.rig.load_transfer import LoadTransfer
from soilml.physics.effects.rig.slope import Slope
from soilml.physics.effects.running_gear.grousers import Grousers
from soilml.physics.effects.running_gear.track_grousers import TrackGrousers
from soilml.physics.effects.running_gear.wheel_flexibility import WheelFlexibility
from soilml.physics.effects.sensors.drawbar_gain import DrawbarGain
from soilml.physics.effects.sensors.drawbar_offset import DrawbarOffset
from soilml.physics.effects.sensors.load_gain import LoadGain
from soilml.physics.effects.sensors.sinkage_gain import SinkageGain
from soilml.physics.effects.sensors.sinkage_offset import SinkageOffset
from soilml.physics.effects.sensors.slip_scale import SlipScale
from soilml.physics.effects.sensors.torque_gain import TorqueGain
from soilml.physics.effects.sensors.torque_offset import TorqueOffset
from soilml.physics.effects.soil.bulldozing import Bulldozing
from soilml.physics.effects.soil.depth_cohesion import DepthCohesion
from soilml.physics.effects.soil.exit_angle import ExitAngle
from soilml.physics.effects.soil.lateral_slip import LateralSlip
from soilml.physics.effects.soil.multipass import Multipass
from soilml.physics.effects.soil.rate_dependence import Rate
from soilml.physics.effects.soil.shear_softening import ShearSoftening
from soilml.physics.effects.soil.sidewall_shear import SidewallShear
from soilml.physics.effects.soil.slip_sinkage import SlipSinkage
from soilml.physics.effects.soil.small_wheel_stiffness import SmallWheelStiffness
from soilml.physics.effects.soil.stress_shift import StressShift

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
