"""The whole way from files to climbing ability, and what may be said of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import SHEAR
from soilml.systems.climbing.ability import (
    Ability,
    Band,
    band,
    check_slip,
    climbing_ability,
    shared_slips,
)
from soilml.systems.climbing.files.read_tables import Driven
from soilml.systems.climbing.files.rover_file import RoverFile
from soilml.systems.climbing.identify import Ground, identify_ground
from soilml.systems.climbing.modulus_per_climb import modulus_of_each
from soilml.systems.climbing.stress_by_slip import StressBySlip

Floats = NDArray[np.float64]

#: Share of draws that still climb better at the highest slip, above which that is said.
OPEN = 0.05
#: Share by which speeds are taken to be off for the table of k_x by run, as in Fig. 9.
SPEED_ERROR = 0.015


@dataclass(frozen=True)
class ClimbingReport:
    """Ground, climbing ability, each climb on its own, and warnings."""

    ground: Ground
    ability: Ability
    driven: Driven
    each: dict[float, Floats]  # speed error -> k_x of each climb, m
    slip_limit: float | None

    @property
    def pull(self) -> Band:
        """Drawbar pull on the flat over the slips of `ability`, N."""
        return band(self.ability.pull)

    @property
    def slope(self) -> Band:
        """Slope climbed over the slips of `ability`, rad."""
        return band(self.ability.slope)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before believing it."""
        said = list(self.ground.fit.warnings)
        highest, lowest = self.ability.slip[-1], self.ability.slip[0]
        if self.ability.open_end > OPEN:
            said.append(
                f"in {self.ability.open_end:.0%} of the draws slopes still rise with slip at "
                f"{highest:.2f}, where the stresses end: measure stress at higher slips"
            )
        noise = self.ground.noise
        still = [
            climb.name
            for climb in self.driven.climbs
            if any(
                abs(w.slip) < 2.0 * np.hypot(noise.speed, noise.speed_scale) for w in climb.wheels
            )
        ]
        if still:
            said.append(
                f"slip is nil within its noise in run {', '.join(still)}: which way the soil is "
                "sheared there is not known"
            )
        outside = [
            c.name
            for c in self.driven.climbs
            if not all(lowest - 0.02 <= wheel.slip <= highest + 0.02 for wheel in c.wheels)
        ]
        if outside:
            said.append(f"the curve does not reach the slip of run {', '.join(outside)}")
        most = float(band(self.ability.steepest).upper)
        said += [
            f"run {climb.name} climbed {climb.slope:.3g} rad, more than is predicted ({most:.3g} "
            "at most): it disagrees with the others"
            for climb in self.driven.climbs
            if climb.slope > most
        ]
        return tuple(said)

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml climb` writes."""
        fit = self.ground.fit.as_json()
        fit["given"] = {
            name: float(self.ground.draws[0, i])
            for i, name in enumerate(SHEAR)
            if name not in self.ground.fit.names
        }
        content: dict[str, Any] = {
            "ground": fit,
            "front_share": self.ground.rover.front_share,
            "height_ratio": self.ground.rover.height_ratio,
            "runs": [
                {
                    "run": climb.name,
                    "slope_rad": climb.slope,
                    "slip_front": climb.front.slip,
                    "slip_rear": climb.rear.slip,
                    "off_N": float(off),
                    "off_N_std": float(std),
                }
                for climb, off, std in zip(
                    self.driven.climbs, self.ground.off, self.ground.off_std, strict=True
                )
            ],
            "curve": {
                "slip": self.ability.slip.tolist(),
                "drawbar_pull_N": _listed(self.pull),
                "slope_rad": _listed(self.slope),
            },
            "steepest_slope_rad": _listed(band(self.ability.steepest)),
            "slip_at_steepest": _listed(band(self.ability.steepest_slip)),
            "slips_with_stress": [float(self.ability.slip[0]), float(self.ability.slip[-1])],
            "warnings": list(self.warnings),
        }
        if self.slip_limit is not None:
            within = self.ability.steepest_within(self.slip_limit)
            content["steepest_slope_within_slip_limit_rad"] = _listed(band(within))
            content["slip_limit"] = self.slip_limit
        return content


def _listed(found: Band) -> dict[str, Any]:
    names = ("median", "p05", "p95")
    values = (found.middle, found.lower, found.upper)
    return {n: np.asarray(v).tolist() for n, v in zip(names, values, strict=True)}


def climbing_report(
    file: RoverFile, driven: Driven, *, slip_limit: float | None = None, seed: int = 0
) -> ClimbingReport:
    """Identify the ground, take stress against slip, and predict the climbs."""
    front, rear = StressBySlip.of(driven.front), StressBySlip.of(driven.rear)
    if slip_limit is not None:
        check_slip(slip_limit, shared_slips(front, rear))
    ground = identify_ground(
        file.rover, driven.climbs, given=file.given, prior=file.prior, noise=file.noise, seed=seed
    )
    ability = climbing_ability(ground, front, rear, seed=seed)
    cohesion, friction, _ = ground.shear
    each = {
        error: modulus_of_each(
            file.rover,
            driven.climbs,
            cohesion=cohesion,
            friction_angle=friction,
            speed_error=error,
        )
        for error in (-SPEED_ERROR, 0.0, SPEED_ERROR)
    }
    return ClimbingReport(ground, ability, driven, each, slip_limit)
