"""Vibration of a wheel-leg in synthetic data: what its hub feels where a foot sticks and slips."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.parameters import check, declared
from soilml.prior import Prior, take_prior
from soilml.settings import Settings
from soilml.soils import Soil
from soilml.wheel_legs.stick_slip import GRAVITY, SpringLeg, amplitude

Floats = NDArray[np.float64]

#: How vibration follows slip: the rotating spring, or the straight line fitted to tests.
LAWS = ("spring", "line")
#: Unit of each hidden parameter; their columns are `stick-slip.stiffness`, ...
HIDDEN = {"stiffness": "N/m", "increment": "rad"}
#: i = c_I + c_mu D + (a_mu + b_mu D) a, D the increment in rad, a in g. Table V, linear model.
C_I, C_MU, A_MU, B_MU = -0.882, 0.022, 6.609, -0.156
#: phi = p_I + p_K k_S + p_tau D, rad and N/m. Table VII.
P_I, P_K, P_TAU = -0.76, 0.35e-3, 0.03
#: sigma_1 = t_I + t_K k_S + t_tau D, Pa. Table VII.
T_I, T_K, T_TAU = -0.2e4, -0.81e1, 13.45e4
#: No soil keeps less than this share of its friction angle once it slides.
LEAST_KEPT = 0.05


@dataclass(frozen=True)
class StickSlip:
    """The recipe's [stick_slip]: a law, a leg, and what varies from run to run.

    `stiffness` k_S and `increment` (static less dynamic friction angle) are ranges, or None: then
    both follow the soil's friction angle and stiffness by Comin and Saaj 2017, eq. 28, times a
    uniform factor of the standard deviation `scatter`.
    """

    law: str
    leg: SpringLeg
    stiffness: Prior | None
    increment: Prior | None
    scatter: float

    def hidden(self, soil: Soil, width: Any, u: Floats) -> dict[str, Floats]:
        """k_S (N/m) and the increment (rad), (n,), for fractions `u` (n, 2) of what is unknown."""
        if self.stiffness is not None and self.increment is not None:
            return {
                "stiffness": self.stiffness.at(u[:, 0]),
                "increment": self.increment.at(u[:, 1]),
            }
        factor = 1.0 + math.sqrt(3.0) * self.scatter * (2.0 * u - 1.0)
        phi, sigma = np.asarray(soil.friction_angle), normal_stiffness(soil, width)
        # eq. 28 solved for k_S and the increment
        stiffness = (T_TAU * (phi - P_I) - P_TAU * (sigma - T_I)) / (P_K * T_TAU - P_TAU * T_K)
        increment = (sigma - T_I - T_K * stiffness) / T_TAU
        most = (1.0 - LEAST_KEPT) * phi
        return {
            "stiffness": stiffness * factor[:, 0],
            "increment": np.clip(increment * factor[:, 1], 0.0, most),
        }

    def vibration(
        self, soil: Soil, slip: Floats, load: Floats, hidden: dict[str, Floats], least_load: float
    ) -> Floats:
        r"""Largest amplitude of the hub's acceleration (m/s^2) in a stride, (n,), without noise.

        The spring carries the row's load. The line is that of Comin and Saaj 2017, eq. 24,

        .. math:: \Delta a = (i - c_I - c_\mu \Delta\varphi) / (a_\mu + b_\mu \Delta\varphi)

        with the linear parameters of their table V: in it the soil hardly matters. References:
        eqs. 20-23 for the spring.
        """
        if self.law == "line":
            along = A_MU + B_MU * hidden["increment"]
            return np.asarray(GRAVITY * (slip - C_I - C_MU * hidden["increment"]) / along)
        # one row more, the stiffest: its time step is that of all rows, in whatever piece
        given = {f.name: getattr(self.leg, f.name) for f in fields(SpringLeg)}
        given["stiffness"] = np.append(hidden["stiffness"], self._stiffest(soil))
        given["hub_mass"] = np.append(load, least_load) / GRAVITY
        angle = np.append(np.broadcast_to(soil.friction_angle, slip.shape), 0.5)
        increment = np.append(hidden["increment"], 0.0)
        return amplitude(SpringLeg(**given), np.append(slip, 0.0), angle, increment)[:-1]

    def _stiffest(self, soil: Soil) -> float:
        """A leg at least as stiff as that of any run, N/m."""
        if self.stiffness is not None:
            return self.stiffness.upper
        steepest = float(declared(Soil)["friction_angle"].upper)
        return (steepest - P_I) / P_K * (1.0 + math.sqrt(3.0) * self.scatter)


def normal_stiffness(soil: Soil, width: Any) -> Floats:
    r"""sigma_1 (Pa), the pressure 1 cm deep under a plate as wide as the gear.

    .. math:: \sigma_1 = (k_c / b + k_\varphi) (1 cm)^n

    References: Comin and Saaj 2017, who write sigma_0 + alpha_z 1 cm for a linear soil.
    """
    return np.asarray((soil.kc / width + soil.kphi) * 0.01**soil.n)


def take_stick_slip(settings: Settings) -> StickSlip:
    """Read [stick_slip]; raises `InputError` naming the key."""
    law = settings.text("law", LAWS[0])
    if law not in LAWS:
        settings.fail(f"law is {law!r}; there are: {', '.join(LAWS)}")
    ranges = {key: take_prior(settings, key) for key in HIDDEN if key in settings}
    if len(ranges) == 1:
        settings.fail("give both stiffness and increment, or neither: they then follow the soil")
    scatter = settings.number("scatter", 0.0 if ranges else 0.1)
    if ranges and scatter:
        settings.fail("scatter is of stiffness and increment that follow the soil; leave it out")
    if not 0.0 <= scatter <= 0.5:
        settings.fail(f"scatter is {scatter:g}; needed is a share between 0 and 0.5")
    own = [key for key in declared(SpringLeg) if key not in ("stiffness", "hub_mass")]
    sizes = {key: settings.number(key) for key in own if key in settings}
    stiffness = ranges.get("stiffness")
    leg = SpringLeg(stiffness=stiffness.lower if stiffness else 4000.0, **sizes)
    check(leg, f"{settings.where}: ")
    settings.knows((*own, *HIDDEN))
    settings.finish()
    return StickSlip(law, leg, stiffness, ranges.get("increment"), scatter)
