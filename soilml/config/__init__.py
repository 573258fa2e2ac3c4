"""Model files: the case, its priors and the measurement noise."""

from soilml.config.case import Case, read_case, take_case
from soilml.config.measurement_noise import Noise, take_noise
from soilml.config.model_settings import take_prior
from soilml.config.write_case import case_as_toml

__all__ = ["Case", "Noise", "case_as_toml", "read_case", "take_case", "take_noise", "take_prior"]
