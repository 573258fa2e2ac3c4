"""The catalogue of effects: a new effect is one new file and one line here.

`EFFECTS` maps the name that `[[effect]] name` takes in a model file to the class; its order, which
listings and searches follow, is the order of the lines below.
"""

# The imports are not sorted or wrapped: their order is that of the catalogue, one line each.
# ruff: isort: skip_file
# ruff: noqa: E501
# fmt: off
from soilml.physics.effects.base import Effect as Effect, EffectCard as EffectCard
from soilml.physics.effects.soil.slip_sinkage import SlipSinkage as SlipSinkage
from soilml.physics.effects.running_gear.grousers import Grousers as Grousers
from soilml.physics.effects.running_gear.track_grousers import TrackGrousers as TrackGrousers
from soilml.physics.effects.soil.bulldozing import Bulldozing as Bulldozing
from soilml.physics.effects.soil.exit_angle import ExitAngle as ExitAngle
from soilml.physics.effects.soil.stress_shift import StressShift as StressShift
from soilml.physics.effects.soil.small_wheel_stiffness import SmallWheelStiffness as SmallWheelStiffness
from soilml.physics.effects.running_gear.wheel_flexibility import WheelFlexibility as WheelFlexibility
from soilml.physics.effects.soil.shear_softening import ShearSoftening as ShearSoftening
from soilml.physics.effects.soil.sidewall_shear import SidewallShear as SidewallShear
from soilml.physics.effects.soil.depth_cohesion import DepthCohesion as DepthCohesion
from soilml.physics.effects.soil.rate_dependence import Rate as Rate
from soilml.physics.effects.soil.multipass import Multipass as Multipass
from soilml.physics.effects.soil.lateral_slip import LateralSlip as LateralSlip
from soilml.physics.effects.rig.slope import Slope as Slope
from soilml.physics.effects.rig.load_transfer import LoadTransfer as LoadTransfer
from soilml.physics.effects.rig.bearing_friction import BearingFriction as BearingFriction
from soilml.physics.effects.sensors.torque_offset import TorqueOffset as TorqueOffset
from soilml.physics.effects.sensors.torque_gain import TorqueGain as TorqueGain
from soilml.physics.effects.sensors.load_gain import LoadGain as LoadGain
from soilml.physics.effects.sensors.drawbar_offset import DrawbarOffset as DrawbarOffset
from soilml.physics.effects.sensors.drawbar_gain import DrawbarGain as DrawbarGain
from soilml.physics.effects.sensors.sinkage_offset import SinkageOffset as SinkageOffset
from soilml.physics.effects.sensors.sinkage_gain import SinkageGain as SinkageGain
from soilml.physics.effects.sensors.slip_scale import SlipScale as SlipScale
from soilml.physics.effects.sensors.slip_offset import SlipOffset as SlipOffset
# fmt: on

_CATALOGUE = {
    name: value
    for name, value in list(globals().items())
    if isinstance(value, type) and issubclass(value, Effect) and value is not Effect
}
#: Effect by the name that `[[effect]] name` takes in a model file.
EFFECTS: dict[str, type[Effect]] = {effect.name: effect for effect in _CATALOGUE.values()}
