"""From measured climbs to climbing ability: what `soilml paper climb` computes and says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.numerics.quantiles import QuantileBand, quantile_band
from soilml.quantities import SHEAR
from soilml.remarks import Remark, about
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_band
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
ZERO_SLIP_SIGMAS = 2.0  # Slips within this many standard deviations of zero have no certain sign
SLIPS = 9  # Slips of the curve in its table


@dataclass(frozen=True)
class ClimbingReport:
    """Soil, climbing ability, the shear modulus of each climb alone, and whether stresses agree.

    modulus: k_x of each climb alone, m (climbs,).
    stress: By wheel, the arc on slopes less that at artificial slip; None where not measured.
    """

    ground: GroundEstimate
    ability: ClimbingAbility
    data: ClimbData
    modulus: Floats
    stress: dict[str, StressComparison | None]

    @property
    def curve(self) -> dict[str, Any]:
        """Pull on level ground and slope over slip, with their bands, by names of columns."""
        bands = {"drawbar_pull_N": self.ability.pull, "slope_rad": self.ability.slope}
        found: dict[str, Any] = {"slip": self.ability.slip}
        for name, draws in bands.items():
            band = quantile_band(draws)
            found |= {name: band.middle, f"{name}_p05": band.lower, f"{name}_p95": band.upper}
        return found

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

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Limitations of the data and of the estimate."""
        warnings, noise = list(self.ground.fit.warnings), self.ground.noise
        if self.ability.fraction_still_rising > MAX_STILL_RISING:
            text = (
                f"in {self.ability.fraction_still_rising:.0%} of the samples the slope still rises "
                f"with slip at {self.ability.slip[-1]:.2f}, the end of the curve: measure stress "
                "at higher slips"
            )
            warnings.append(Remark("still-rising", text))
        steepest = float(quantile_band(self.ability.steepest).upper)
        least = ZERO_SLIP_SIGMAS * np.hypot(noise.speed_m_s.share, noise.speed_scale)
        climbs = self.data.climbs
        steep = [c.name for c in climbs if c.slope > steepest]
        if steep:
            text = (
                f"run {', '.join(steep)} climbed more than the predicted "
                f"{np.rad2deg(steepest):.3g} deg at most: inconsistent with the others"
            )
            warnings.append(Remark("inconsistent", text, tuple(steep)))
        zero = [c.name for c in climbs if any(abs(wheel.slip) < least for wheel in c.wheels)]
        if zero:
            text = (
                f"slip is zero within its noise in run {', '.join(zero)}: the direction of the "
                "shear displacement there is not known"
            )
            warnings.append(Remark("zero-slip", text, tuple(zero)))
        differ = [wheel for wheel, found in self.stress.items() if found and not found.equal]
        if differ:
            text = (
                f"stress of the {' and '.join(differ)} wheel on slopes differs from that at "
                "artificial slip: the curve at slips that were not climbed is not supported"
            )
            warnings.append(Remark("stress-differs", text, tuple(differ)))
        return tuple(warnings)

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml paper climb` writes."""
        fit, ability, rover = self.ground.fit, self.ability, self.ground.rover
        columns = {name: np.asarray(values).tolist() for name, values in self.climbs.items()}
        given = dict(zip(SHEAR, self.ground.samples[0].tolist(), strict=True))
        return {
            "ground": fit.as_json()
            | {"given": {name: value for name, value in given.items() if name not in fit.names}},
            "front_share": rover.front_share,
            "height_ratio": rover.height_ratio,
            "runs": [
                dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)
            ],
            "curve": {
                "slip": ability.slip.tolist(),
                "drawbar_pull_N": _listed(quantile_band(ability.pull)),
                "slope_rad": _listed(quantile_band(ability.slope)),
            },
            "steepest_slope_rad": _listed(quantile_band(ability.steepest)),
            "slip_at_steepest": _listed(quantile_band(ability.steepest_slip)),
            "warnings": [remark.as_json() for remark in self.warnings],
        }

    def report(self, title: str = "Slopes that a rover climbs") -> Report:
        """The steepest slope, the soil, pull and slope over slip, and the check of the stress."""
        fit, ability = self.ground.fit, self.ability
        verdict = f"The rover climbs {_band(quantile_band(ability.steepest), 'rad')}."
        lines = [f"That is at slip {_band(quantile_band(ability.steepest_slip))}."]
        checked = {wheel: found for wheel, found in self.stress.items() if found is not None}
        if checked and all(found.equal for found in checked.values()):
            lines.append("Stress on slopes equals stress at artificial slip within its scatter.")
        left = [fit.remaining_fraction.get(name) for name in fit.names]
        at = np.linspace(0, len(ability.slip) - 1, SLIPS).astype(int)
        tables = [
            ReportTable.of("Pull and slope over slip", {k: v[at] for k, v in self.curve.items()}),
            ReportTable.of("Climbs", self.climbs),
        ]
        if checked:
            ends = [f"{wheel} {end}" for wheel in checked for end in ("exit", "entry", "centre")]
            apart, std = (
                np.concatenate([getattr(found, name) for found in checked.values()]).tolist()
                for name in ("difference", "std")
            )
            columns = [Column("angle", ends), Column("difference", apart, "rad", std)]
            tables.append(
                ReportTable("Stressed arc on slopes less that at artificial slip", columns)
            )
        climbs, slopes = fit.rows_used, self.ground.distinct_slopes
        vague = about(self.warnings, "not-identified")
        return Report(
            kind="climb",
            verdict=verdict,
            lines=lines,
            figures=ReportTable.of_parameters(
                "Soil",
                fit.frame_columns(),
                left_of_prior=Column("left of prior", left, "share", digits=2),
            ),
            tables=tables,
            pictures=[
                column_picture(
                    self.curve,
                    "slip",
                    [("drawbar_pull_N",), ("slope_rad",)],
                    title="Pull and slope over slip",
                    caption="Lines: medians, with bands of 90 %. Dots: the climbs, at the mean "
                    "slip of both wheels.",
                    measured={
                        "slip": [0.5 * (c.front.slip + c.rear.slip) for c in self.data.climbs],
                        "slope_rad": [c.slope for c in self.data.climbs],
                    },
                )
            ],
            remarks=self.warnings,
            next_steps=["climb a steeper slope within the band, and run the command again"],
            status="partly known" if vague else "predicted",
            tone="warn" if vague else "good",
            title=title,
            basis=f"{climbs} climb{'s'[: climbs != 1]} on {slopes} slope{'s'[: slopes != 1]}",
            notation=[("90 %", "from the 5 % to the 95 % quantile; medians before them.")],
        )


def _band(found: QuantileBand, unit: str = "1") -> str:
    return format_band(float(found.lower), float(found.middle), float(found.upper), unit)


def _listed(band: QuantileBand) -> dict[str, Any]:
    named = (("median", band.middle), ("p05", band.lower), ("p95", band.upper))
    return {name: np.asarray(values).tolist() for name, values in named}


def climbing_report(file: RoverFile, data: ClimbData, *, seed: int = 0) -> ClimbingReport:
    """Identify the soil, fit stress against slip, and predict the climbing ability."""
    front, rear = (StressBySlip.fit(data.of_wheel(wheel)) for wheel in WHEELS)
    ground = identify_ground(
        file.rover, data.climbs, fixed=file.fixed, prior=file.prior, noise=file.noise, seed=seed
    )
    cohesion, friction, _ = ground.shear
    return ClimbingReport(
        ground,
        climbing_ability(ground, front, rear, seed=seed),
        data,
        modulus_per_climb(file.rover, data.climbs, cohesion=cohesion, friction_angle=friction),
        stress={
            wheel: compare_stress(
                [climb.wheels[i] for climb in data.climbs], data.of_wheel(wheel, climbs=False)
            )
            for i, wheel in enumerate(WHEELS)
        },
    )
