"""The rover file: dimensions, known soil parameters, priors and sensor noise."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from typing import Annotated, final

from soilml.config.measurement_noise import Noise, take_noise
from soilml.config.model_settings import take_priors
from soilml.errors import InputError
from soilml.io.toml_settings import Settings, read_settings
from soilml.numerics.prior import Prior
from soilml.parameters import Parameter, check, declared
from soilml.systems.rim_stress.climb import Rover, Uncertainty

DEFAULT_STRESS_NOISE = Noise(share=0.05)  # Noise of the stress where [noise] has no normal_Pa
#: Fields of `Uncertainty` by their key in [noise]; the speed is a percentage.
KEYS = {
    "slope_rad": "slope",
    "entry_angle_rad": "entry_angle",
    "speed_scale": "speed_scale",
    "front_load": "front_load",
}


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
    names = [f.name for f in fields(Rover)]
    needed = ("mass", "radius", "width")
    values = {name: own.number(name) for name in names if name in own or name in needed}
    own.permit(names)
    own.finish()
    try:
        rover = Rover(**values)
        check(rover)
    except InputError as error:
        own.fail(str(error))
    soil = settings.table("soil")
    fixed = {name: soil.number(name) for name in declared(FixedShearParameters) if name in soil}
    ranges = soil.table("prior")
    if both := [name for name in fixed if name in ranges]:
        ranges.fail(f"{both[0]} is a number in [soil] and has a range here; remove one of them")
    prior = take_priors(ranges, FixedShearParameters)
    if "shear_modulus" in prior:
        prior["shear_modulus"] = replace(prior["shear_modulus"], log=True)
    soil.permit(declared(FixedShearParameters))
    soil.finish()
    check(FixedShearParameters(**fixed), f"{soil.where} ")
    noise, stress = _take_noise(settings.table("noise"))
    settings.finish()
    return RoverFile(rover, fixed, prior, noise, stress)


def _take_noise(settings: Settings) -> tuple[Uncertainty, Noise]:
    """Standard deviations by column, and those of speed scale and front load."""
    stress = take_noise(settings, "normal_Pa") if "normal_Pa" in settings else DEFAULT_STRESS_NOISE
    found = {field: settings.number(key) for key, field in KEYS.items() if key in settings}
    for name, value in found.items():
        if not 0.0 <= value < 1.0:
            settings.fail(f"{name} is {value:g}; a standard deviation must lie in [0, 1)")
    if "speed_m_s" in settings:
        taken = take_noise(settings, "speed_m_s")
        if taken.constant:
            settings.fail(
                "speed_m_s must be a percentage, such as '0.9 %': slip is a ratio of speeds"
            )
        found["speed"] = taken.share
    settings.permit(("speed_m_s", "normal_Pa", *KEYS))
    settings.finish()
    return Uncertainty(**found), stress
