"""The log of a tracked robot's pulls: slip, pull and sinkage of each, the soil, and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError, TableError
from soilml.identification import Fit, identify
from soilml.io.table import Table
from soilml.physics.gears.track_belt import Belt
from soilml.physics.operating_point import Operating
from soilml.report.figure_style import AFTER, BEFORE, UNCHANGED
from soilml.report.numbers import format_quantity
from soilml.report.report import Picture, Report
from soilml.report.tables import ReportTable
from soilml.systems.tracked_robot.robot import (
    DiscreteGrousers,
    TrackedRobot,
    grouser_pull,
    track_of,
)
from soilml.systems.tracked_robot.signals import (
    low_pass,
    rear_sinkage,
    slip_from_displacements,
    stationary_mean,
)

#: Columns of a log: travel of the belt and of the robot (m), tension of the gauge between robot and
#: payload (N); further ones of the laser distances (m) and the inclination, tail down (rad).
LOG = ("run", "time_s", "belt_travel_m", "travel_m", "tension_N")
LASERS = ("front_laser_m", "rear_laser_m", "inclination_rad")
#: Cutoff of the low-pass of the lasers, Hz; windows of the stationary part whose slips scatter.
CUTOFF, WINDOWS = 2.0, 8
POINTS = 401  # Points along the belt and along the curve


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

    @property
    def at(self) -> Operating:
        """The operating points of the rows."""
        return Operating(slip=self.rows["slip"], load=self.rows["load_N"])

    def belt(self, at: Operating) -> Belt:
        """The line of the belt at operating points, by the model in equilibrium."""
        sunk = np.asarray(self.case.model(self.case.soil, at).sinkage)
        return track_of(self.case.model).contact_geometry(sunk, self.case.soil, at)

    @property
    def columns(self) -> dict[str, Any]:
        """The rows with the model's pull, rear sinkage and angles of the belt (fig. 8, rad)."""
        belt = self.belt(self.at)
        force = self.case.model(self.case.soil, self.at)
        found = {**self.rows.columns, "pull_predicted_N": np.asarray(force.drawbar_pull)}
        found["rear_sinkage_predicted_m"] = np.asarray(belt.rear)
        if self.grousers is not None:
            robot = TrackedRobot(track_of(self.case.model), 2.0 * self.rows["load_N"][0] / 9.81)
            pulls = [
                0.5 * grouser_pull(robot, self.case.soil, float(s), self.grousers).mean()
                for s in self.rows["slip"]
            ]
            found["pull_with_grousers_N"] = np.asarray(pulls)
        names = {"front_entry": "entry", "front_exit": "leave", "rear_entry": "meet"}
        names["rear_exit"] = "exit"
        return found | {f"{k}_rad": np.asarray(getattr(belt, v)) for k, v in names.items()}

    def belt_line(self, slip: float) -> tuple[Floats, Floats]:
        """Distance backwards from the entry and depth (m) along the belt (fig. 7), (POINTS,)."""
        at = Operating(slip=np.asarray([slip]), load=self.rows["load_N"][:1])
        track = track_of(self.case.model)
        angle, contact = track.profile_contact(self.belt(at), at, POINTS)
        angle, along = np.asarray(angle)[:, 0], np.asarray(contact.surface_travel)[:, 0]
        step = np.diff(along)
        middle = 0.5 * (angle[1:] + angle[:-1])
        return np.append(0.0, np.cumsum(np.cos(middle) * step)), np.append(
            0.0, np.cumsum(np.sin(middle) * step)
        )

    def report(self, title: str = "Soil from the pulls of a tracked robot") -> Report:
        """The soil by the pulls, how far the model is off, and a row for each pull."""
        found = self.columns
        off = format_quantity(
            float(np.sqrt(np.mean((found["pull_predicted_N"] - found["drawbar_pull_N"]) ** 2))), "N"
        )
        said = f"The pull of a track is off by {off} in {len(self.rows)} pulls"
        fit = self.fit
        return Report(
            kind="track",
            verdict=f"{said}." if fit is None else fit.verdict,
            lines=[] if fit is None else [f"{said}."],
            figures=None if fit is None else ReportTable.of_parameters("Soil", fit.frame_columns()),
            tables=[ReportTable.of("Pulls", found)],
            pictures=[
                Picture("Pull, sinkage, belt and angles", self._draw, 2, 2, (9.0, 6.8), f"{said}.")
            ],
            remarks=() if fit is None else fit.warnings,
            title=title,
        )

    def _draw(self, axes: Any) -> None:
        found, slip = self.columns, self.rows["slip"]
        curve = Operating(slip=np.linspace(0.01, 0.95, 60), load=self.rows["load_N"][0])
        pull, sunk, line, angles = axes.flat
        smooth = np.asarray(self.case.model(self.case.soil, curve).drawbar_pull)
        std = found.get("drawbar_pull_N_std")
        pull.errorbar(slip, found["drawbar_pull_N"], std, fmt="o", color=BEFORE, label="log")
        pull.plot(curve.slip, smooth, color=AFTER, label="model")
        if self.grousers is not None:
            pull.plot(slip, found["pull_with_grousers_N"], "s", color=UNCHANGED, label="grousers")
        pull.set(xlabel="slip", ylabel="drawbar pull of a track, N")
        pull.legend()
        if "rear_sinkage_m" in found:
            sunk.plot(found["drawbar_pull_N"], 1e3 * found["rear_sinkage_m"], "o", color=BEFORE)
        order = np.argsort(found["pull_predicted_N"])
        sunk.plot(
            found["pull_predicted_N"][order], 1e3 * found["rear_sinkage_predicted_m"][order],
            color=AFTER,
        )  # fmt: skip
        sunk.set(xlabel="drawbar pull of a track, N", ylabel="sinkage of the rear wheel, mm")
        sunk.set_ylim(bottom=0.0)
        x, depth = self.belt_line(float(np.median(slip)))
        line.plot(x, -1e3 * depth, color=AFTER)
        line.axhline(0.0, color="#888888", lw=0.7)
        line.set(xlabel="along the belt, from its entry, m", ylabel="height, mm")
        for name in ("front_entry", "front_exit", "rear_entry", "rear_exit"):
            words = name.replace("_", " ")
            angles.plot(slip, np.rad2deg(found[f"{name}_rad"]), "o-", ms=3, label=words)
        angles.set(xlabel="slip", ylabel="angle, degrees")
        angles.legend(fontsize=8)


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
                rate = 1.0 / float(np.median(np.diff(rows["time_s"])))
                front, rear, angle = (low_pass(rows[k], rate, CUTOFF)[part] for k in LASERS)
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


