"""The log of a tracked robot's pulls: slip, pull and sinkage of each, the soil, and its figures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError, TableError
from soilml.identification import Fit, identify
from soilml.io.table import Table
from soilml.physics.gears.track_belt import Belt
from soilml.physics.operating_point import Operating
from soilml.report.column_figure import column_picture
from soilml.report.numbers import format_quantity
from soilml.report.report import Report
from soilml.report.tables import ReportTable
from soilml.systems.tracked_robot.robot import (
    GRAVITY,
    DiscreteGrousers,
    TrackedRobot,
    grouser_pull,
    track_of,
)
from soilml.systems.tracked_robot.signals import (
    rear_sinkage,
    slip_from_displacements,
    stationary_mean,
)

#: Columns of a log: travel of the belt and of the robot (m), tension of the gauge between robot and
#: payload (N); further ones of the laser distances (m) and the inclination, tail down (rad).
LOG = ("run", "belt_travel_m", "travel_m", "tension_N")
LASERS = ("front_laser_m", "rear_laser_m", "inclination_rad")
WINDOWS = 8  # Windows of the stationary part whose slips scatter
POINTS = 401  # Points along the belt
#: Columns of each panel of the picture; the last has figure 8 of the source.
PANELS = (
    ("pull_predicted_N", "pull_with_grousers_N"),
    ("rear_sinkage_predicted_m",),
    ("front_entry_rad", "front_exit_rad", "rear_entry_rad", "rear_exit_rad"),
)


@dataclass(frozen=True)
class TrackLog:
    """Steady pulls of one track (a row for each run), the soil by them, and what it predicts.

    rows: run, slip, load_N, drawbar_pull_N with standard deviations, rear_sinkage_m if measured.
    fit: Of the soil to the pulls; None where the case has no prior.
    case: With the fitted values.
    grousers: Discrete ones, whose pull stands beside; None without.
    """

    rows: Table
    fit: Fit | None
    case: Case
    grousers: DiscreteGrousers | None

    @cached_property
    def columns(self) -> dict[str, Any]:
        """The rows with the model's pull, rear sinkage and angles of the belt (fig. 8, rad)."""
        at = Operating(slip=self.rows["slip"], load=self.rows["load_N"])
        force, belt = self.case.model(self.case.soil, at), self._belt(at)
        found = {**self.rows.columns, "pull_predicted_N": np.asarray(force.drawbar_pull)}
        found["rear_sinkage_predicted_m"] = np.asarray(belt.rear)
        if self.grousers is not None:
            mass = 2.0 * self.rows["load_N"][0] / GRAVITY
            robot = TrackedRobot(track_of(self.case.model), mass)
            found["pull_with_grousers_N"] = 0.5 * np.asarray(
                [
                    grouser_pull(robot, self.case.soil, slip, self.grousers).mean()
                    for slip in self.rows["slip"].tolist()
                ]
            )
        angles = {
            "front_entry": belt.entry,
            "front_exit": belt.leave,
            "rear_entry": belt.meet,
            "rear_exit": belt.exit,
        }
        return found | {f"{name}_rad": np.asarray(angle) for name, angle in angles.items()}

    def _belt(self, at: Operating) -> Belt:
        """The line of the belt at operating points, by the model in equilibrium."""
        sunk = np.asarray(self.case.model(self.case.soil, at).sinkage)
        return track_of(self.case.model).contact_geometry(sunk, self.case.soil, at)

    @property
    def belt_line(self) -> dict[str, Floats]:
        """Distance from the entry and height (m) along the belt at the median slip (fig. 7)."""
        at = Operating(
            slip=np.median(self.rows["slip"], keepdims=True), load=self.rows["load_N"][:1]
        )
        angle, contact = track_of(self.case.model).profile_contact(self._belt(at), at, POINTS)
        angle, along = np.asarray(angle)[:, 0], np.asarray(contact.surface_travel)[:, 0]
        step, middle = np.diff(along), 0.5 * (angle[1:] + angle[:-1])
        return {
            "along_m": np.append(0.0, np.cumsum(np.cos(middle) * step)),
            "height_m": np.append(0.0, np.cumsum(-np.sin(middle) * step)),
        }

    def report(self, title: str = "Soil from the pulls of a tracked robot") -> Report:
        """The soil by the pulls, how far the model is off, and a row for each pull."""
        found, fit = self.columns, self.fit
        off = np.sqrt(np.mean((found["pull_predicted_N"] - found["drawbar_pull_N"]) ** 2))
        said = f"The pull of a track is off by {format_quantity(float(off), 'N')}"
        said += f" in {len(self.rows)} pulls."
        panels = [tuple(name for name in panel if name in found) for panel in PANELS]
        read = {"pull_predicted_N": "drawbar_pull_N", "rear_sinkage_predicted_m": "rear_sinkage_m"}
        measured = {name: found[own] for name, own in read.items() if own in found}
        return Report(
            kind="track",
            verdict=said if fit is None else fit.verdict,
            lines=[] if fit is None else [said],
            figures=None if fit is None else ReportTable.of_parameters("Soil", fit.frame_columns()),
            tables=[ReportTable.of("Pulls", found)],
            pictures=[
                column_picture(
                    found,
                    "slip",
                    panels,
                    title="Pull, sinkage and angles of the belt",
                    measured={"slip": found["slip"], **measured},
                ),
                column_picture(
                    self.belt_line, "along_m", [("height_m",)], title="Line of the belt"
                ),
            ],
            remarks=() if fit is None else fit.warnings,
            title=title,
        )


