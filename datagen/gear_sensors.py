"""The vibration of wheel-legs, a sensor that only this gear has, by [stick_slip] of a recipe."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.model_settings import take_prior
from soilml.errors import InputError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.numerics.prior import Prior
from soilml.parameters import check
from soilml.physics.gears import Midstance
from soilml.physics.soils import Soil
from soilml.quantities import QUANTITIES
from soilml.systems.wheel_legs.stances import GRAVITY, SpringLeg, vibration_amplitude
from soilml.systems.wheel_legs.stride_relations import SPRING, SPRING_OF_SOIL, VIBRATION, affine

VIBRATION_COLUMN = "vibration_m_s2"
#: Units of further columns that are no quantity of `soilml.quantities`.
UNITS = {"stick-slip.stiffness": "N/m", "stick-slip.increment": "rad"}
RUN_DRAWS = 2  # Random numbers that a run needs
#: Relations of vibration to slip: the rotating spring, or the straight line fitted to tests.
LAWS = ("spring", "line")
MIN_SLOPE = 0.02  # s^2/m; with a smaller slope of the line, vibration (its inverse) diverges


@dataclass(frozen=True)
class StickSlip:
    """The recipe's [stick_slip]: a leg, and for the spring its unknown parameters.

    `stiffness` is k_S (N/m), `drop` the fraction of the friction angle that soil loses once it
    slides; both have one value in each run. None with the law `line`, where both follow the soil.
    """

    leg: SpringLeg
    stiffness: Prior | None = None
    drop: Prior | None = None

    @classmethod
    def take(cls, settings: Settings, case: Case) -> StickSlip:
        """Read [stick_slip]; raises `InputError` naming the key, or for a gear without legs."""
        if not isinstance(case.model.gear, Midstance):
            settings.fail(
                "the table is for wheel-legs only; needed is [gear] type = 'midstance', not "
                f"{case.model.gear.name!r}"
            )
        law = settings.text("law", LAWS[0])
        if law not in LAWS:
            settings.fail(f"law is {law!r}; needed is one of: {', '.join(LAWS)}")
        if law == "line":
            settings.finish()
            return cls(SpringLeg(stiffness=1000.0))
        stiffness, drop = take_prior(settings, "stiffness"), take_prior(settings, "drop")
        if not 0.0 <= drop.lower < drop.upper <= 1.0:
            settings.fail(
                f"drop is [{drop.lower:g}, {drop.upper:g}]; needed are fractions of the friction "
                "angle, between 0 and 1"
            )
        leg = take_declared(
            SpringLeg, settings, stiffness=stiffness.lower, hub_mass=SpringLeg.hub_mass
        )
        for end in (stiffness.lower, stiffness.upper):
            check(replace(leg, stiffness=end), f"{settings.where}: ")
        return cls(leg, stiffness, drop)

    def simulate(
        self, case: Case, slip: Floats, load: Floats, lowest_load: float, u: Floats
    ) -> tuple[Floats, dict[str, Floats]]:
        """Vibration (m/s^2) and the columns of the parameters that it depends on, (n,).

        `case` has the soil of each row. `u` (n, RUN_DRAWS) are uniform between 0 and 1, the same in
        all rows of a run. No load of the recipe is below `lowest_load` (N): what is derived from it
        does not depend on the pieces in which rows are simulated.
        """
        firmness = normal_stiffness(case.soil, case.parameters()["gear.width"][1])
        leg = self._leg(case.soil, firmness, u)
        vibration = self._vibration(case.soil, slip, load, leg, lowest_load)
        columns = {QUANTITIES["normal_stiffness"].column: np.broadcast_to(firmness, slip.shape)}
        return vibration, columns | {f"stick-slip.{name}": v for name, v in leg.items()}

    def _leg(self, soil: Soil, firmness: Floats, u: Floats) -> dict[str, Floats]:
        """k_S (N/m) and the drop of friction (rad), (n,), for fractions `u` (n, 2) of their ranges.

        Without ranges they follow Comin and Saaj 2017, eq. 28.
        """
        if self.stiffness is None or self.drop is None:
            drop, stiffness = affine(SPRING_OF_SOIL, np.asarray(soil.friction_angle), firmness)
            found = np.broadcast_arrays(drop, stiffness, u[:, 0])
            return {"stiffness": found[1], "increment": found[0]}
        increment = self.drop.at(u[:, 1]) * np.asarray(soil.friction_angle)
        return {"stiffness": self.stiffness.at(u[:, 0]), "increment": increment}

    def _vibration(
        self, soil: Soil, slip: Floats, load: Floats, leg: dict[str, Floats], lowest_load: float
    ) -> Floats:
        r"""Largest amplitude of the hub's acceleration (m/s^2) in a stride, (n,), without noise.

        The spring carries the row's load; no load is below `lowest_load` (N). The line is Comin and
        Saaj 2017, eq. 24, with the linear parameters of their table V: \Delta a = (i - a) / b.
        Raises `InputError` for a soil on which that line has no slope.
        """
        if self.stiffness is None:
            a, b = VIBRATION.line(*affine(SPRING, leg["increment"], leg["stiffness"]))
            if b.min() < MIN_SLOPE:
                drop = np.rad2deg(leg["increment"][int(np.argmin(b))])
                raise InputError(
                    f"[stick_slip] law is 'line': friction drops by {drop:.1f} degrees, and slip "
                    "no longer follows vibration; lower friction_angle or kphi in [soil.prior]"
                )
            return np.asarray(np.maximum((slip - a) / b, 0.0))
        # an additional row, the stiffest leg with the lightest hub, sets the same time step in
        # all pieces
        spring = replace(
            self.leg,
            stiffness=np.append(leg["stiffness"], self.stiffness.upper),
            hub_mass=np.append(load, lowest_load) / GRAVITY,
        )
        angle = np.append(np.broadcast_to(soil.friction_angle, slip.shape), 0.5)
        increment = np.append(leg["increment"], 0.0)
        return vibration_amplitude(spring, np.append(slip, 0.0), angle, increment)[:-1]


def normal_stiffness(soil: Soil, width: Any) -> Floats:
    r"""sigma_1 (Pa), the pressure 1 cm deep under a plate as wide as the gear.

    .. math:: \sigma_1 = (k_c / b + k_\varphi) (1 cm)^n

    References: Comin and Saaj 2017, who write sigma_0 + alpha_z 1 cm for a linear soil.
    """
    return np.asarray((soil.kc / width + soil.kphi) * 0.01**soil.n)