def simulate_log(
    case: Case, slips: Floats, load: float, spacing: float, rng: np.random.Generator
) -> Mapping[str, list[Any]]:
    """Columns of a log of pulls at slips, 20 Hz: the payload tightens, then the robot pulls on.

    The tension has oscillations of 5 %, the lasers a millimetre of noise, and ruts of 4 mm.
    """
    at = Operating(slip=np.asarray(slips, float), load=load)
    force = case.model(case.soil, at)
    belt = track_of(case.model).contact_geometry(np.asarray(force.sinkage), case.soil, at)
    columns: dict[str, list[Any]] = {name: [] for name in (*LOG, *LASERS)}
    time = np.arange(0.0, 40.0, 0.05)
    tight = np.clip((time - 4.0) / 4.0, 0.0, 1.0)
    trims, rears = np.asarray(belt.trim), np.asarray(belt.rear)
    for k, (slip, pull) in enumerate(zip(slips, np.asarray(force.drawbar_pull), strict=True)):
        turned = 0.05 * np.maximum(time - 4.0, 0.0)
        noise = rng.standard_normal((3, time.size))
        swing = np.convolve(rng.standard_normal(time.size + 9), np.ones(10) / 10**0.5, "valid")
        ruts = 0.002 * np.sign(np.sin(2.0 * np.pi * turned / 0.05))
        rear = 0.2 + float(rears[k]) - spacing * np.sin(float(trims[k])) + ruts
        values = (
            [f"pull_{k + 1}"] * time.size,
            time,
            turned,
            (1.0 - float(slip)) * turned + 2e-4 * noise[0],
            2.0 * float(pull) * tight * (1.0 + 0.05 * swing) + 2.0 * noise[1],
            0.2 + 1e-3 * noise[2],
            rear + 1e-3 * noise[0],
            np.full(time.size, float(trims[k])),
        )
        for name, value in zip(columns, values, strict=True):
            columns[name] += list(value)
    return columns
