"""The catalogue of effects: a new effect is one new file, or a class in `sensors.py`, and a line here.

`EFFECTS` maps the name that `[[effect]] name` takes in a model file to the class; its order, which
listings and searches follow, is the order of the lines below.
"""

# The imports are not sorted or wrapped: their order is that of the catalogue, one line each.
# ruff: isort: skip_file
# ruff: noqa: E501
# fmt: off
from soilml.physics.effects.base import Effect as Effect, EffectCard as EffectCard
from soilml.physics.effects.slip_sinkage import SlipSinkage as SlipSinkage
from soilml.physics.effects.grousers import Grousers as Grousers
from soilml.physics.effects.track_grousers import TrackGrousers as TrackGrousers
from soilml.physics.effects.bulldozing import Bulldozing as Bulldozing
from soilml.physics.effects.exit_angle import ExitAngle as ExitAngle
from soilml.physics.effects.stress_shift import StressShift as StressShift
from soilml.physics.effects.small_wheel_stiffness import SmallWheelStiffness as SmallWheelStiffness
from soilml.physics.effects.wheel_flexibility import WheelFlexibility as WheelFlexibility
from soilml.physics.effects.flat_rim import FlatRim as FlatRim
from soilml.physics.effects.clogging import Clogging as Clogging
from soilml.physics.effects.shear_softening import ShearSoftening as ShearSoftening
from soilml.physics.effects.hyperbolic_shear import HyperbolicShear as HyperbolicShear
from soilml.physics.effects.curved_envelope import CurvedEnvelope as CurvedEnvelope
from soilml.physics.effects.elliptic_pressure import EllipticPressure as EllipticPressure
from soilml.physics.effects.parabolic_pressure import ParabolicPressure as ParabolicPressure
from soilml.physics.effects.saturating_pressure import SaturatingPressure as SaturatingPressure
from soilml.physics.effects.firm_base import FirmBase as FirmBase
from soilml.physics.effects.soft_crust import SoftCrust as SoftCrust
from soilml.physics.effects.reece_width import ReeceWidth as ReeceWidth
from soilml.physics.effects.sidewall_shear import SidewallShear as SidewallShear
from soilml.physics.effects.depth_cohesion import DepthCohesion as DepthCohesion
from soilml.physics.effects.rate_dependence import Rate as Rate
from soilml.physics.effects.multipass import Multipass as Multipass
from soilml.physics.effects.bearing_drift import BearingDrift as BearingDrift
from soilml.physics.effects.cohesion_drift import CohesionDrift as CohesionDrift
from soilml.physics.effects.friction_drift import FrictionDrift as FrictionDrift
from soilml.physics.effects.lateral_slip import LateralSlip as LateralSlip
from soilml.physics.effects.slope import Slope as Slope
from soilml.physics.effects.load_transfer import LoadTransfer as LoadTransfer
from soilml.physics.effects.camber import Camber as Camber
from soilml.physics.effects.bearing_friction import BearingFriction as BearingFriction
from soilml.physics.effects.sensors import TorqueOffset as TorqueOffset
from soilml.physics.effects.sensors import TorqueGain as TorqueGain
from soilml.physics.effects.sensors import LoadGain as LoadGain
from soilml.physics.effects.sensors import LoadHysteresis as LoadHysteresis
from soilml.physics.effects.sensors import DrawbarOffset as DrawbarOffset
from soilml.physics.effects.sensors import DrawbarGain as DrawbarGain
from soilml.physics.effects.sensors import SinkageOffset as SinkageOffset
from soilml.physics.effects.sensors import SinkageGain as SinkageGain
from soilml.physics.effects.sensors import SlipScale as SlipScale
from soilml.physics.effects.sensors import SlipOffset as SlipOffset
# fmt: on

_CATALOGUE = {
    name: value
    for name, value in list(globals().items())
    if isinstance(value, type) and issubclass(value, Effect) and value is not Effect
}
#: Effect by the name that `[[effect]] name` takes in a model file.
EFFECTS: dict[str, type[Effect]] = {effect.name: effect for effect in _CATALOGUE.values()}