def steady_pulls(log: Table, load: float, spacing: float | None = None) -> Table:
    """A row for each run of a log: slip, pull of one track and sinkage in its stationary part.

    load: On one track, N; the gauge has the pull of both. spacing: Of the lasers, m; needed for
    the sinkage of the rear wheel. Means over a stationary part are those over the ruts of grousers,
    weighted by their lengths (eq. 17). Raises `TableError` naming the run whose signals have no
    stationary part. References: Wang et al. 2018, sections 4.1.1 to 4.1.3, figs. 9 to 12.
    """
    with_lasers = all(name in log for name in LASERS)
    if with_lasers and spacing is None:
        raise InputError("the log has laser distances: give their spacing")
    found: dict[str, list[Any]] = {}
    for name, rows in log.groups():
        try:
            steady = stationary_mean(rows["tension_N"], above=0.0)
            part = slice(steady.start, steady.stop)
            belt, robot = rows["belt_travel_m"][part], rows["travel_m"][part]
            slip = slip_from_displacements(belt, robot, len(belt) // WINDOWS)
            row = {
                "run": name,
                "slip": float(slip.mean()),
                "slip_std": float(slip.std() / np.sqrt(WINDOWS)),
                "load_N": load,
                "drawbar_pull_N": 0.5 * steady.mean,
                "drawbar_pull_N_std": 0.5 * steady.std_error,
            }
            if with_lasers and spacing is not None:
                front, rear, angle = (rows[k][part] for k in LASERS)
                row["rear_sinkage_m"] = float(rear_sinkage(rear, front, angle, spacing).mean())
        except (FitError, InputError) as error:
            raise TableError(f"{log.source}, run {name}: {error}") from None
        for key, value in row.items():
            found.setdefault(key, []).append(value)
    return Table({key: np.asarray(values) for key, values in found.items()}, log.source)


def evaluate_log(
    case: Case,
    log: Table,
    load: float,
    spacing: float | None = None,
    grousers: DiscreteGrousers | None = None,
) -> TrackLog:
    """From a log to the soil: steady pulls, and the fit of the case's free parameters to them.

    Arguments as in `steady_pulls`; `grousers` as in `grouser_pull`. References: Wang et al. 2018,
    sections 4.1 and 4.2.
    """
    track_of(case.model)
    rows, fit = steady_pulls(log, load, spacing), None
    if case.prior:
        kept = ("run", "slip", "load_N", "drawbar_pull_N", "drawbar_pull_N_std")
        measured = Table({name: rows[name] for name in kept}, rows.source)
        measured.columns["run"] = np.full(len(rows), "log")  # one soil
        fit = identify(case, measured, method="nonlinear")
        case = case.with_values(dict(zip(fit.names, fit.values.tolist(), strict=True)))
    return TrackLog(rows, fit, case, grousers)
