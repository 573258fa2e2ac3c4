"""From measured climbs to climbing ability: what `soilml paper climb` computes and says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import band_columns, quantile_band
from soilml.remarks import Remark, about
from soilml.report.column_figure import column_picture
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable
from soilml.systems.rim_stress.ability import (
    ClimbingAbility,
    StressBySlip,
    StressComparison,
    climbing_ability,
    compare_stress,
)
from soilml.systems.rim_stress.climbs import WHEELS, RoverFile, modulus_per_climb
from soilml.systems.rim_stress.ground import GroundEstimate, identify_ground
from soilml.systems.rim_stress.tables import ClimbData

#: Fraction of samples whose slope still rises at the highest slip, above which a warning is given.
MAX_STILL_RISING = 0.05
SLIPS = 9  # Slips of the curve in its table
ENDS = ("exit", "entry", "centre")  # Angles that are compared


@dataclass(frozen=True)
class ClimbingReport:
    """Soil, climbing ability, the shear modulus of each climb alone, and whether stresses agree.

    modulus: k_x of each climb alone, m (climbs,).
    stress: By wheel, the arc on slopes less that at artificial slip; only where measured.
    """

    ground: GroundEstimate
    ability: ClimbingAbility
    data: ClimbData
    modulus: Floats
    stress: dict[str, StressComparison]

    @property
    def curve(self) -> dict[str, Floats]:
        """Pull on level ground and slope over slip, with their bands, by names of columns."""
        pull, slope = self.ability.pull, self.ability.slope
        bands = band_columns("drawbar_pull_N", pull) | band_columns("slope_rad", slope)
        return {"slip": self.ability.slip} | bands

    @property
    def climbs(self) -> dict[str, Any]:
        """A row for each climb: slips, what its balance is off, and its own k_x."""
        climbs = self.data.climbs
        return {
            "run": [c.name for c in climbs],
            "slope_rad": [c.slope for c in climbs],
            "slip_front": [c.front.slip for c in climbs],
            "slip_rear": [c.rear.slip for c in climbs],
            "off_N": self.ground.residual,
            "off_N_std": self.ground.residual_std,
            "shear_modulus_m": self.modulus,
        }

    def as_json(self) -> dict[str, Any]:
        """Soil, steepest slope, curve and climbs, in SI units."""
        fit, ability = self.ground.fit, self.ability
        found = band_columns("steepest_slope_rad", ability.steepest)
        found |= band_columns("slip_at_steepest", ability.steepest_slip)
        tables = {"curve": self.curve, "climbs": self.climbs}
        return {
            "soil": fit.as_json(),
            **{name: float(value) for name, value in found.items()},
            **{
                title: {name: np.asarray(values).tolist() for name, values in columns.items()}
                for title, columns in tables.items()
            },
        }

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Limitations of the data and of the estimate."""
        warnings = list(self.ground.fit.warnings)
        if self.ability.fraction_still_rising > MAX_STILL_RISING:
            text = (
                f"in {self.ability.fraction_still_rising:.0%} of the samples the slope still rises "
                f"with slip at {self.ability.slip[-1]:.2f}, the end of the curve: measure stress "
                "at higher slips"
            )
            warnings.append(Remark("still-rising", text))
        steepest = float(quantile_band(self.ability.steepest).upper)
        steep = [c.name for c in self.data.climbs if c.slope > steepest]
        if steep:
            text = (
                f"run {', '.join(steep)} climbed more than the predicted "
                f"{np.rad2deg(steepest):.3g} deg at most: inconsistent with the others"
            )
            warnings.append(Remark("inconsistent", text, tuple(steep)))
        differ = [wheel for wheel, found in self.stress.items() if not found.equal]
        if differ:
            text = (
                f"stress of the {' and '.join(differ)} wheel on slopes differs from that at "
                "artificial slip: the curve at slips that were not climbed is not supported"
            )
            warnings.append(Remark("stress-differs", text, tuple(differ)))
        return tuple(warnings)

    def report(self, title: str = "Slopes that a rover climbs") -> Report:
        """The steepest slope, the soil, pull and slope over slip, and the check of the stress."""
        fit, best = self.ground.fit, quantile_band(self.ability.steepest)
        lines = [f"That is at slip {quantile_band(self.ability.steepest_slip).text()}."]
        if self.stress and all(found.equal for found in self.stress.values()):
            lines.append("Stress on slopes equals stress at artificial slip within its scatter.")
        left = [fit.remaining_fraction.get(name) for name in fit.names]
        curve, climbs = self.curve, self.climbs
        at = np.linspace(0, len(curve["slip"]) - 1, SLIPS).astype(int)
        tables = [
            ReportTable.of("Pull and slope over slip", {k: v[at] for k, v in curve.items()}),
            ReportTable.of("Climbs", climbs),
        ]
        if self.stress:
            of_ends = {
                "angle": [f"{wheel} {end}" for wheel in self.stress for end in ENDS],
                "difference_rad": np.concatenate([s.difference for s in self.stress.values()]),
                "difference_rad_std": np.concatenate([s.std for s in self.stress.values()]),
            }
            title_of_ends = "Stressed arc on slopes less that at artificial slip"
            tables.append(ReportTable.of(title_of_ends, of_ends))
        slip = 0.5 * (np.asarray(climbs["slip_front"]) + climbs["slip_rear"])
        slopes = self.ground.distinct_slopes
        vague = about(self.warnings, "not-identified")
        return Report(
            kind="climb",
            verdict=f"The rover climbs {best.text('rad')}.",
            lines=lines,
            figures=ReportTable.of_parameters(
                "Soil",
                fit.frame_columns(),
                left_of_prior=Column("left of prior", left, "share", digits=2),
            ),
            tables=tables,
            pictures=[
                column_picture(
                    curve,
                    "slip",
                    [("drawbar_pull_N",), ("slope_rad",)],
                    title="Pull and slope over slip",
                    caption="Lines: medians, with bands of 90 %. Dots: the climbs, at the mean "
                    "slip of both wheels.",
                    measured={"slip": slip, "slope_rad": climbs["slope_rad"]},
                )
            ],
            remarks=self.warnings,
            next_steps=["climb a steeper slope within the band, and run the command again"],
            status="partly known" if vague else "predicted",
            tone="warn" if vague else "good",
            title=title,
            basis=f"{fit.rows_used} climb{'s'[: fit.rows_used != 1]} on {slopes} "
            f"slope{'s'[: slopes != 1]}",
            notation=[("90 %", "from the 5 % to the 95 % quantile; medians before them.")],
        )


def climbing_report(file: RoverFile, data: ClimbData, *, seed: int = 0) -> ClimbingReport:
    """Identify the soil, fit stress against slip, and predict the climbing ability."""
    front, rear = (StressBySlip.fit(data.climbed(i) + data.level[i]) for i in range(2))
    ground = identify_ground(
        file.rover, data.climbs, fixed=file.fixed, prior=file.prior, noise=file.noise, seed=seed
    )
    cohesion, friction, _ = ground.shear
    compared = {
        wheel: compare_stress(data.climbed(i), data.level[i]) for i, wheel in enumerate(WHEELS)
    }
    return ClimbingReport(
        ground,
        climbing_ability(ground, front, rear, seed=seed),
        data,
        modulus_per_climb(file.rover, data.climbs, cohesion=cohesion, friction_angle=friction),
        {wheel: found for wheel, found in compared.items() if found is not None},
    )
