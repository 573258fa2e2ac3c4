"""The catalogue of effects: a new effect is a class in the file of its kind, and a line here.

`EFFECTS` maps the name that `[[effect]] name` takes in a model file to the class; its order, which
listings and searches follow, is the order of the lines below.
"""

# The imports are not sorted or wrapped: their order is that of the catalogue, one line each.
# ruff: isort: skip_file
# fmt: off
from soilml.physics.effects.base import Effect as Effect, EffectCard as EffectCard, effect as effect
from soilml.physics.effects.soil_changes import SlipSinkage as SlipSinkage
from soilml.physics.effects.grousers import Grousers as Grousers
from soilml.physics.effects.grousers import TrackGrousers as TrackGrousers
from soilml.physics.effects.forces_beside import Bulldozing as Bulldozing
from soilml.physics.effects.contact_shape import ExitAngle as ExitAngle
from soilml.physics.effects.contact_shape import StressShift as StressShift
from soilml.physics.effects.normal_stress import SmallWheelStiffness as SmallWheelStiffness
from soilml.physics.effects.contact_shape import WheelFlexibility as WheelFlexibility
from soilml.physics.effects.contact_shape import FlatRim as FlatRim
from soilml.physics.effects.contact_shape import Clogging as Clogging
from soilml.physics.effects.shear_laws import ShearSoftening as ShearSoftening
from soilml.physics.effects.shear_laws import HyperbolicShear as HyperbolicShear
from soilml.physics.effects.shear_laws import CurvedEnvelope as CurvedEnvelope
from soilml.physics.effects.normal_stress import EllipticPressure as EllipticPressure
from soilml.physics.effects.normal_stress import ParabolicPressure as ParabolicPressure
from soilml.physics.effects.normal_stress import SaturatingPressure as SaturatingPressure
from soilml.physics.effects.normal_stress import FirmBase as FirmBase
from soilml.physics.effects.normal_stress import SoftCrust as SoftCrust
from soilml.physics.effects.normal_stress import ReeceWidth as ReeceWidth
from soilml.physics.effects.forces_beside import SidewallShear as SidewallShear
from soilml.physics.effects.soil_changes import DepthCohesion as DepthCohesion
from soilml.physics.effects.soil_changes import Rate as Rate
from soilml.physics.effects.soil_changes import Multipass as Multipass
from soilml.physics.effects.soil_changes import BearingDrift as BearingDrift
from soilml.physics.effects.soil_changes import CohesionDrift as CohesionDrift
from soilml.physics.effects.soil_changes import FrictionDrift as FrictionDrift
from soilml.physics.effects.forces_beside import LateralSlip as LateralSlip
from soilml.physics.effects.forces_beside import Slope as Slope
from soilml.physics.effects.forces_beside import LoadTransfer as LoadTransfer
from soilml.physics.effects.forces_beside import Camber as Camber
from soilml.physics.effects.forces_beside import BearingFriction as BearingFriction
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

#: Effect by the name that `[[effect]] name` takes in a model file.
EFFECTS: dict[str, type[Effect]] = {
    own.name: own
    for own in list(globals().values())
    if isinstance(own, type) and issubclass(own, Effect) and own is not Effect
}
