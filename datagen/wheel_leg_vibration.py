"""Vibration of a wheel-leg in synthetic data: what its hub feels where a foot sticks and slips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.prior import take_prior
from soilml.errors import InputError
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.parameters import check, declared
from soilml.physics.soils import Soil
from soilml.systems.wheel_legs.sensing.slip_models import GRAVITY, VIBRATION_SLIP, soil_spring
from soilml.systems.wheel_legs.sensing.stick_slip import SpringLeg, vibration_amplitude

Floats = NDArray[np.float64]

#: How vibration follows slip: the rotating spring, or the straight line fitted to tests.
LAWS = ("spring", "line")
#: Unit of each hidden parameter; their columns are `stick-slip.stiffness`, ...
HIDDEN = {"stiffness": "N/m", "increment": "rad"}
#: s^2/m, the least slope of a line that still tells slip: vibration grows as one over it.
LEAST_SLOPE = 0.02


@dataclass(frozen=True)
class StickSlip:
    """The recipe's [stick_slip]: a law, and for the spring a leg and what no one knows of it.

    `stiffness` is k_S (N/m), `drop` the share of the friction angle that soil loses once it slides;
    one draw for each run. None with the law `line`, where both follow the soil.
    """

    law: str
    leg: SpringLeg
    stiffness: Prior | None
    drop: Prior | None

    def hidden(self, soil: Soil, width: Any, u: Floats) -> dict[str, Floats]:
        """k_S (N/m) and the drop of friction (rad), (n,), for fractions `u` (n, 2) of their ranges.

        Without ranges those of Comin and Saaj 2017, eq. 28.
        """
        if self.stiffness is None or self.drop is None:
            stiffness = normal_stiffness(soil, width)
            found = np.broadcast_arrays(*soil_spring(soil.friction_angle, stiffness), u[:, 0])
            return {"stiffness": found[1], "increment": found[0]}
        increment = self.drop.at(u[:, 1]) * np.asarray(soil.friction_angle)
        return {"stiffness": self.stiffness.at(u[:, 0]), "increment": increment}

    def vibration(
        self, soil: Soil, slip: Floats, load: Floats, hidden: dict[str, Floats], least_load: float
    ) -> Floats:
        r"""Largest amplitude of the hub's acceleration (m/s^2) in a stride, (n,), without noise.

        The spring carries the row's load; none is below `least_load`. The line is Comin and Saaj
        2017, eq. 24, with the linear parameters of their table V: \Delta a = (i - a) / b. Raises
        `InputError` for a soil on which that line has no slope.
        """
        if self.law == "line":
            a, b = VIBRATION_SLIP["linear"].line(hidden["increment"], hidden["stiffness"])
            if b.min() < LEAST_SLOPE:
                drop = np.rad2deg(hidden["increment"][int(np.argmin(b))])
                raise InputError(
                    f"[stick_slip] law is 'line': friction drops by {drop:.1f} degrees, and slip "
                    "no longer follows vibration; lower friction_angle or kphi in [soil.prior]"
                )
            return np.asarray(np.maximum((slip - a) / b, 0.0))
        # one row more, the stiffest with the lightest hub: it sets one time step in all pieces
        stiffest = self.stiffness.upper if self.stiffness else 0.0
        leg = replace(
            self.leg,
            stiffness=np.append(hidden["stiffness"], stiffest),
            hub_mass=np.append(load, least_load) / GRAVITY,
        )
        angle = np.append(np.broadcast_to(soil.friction_angle, slip.shape), 0.5)
        increment = np.append(hidden["increment"], 0.0)
        return vibration_amplitude(leg, np.append(slip, 0.0), angle, increment)[:-1]


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
    if law == "line":
        settings.finish()
        return StickSlip(law, SpringLeg(stiffness=1000.0), None, None)
    stiffness, drop = take_prior(settings, "stiffness"), take_prior(settings, "drop")
    if not 0.0 <= drop.lower < drop.upper <= 1.0:
        settings.fail(
            f"drop is [{drop.lower:g}, {drop.upper:g}]; needed are shares of the friction angle, "
            "between 0 and 1"
        )
    own = [key for key in declared(SpringLeg) if key not in ("stiffness", "hub_mass")]
    sizes = {key: settings.number(key) for key in own if key in settings}
    for end in (stiffness.lower, stiffness.upper):
        check(SpringLeg(stiffness=end, **sizes), f"{settings.where}: ")
    settings.knows(own)
    settings.finish()
    return StickSlip(law, SpringLeg(stiffness=stiffness.lower, **sizes), stiffness, drop)
