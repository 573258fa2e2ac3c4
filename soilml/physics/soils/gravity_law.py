"""How the parameters of a soil change with gravity: two schools, and an open law between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.numerics.quantiles import latin_hypercube
from soilml.parameters import Parameter, check, declared
from soilml.physics.soils.catalogue import Soil

#: The two schools; `open` contains both and what lies between.
SCHOOLS = ("constant", "proportional")
LAWS = ("open", *SCHOOLS)
#: Probabilities that the open law gives to each school; the rest is spread evenly between them.
CONSTANT, PROPORTIONAL = 0.2, 0.4
#: Probability that the friction angle does not change, and that the shear modulus does not.
UNCHANGED = 0.5
#: Ends of the change of the friction angle, rad, where gravity falls by a factor e: the dynamic
#: angle of repose fell by about 10 degrees, and the static one rose by about 5, down to 0.1 g.
MOST_FALL, MOST_RISE = (float(np.deg2rad(angle) / np.log(10.0)) for angle in (-10.0, 5.0))
#: Largest exponent, of either sign, of the shear modulus.
MOST_SHEAR_EXPONENT = 0.25
#: The parameters that change with gravity.
CHANGED = ("kphi", "friction_angle", "shear_modulus", "unit_weight")


@dataclass(frozen=True)
class GravityLawDraws:
    """Draws (n,) of the law: a = 0 is the one school, a = 1 the other, with nothing else changed.

    exponent: a, of the frictional modulus of sinkage.
    rise: Of the friction angle, rad, where gravity falls by a factor e; below zero it falls too.
    shear_exponent: Of the shear deformation modulus.
    """

    exponent: Floats
    rise: Floats
    shear_exponent: Floats


@dataclass(frozen=True)
class GravityChange:
    r"""Parameters of a soil under a gravity g, from those that tests under g_0 showed.

    .. math::
        k_\varphi(g) = k_\varphi(g_0) (g / g_0)^a, \quad
        \varphi(g) = \varphi(g_0) + d \ln(g_0 / g), \quad
        K(g) = K(g_0) (g / g_0)^b, \quad \gamma(g) = \gamma(g_0) \, g / g_0

    `constant` has a = d = b = 0: the moduli of Bekker (1969) are constants of the soil, as tests on
    Earth under the load of the other planet assume. `proportional` has a = 1 and d = b = 0: in the
    pressure-sinkage law of Reece (1965) the frictional term is in proportion to the unit weight,
    and so to gravity. `open` draws a, d and b: a is 0 or 1 with the probabilities `CONSTANT` and
    `PROPORTIONAL`, else uniform between; d and b are 0 with the probability `UNCHANGED`, else
    uniform from `MOST_FALL` to `MOST_RISE`, and within `MOST_SHEAR_EXPONENT`, for which no source
    is known. These probabilities are judgements. The cohesive modulus, the cohesion and the
    exponent n do not change.

    Does not hold for a soil that lies at another density under the other gravity, nor beyond
    quasi-static driving.

    tested, target: Gravity g_0 of the tests and g, m/s^2.
    law: One of `LAWS`.

    Raises `InputError` for a gravity outside 0.01 to 30 m/s^2, or another law.

    References
    ----------
    Reece, Proc. Inst. Mech. Eng. 180, 1965. Wong and Kobayashi, J. Terramechanics 49(6), 2012, who
    describe both ways of testing. Kleinhans and others, J. Geophys. Res. 116, E11004, 2011, for the
    ends of d.

    Examples
    --------
    >>> moon = GravityChange(9.80665, 1.62, "proportional")
    >>> new = moon.parameters({"kphi": 1.5e6, "cohesion": 500.0}, moon.draws(1))
    >>> new["kphi"].round(), new["cohesion"]
    (array([247791.]), 500.0)
    """

    tested: Annotated[float, Parameter("m/s^2", 0.01, 30.0, "gravity of the tests")]
    target: Annotated[float, Parameter("m/s^2", 0.01, 30.0, "gravity that is asked for")]
    law: str = "open"

    def __post_init__(self) -> None:
        check(self, "gravity: ")
        if self.law not in LAWS:
            raise InputError(f"gravity law {self.law!r}; needed is one of {', '.join(LAWS)}")

    @property
    def ratio(self) -> float:
        """Gravity that is asked for over that of the tests."""
        return self.target / self.tested

    def draws(self, count: int, seed: int = 0) -> GravityLawDraws:
        """Equally weighted draws of the law, one in each stratum of each of its quantities."""
        if self.law != "open":
            nothing = np.zeros(count)
            return GravityLawDraws(nothing + (self.law == "proportional"), nothing, nothing)
        u, v, w = latin_hypercube(count, 3, np.random.default_rng(seed)).T
        between = (u - CONSTANT) / (1.0 - CONSTANT - PROPORTIONAL)
        end = MOST_SHEAR_EXPONENT
        rise, shear = (
            np.where(x < UNCHANGED, 0.0, low + (high - low) * (x - UNCHANGED) / (1.0 - UNCHANGED))
            for x, low, high in ((v, MOST_FALL, MOST_RISE), (w, -end, end))
        )
        return GravityLawDraws(np.clip(between, 0.0, 1.0), rise, shear)

    def parameters(
        self, values: Mapping[str, Floats | float], law: GravityLawDraws
    ) -> dict[str, Floats | float]:
        """Soil parameters under the gravity that is asked for.

        values: Parameters by name, numbers or arrays that broadcast against the draws (n,).
        law: Draws of `draws`.

        Raises `InputError` for a frictional modulus below zero, which has no such meaning.
        """
        new: dict[str, Floats | float] = dict(values)
        if np.any(np.asarray(values.get("kphi", 0.0)) < 0.0):
            least = float(np.min(values["kphi"]))
            raise InputError(
                f"kphi is {least:.3g} N/m^(n+2): below zero it is no frictional modulus, and no "
                "law says how it changes with gravity; use a soil with kphi above zero"
            )
        change: dict[str, Floats | float] = {
            "kphi": self.ratio**law.exponent,
            "shear_modulus": self.ratio**law.shear_exponent,
            "unit_weight": self.ratio,
        }
        for name, factor in change.items():
            if name in values:
                new[name] = values[name] * factor
        if "friction_angle" in values:
            most = declared(Soil)["friction_angle"].upper
            risen = values["friction_angle"] - law.rise * np.log(self.ratio)
            new["friction_angle"] = np.clip(risen, 0.0, most)
        return new
