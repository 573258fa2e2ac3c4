"""The rover file: dimensions, known soil parameters, priors and sensor noise."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Annotated, final

from soilml.config.measurement_noise import Noise, NoiseOfReading
from soilml.config.model_settings import take_priors
from soilml.errors import InputError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter
from soilml.systems.rim_stress.climb import Rover, Uncertainty


@final
@dataclass(frozen=True, kw_only=True)
class FixedShearParameters:
    """Shear parameters of the soil with known values."""

    cohesion: Annotated[float | None, Parameter("Pa", 0.0, 1e6, "c")] = None
    friction_angle: Annotated[float | None, Parameter("rad", 0.02, 1.4, "phi")] = None
    shear_modulus: Annotated[float | None, Parameter("m", 1e-5, 1.0, "k_x")] = None


@dataclass(frozen=True)
class RoverFile:
    """Content of a rover file."""

    rover: Rover
    fixed: dict[str, float]
    prior: dict[str, Prior]
    noise: Uncertainty
    stress: Noise


def read_rover(path: str | os.PathLike[str]) -> RoverFile:
    """Read [rover], [soil] and [noise]; raises `InputError` naming file, table and key."""
    settings = read_settings(path)
    own = settings.table("rover")
    if "wheels" in own:
        own.fail(
            "a rover by its wheels is for soilml pull; climb needs mass, radius and width of four "
            "equal wheels"
        )
    rover = take_declared(Rover, own)
    fixed, prior = _take_ground(settings.table("soil"))
    noise, stress = _take_noise(settings.table("noise"))
    settings.finish()
    return RoverFile(rover, fixed, prior, noise, stress)


def _take_ground(settings: Settings) -> tuple[dict[str, float], dict[str, Prior]]:
    """Numbers in [soil] are fixed; ranges in [soil.prior] are priors."""
    priors = settings.table("prior")
    known = vars(take_declared(FixedShearParameters, settings))
    fixed = {name: value for name, value in known.items() if value is not None}
    prior = take_priors(priors, FixedShearParameters)
    for name, taken in prior.items():
        if name in fixed:
            priors.fail(f"{name} is a number in [soil] and has a range here; remove one of them")
        if name == "shear_modulus" and not taken.log:
            prior[name] = Prior(taken.lower, taken.upper, log=True)
    return fixed, prior


_SPEED, _STRESS = Noise(share=Uncertainty.speed), Noise(share=0.05)
_SHARE = Parameter("1", 0.0, 1.0, "standard deviation")
_ANGLE = Parameter("rad", 0.0, 1.0, "standard deviation")


@dataclass(frozen=True)
class _NoiseTable:
    """The table [noise]: standard deviations by column, and those of speed scale and front load."""

    speed_m_s: Annotated[Noise, NoiseOfReading()] = _SPEED
    normal_Pa: Annotated[Noise, NoiseOfReading()] = _STRESS  # noqa: N815
    slope_rad: Annotated[float, _ANGLE] = Uncertainty.slope
    entry_angle_rad: Annotated[float, _ANGLE] = Uncertainty.entry_angle
    speed_scale: Annotated[float, _SHARE] = Uncertainty.speed_scale
    front_load: Annotated[float, _SHARE] = Uncertainty.front_load

    def __post_init__(self) -> None:
        """Raise `InputError` for a speed whose error is no share of it, and for exact stresses."""
        if self.speed_m_s.constant or not self.speed_m_s.share:
            raise InputError(
                "speed_m_s must be a percentage, such as '0.9 %': slip is a ratio of speeds"
            )
        if self.normal_Pa == Noise():
            raise InputError("normal_Pa is 0; a standard deviation must be above zero")


def _take_noise(settings: Settings) -> tuple[Uncertainty, Noise]:
    found = take_declared(_NoiseTable, settings)
    own = Uncertainty(
        speed=found.speed_m_s.share,
        speed_scale=found.speed_scale,
        slope=found.slope_rad,
        entry_angle=found.entry_angle_rad,
        front_load=found.front_load,
    )
    return own, found.normal_Pa
