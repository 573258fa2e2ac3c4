"""From measured climbs to climbing ability: the report of `soilml paper climb`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.quantities import SHEAR
from soilml.remarks import Remark
from soilml.report.figure_style import AFTER, BEFORE, take_axes
from soilml.systems.rim_stress.ability import (
    ClimbingAbility,
    check_slip,
    climbing_ability,
    shared_slips,
)
from soilml.systems.rim_stress.climb_balances import modulus_per_climb
from soilml.systems.rim_stress.ground import GroundEstimate, identify_ground
from soilml.systems.rim_stress.rover_file import RoverFile
from soilml.systems.rim_stress.stress_by_slip import StressBySlip
from soilml.systems.rim_stress.tables import ClimbData

#: Fraction of samples whose slope still rises at the highest slip, above which a warning is given.
MAX_STILL_RISING = 0.05
ZERO_SLIP_SIGMAS = 2.0  # Slips within this many standard deviations of zero have no certain sign
SLIP_MARGIN = 0.02  # Distance from the curve's range at which the slip of a climb counts as outside
#: Relative error of the speeds assumed for the table of k_x by run, as in Fig. 9.
SPEED_ERROR = 0.015
FIGURE_SIZE = (9.0, 3.8)  # Width and height of the figure, inches


@dataclass(frozen=True)
class ClimbingReport:
    """Soil, climbing ability, the shear modulus of each climb alone, and warnings."""

    ground: GroundEstimate
    ability: ClimbingAbility
    data: ClimbData
    modulus_per_climb: dict[float, Floats]  # speed error -> k_x of each climb, m
    slip_limit: float | None

    @property
    def pull(self) -> QuantileBand:
        """Drawbar pull on level ground over the slips of `ability`, N."""
        return quantile_band(self.ability.pull)

    @property
    def slope(self) -> QuantileBand:
        """Slope climbed over the slips of `ability`, rad."""
        return quantile_band(self.ability.slope)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Limitations of the data and of the estimate."""
        warnings = list(self.ground.fit.warnings)
        highest, lowest = self.ability.slip[-1], self.ability.slip[0]
        if self.ability.fraction_still_rising > MAX_STILL_RISING:
            text = (
                f"in {self.ability.fraction_still_rising:.0%} of the samples the slope still rises "
                f"with slip at {highest:.2f}, the end of the curve: measure stress at higher slips"
            )
            warnings.append(Remark("still-rising", text))
        noise = self.ground.noise
        zero_slip = [
            climb.name
            for climb in self.data.climbs
            if any(
                abs(w.slip) < ZERO_SLIP_SIGMAS * np.hypot(noise.speed, noise.speed_scale)
                for w in climb.wheels
            )
        ]
        if zero_slip:
            text = (
                f"slip is zero within its noise in run {', '.join(zero_slip)}: the direction of "
                "the shear displacement there is not known"
            )
            warnings.append(Remark("zero-slip", text, tuple(zero_slip)))
        outside = [
            c.name
            for c in self.data.climbs
            if not all(
                lowest - SLIP_MARGIN <= wheel.slip <= highest + SLIP_MARGIN for wheel in c.wheels
            )
        ]
        if outside:
            text = f"the slip of run {', '.join(outside)} lies outside the curve"
            warnings.append(Remark("outside-curve", text, tuple(outside)))
        most = float(quantile_band(self.ability.steepest).upper)
        warnings += [
            Remark(
                "inconsistent",
                f"run {climb.name} climbed {np.rad2deg(climb.slope):.3g} deg, more than predicted "
                f"(at most {np.rad2deg(most):.3g}): it is inconsistent with the others",
                (climb.name,),
            )
            for climb in self.data.climbs
            if climb.slope > most
        ]
        return tuple(warnings)

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw pull (N) and slope (degrees) against slip with 90 % bands, and the climbs.

        `ax`: two axes of matplotlib; a new figure where None. Returns the axes, (2,). Raises
        `InputError` for another number of axes.
        """
        left, right = axes = take_axes(ax, 1, 2, FIGURE_SIZE)[0]
        slip = self.ability.slip
        for panel, band, factor in ((left, self.pull, 1.0), (right, self.slope, np.rad2deg(1.0))):
            panel.fill_between(
                slip, factor * band.lower, factor * band.upper, color=AFTER, alpha=0.3, lw=0,
                label="90 %",
            )  # fmt: skip
            panel.plot(slip, factor * band.middle, color=AFTER, lw=1.4, label="median")
            panel.axhline(0.0, color="#888888", lw=0.7)
            panel.set_xlabel("slip")
        climbs = self.data.climbs
        mean_slip = [0.5 * (c.front.slip + c.rear.slip) for c in climbs]
        right.plot(
            mean_slip, np.rad2deg([c.slope for c in climbs]), "o", color=BEFORE, ms=5,
            label="climbs, mean slip",
        )  # fmt: skip
        left.set_ylabel("drawbar pull on level ground, N")
        right.set_ylabel("slope climbed, degrees")
        right.legend(frameon=False, loc="lower right")
        return np.asarray(axes)

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml paper climb` writes."""
        fit = self.ground.fit.as_json()
        fit["given"] = {
            name: float(self.ground.samples[0, i])
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
                    "off_N": float(residual),
                    "off_N_std": float(std),
                }
                for climb, residual, std in zip(
                    self.data.climbs, self.ground.residual, self.ground.residual_std, strict=True
                )
            ],
            "curve": {
                "slip": self.ability.slip.tolist(),
                "drawbar_pull_N": _listed(self.pull),
                "slope_rad": _listed(self.slope),
            },
            "steepest_slope_rad": _listed(quantile_band(self.ability.steepest)),
            "slip_at_steepest": _listed(quantile_band(self.ability.steepest_slip)),
            "slips_with_stress": [float(self.ability.slip[0]), float(self.ability.slip[-1])],
            "warnings": [remark.as_json() for remark in self.warnings],
        }
        if self.slip_limit is not None:
            within = self.ability.steepest_within(self.slip_limit)
            content["steepest_slope_within_slip_limit_rad"] = _listed(quantile_band(within))
            content["slip_limit"] = self.slip_limit
        return content


def _listed(interval: QuantileBand) -> dict[str, Any]:
    names = ("median", "p05", "p95")
    values = (interval.middle, interval.lower, interval.upper)
    return {n: np.asarray(v).tolist() for n, v in zip(names, values, strict=True)}


def climbing_report(
    file: RoverFile, data: ClimbData, *, slip_limit: float | None = None, seed: int = 0
) -> ClimbingReport:
    """Identify the soil, fit stress against slip, and predict the climbing ability."""
    front, rear = StressBySlip.fit(data.front), StressBySlip.fit(data.rear)
    if slip_limit is not None:
        check_slip(slip_limit, shared_slips(front, rear))
    ground = identify_ground(
        file.rover, data.climbs, fixed=file.fixed, prior=file.prior, noise=file.noise, seed=seed
    )
    ability = climbing_ability(ground, front, rear, seed=seed)
    cohesion, friction, _ = ground.shear
    by_speed_error = {
        error: modulus_per_climb(
            file.rover, data.climbs, cohesion=cohesion, friction_angle=friction, speed_error=error
        )
        for error in (-SPEED_ERROR, 0.0, SPEED_ERROR)
    }
    return ClimbingReport(ground, ability, data, by_speed_error, slip_limit)
