"""Types of the public names, which `soilml` loads on first use."""

from soilml.config.case import Case as Case
from soilml.config.case import read_case as read_case
from soilml.config.measurement_noise import Noise as Noise
from soilml.errors import SoilmlError as SoilmlError
from soilml.experiment_design.next_rows import advise as advise
from soilml.fitting.simulation import simulate as simulate
from soilml.gap import gap as gap
from soilml.identification import METHODS as METHODS
from soilml.identification import identify as identify
from soilml.io.read_table import read_table as read_table
from soilml.io.table import Table as Table
from soilml.numerics.prior import Prior as Prior
from soilml.onboard.estimate import Estimate as Estimate
from soilml.onboard.estimator import Estimator as Estimator
from soilml.onboard.table_estimates import estimate as estimate
from soilml.onboard.tracking import SoilTracker as SoilTracker
from soilml.parameters import Parameter as Parameter
from soilml.physics.contact import Force as Force

# with the effects of the catalogue
from soilml.physics.effects import *  # noqa: F403
from soilml.physics.gears import GEARS as GEARS
from soilml.physics.gears import LinearWheel as LinearWheel
from soilml.physics.gears import Midstance as Midstance
from soilml.physics.gears import Track as Track
from soilml.physics.gears import Wheel as Wheel
from soilml.physics.model import Model as Model
from soilml.physics.operating_point import Operating as Operating
from soilml.physics.soils import Soil as Soil
from soilml.physics.soils import soil as soil
from soilml.physics.soils import soil_catalogue as soil_catalogue
from soilml.rover_design import design as design
from soilml.row_status import Status as Status
from soilml.soil_export import export_soil as export_soil
from soilml.soil_maps import soil_map as soil_map
from soilml.traction import pull as pull
from training.adaptation import adapt as adapt
from training.train import train as train

__version__: str
