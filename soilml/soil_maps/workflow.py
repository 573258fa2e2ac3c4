"""From the rows of a drive to a map: patches, stretches, the field, and what a rover does on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.given_case import GivenCase, as_case
from soilml.errors import InputError
from soilml.identification.trained_estimator import estimators_for_case
from soilml.io.read_table import Rows
from soilml.onboard.estimator import Estimator
from soilml.quantities import NOT_IDENTIFIED_ABOVE, QUANTITIES
from soilml.remarks import Remark
from soilml.report.numbers import pretty, shown_column
from soilml.report.page import json_text
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.soil_maps.field import MapAbility, SoilField, map_ability
from soilml.soil_maps.local_soils import (
    FollowedRows,
    LocalSoils,
    MapDrive,
    follow,
    local_soils,
    read_map_drive,
    soil_values,
)
from soilml.soil_maps.raster import MapGrid, geotiff, nav2_files
from soilml.traction.vehicle import DrivenVehicle

SIZE = (11.0, 8.5)  # Width and height of the four panels, inches
FILES = ("map.tif", "costmap.yaml", "costmap.pgm", "map.json", "map.png")
MODEL = "any_wheel"  # Released file that is taken where none is named
CELL, REACH = 0.5, 2.0  # m
SIZES = 0.01, 1000.0  # Least and greatest of both, m: a print of a wheel, and a day's drive
SLOPES = np.deg2rad([0.0, 5.0, 10.0, 15.0])
NORMALS = 256  # Normal quantiles from which mean and spread of a parameter are computed
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, repr=False)
class SoilMap(Result):
    """The soil along a drive, and what a rover does on it.

    drive, followed, soils, field: Rows, what became of each, estimates of stretches, and the field
        through them.
    grid, known: Cells of the map, and which of them (cells,) are within reach of a reading.
    score, covariance: Normal scores of the soil in the k cells that are known, (k, p) and (k, p,
        p).
    ability: The rover straight up slopes.
    notes: Remarks on model file and trained file.
    """

    drive: MapDrive
    followed: FollowedRows
    soils: LocalSoils
    field: SoilField
    grid: MapGrid
    known: NDArray[np.bool_]
    score: Floats
    covariance: Floats
    ability: MapAbility
    notes: tuple[Remark, ...] = ()

    @cached_property
    def moments(self) -> tuple[Floats, Floats]:
        """Means and standard deviations of the parameters in these cells, SI units, (k, p)."""
        return parameter_moments(self.soils, self.score, self.covariance)

    @property
    def occupied(self) -> Floats:
        """Probability (k,) of not climbing the steepest slope asked for."""
        return np.asarray(1.0 - self.ability.climbed[:, -1])

    @property
    def changes(self) -> Floats:
        """Stations at which the soil changes, m."""
        station, patch = self.drive.station[self.followed.used], self.followed.patch
        ends = np.flatnonzero(np.diff(patch[self.followed.used])) + 1
        return 0.5 * (station[ends - 1] + station[ends])

    def bands(self) -> dict[str, Floats]:
        """Grids of the parameters with their standard deviations, and of the rover's slopes."""
        found, own = self._soil_columns(self.moments), self.ability
        for j, slope in enumerate(np.rad2deg(own.slope)):
            found[f"climbs_{slope:g}_deg"] = own.climbed[:, j]
            found[f"slip_{slope:g}_deg"] = own.slip[:, j]
            found[f"energy_{slope:g}_deg_J_m"] = own.energy[:, j]
        return {name: self.grid.spread(values, self.known) for name, values in found.items()}

    def _soil_columns(self, moments: tuple[Floats, Floats]) -> dict[str, Floats]:
        """Means and standard deviations (k,) by column."""
        found: dict[str, Floats] = {}
        mean, std = moments
        for i, coordinate in enumerate(self.soils.free):
            name = QUANTITIES[coordinate.path].column
            found |= {name: mean[:, i], f"{name}_std": std[:, i]}
        return found

    def report(self) -> Report:
        """Where the soil changes, the soil of each patch, and slopes."""
        drive = self.drive
        span = drive.station.max() - drive.station.min()
        changes = ", ".join(f"{s:.1f}" for s in self.changes)
        verdict = f"No sharp change of the soil was found along {span:.3g} m."
        if changes:
            verdict = f"The soil changes at {changes} m of the path, which is {span:.3g} m long."
        lines = [
            f"Within a patch it varies over about {self.field.length:.2g} m."
            if self.field.local > 0.05 and np.isfinite(self.field.length)
            else "Within a patch no variation is found."
        ]
        wheels = len(np.unique(drive.wheel))
        return Report(
            kind="map",
            verdict=verdict,
            lines=lines,
            tables=[_patches(self), _slopes(self)],
            pictures=[
                Picture(
                    "Map", partial(_draw_map, self), 2, 2, SIZE, verdict,
                    "White: the path. Crosses: changes of the soil.",
                )
            ],
            remarks=list(self.remarks()),
            title="Map of the soil",
            basis=f"{len(drive.station)} rows of {wheels} wheel{'s' * (wheels > 1)}, "
            f"{len(self.soils.station)} stretches; {int(self.known.sum())} cells of "
            f"{self.grid.cell:g} m",
        )  # fmt: skip

    def frame_columns(self) -> dict[str, Any]:
        """A row for each known cell: its middle in m, and the soil with standard deviations."""
        centres = self.grid.centres[self.known]
        columns: dict[str, Any] = {"cell": np.flatnonzero(self.known)}
        columns |= {"x_m": centres[:, 0], "y_m": centres[:, 1]}
        return columns | self._soil_columns(self.moments)

    def as_json(self) -> dict[str, Any]:
        """Stretches, changes, the settings of the field by weight, and remarks."""
        soils, field = self.soils, self.field
        stretches: dict[str, Any] = {"station_m": soils.station, "x_m": soils.place[:, 0]}
        stretches |= {"y_m": soils.place[:, 1], "patch": soils.patch}
        stretches |= self._soil_columns(parameter_moments(soils, *field.at(soils.place)))
        return {
            "changes_m": self.changes.tolist(),
            "length_m": field.length,
            "local_share": field.local,
            "cell_m": self.grid.cell,
            "cells": int(self.known.sum()),
            "stretches": {name: values.tolist() for name, values in stretches.items()},
            "remarks": [remark.as_json() for remark in self.remarks()],
        }

    def files(self, folder: Path, draw: Callable[[Path], None]) -> dict[Path, Any]:
        """Content of each file of the folder of a map; `draw` makes the picture."""
        binary = {"map.tif": geotiff(self.grid, self.bands())}
        binary |= nav2_files(self.grid, self.grid.spread(self.occupied, self.known))
        files: dict[str, Any] = {
            name: lambda path, content=content: path.write_bytes(content)
            for name, content in binary.items()
        }
        files |= {"map.json": json_text(self.as_json()), "map.png": draw}
        return {folder / name: content for name, content in files.items()}

    def remarks(self) -> Iterator[Remark]:
        """What to know of the map, by code."""
        yield from self.notes
        aside = len(self.followed.used) - int(self.followed.used.sum()) - self.followed.unusable
        if self.followed.unusable or aside:
            text = (
                f"not used: {self.followed.unusable} of {len(self.followed.used)} rows that are "
                f"out of range, stuck or repeated, {aside} that disagree with those beside them"
            )
            yield Remark("rows-not-used", text, severity="note")
        left = np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2)).min(axis=0)
        vague = [c.path for c, s in zip(self.soils.free, left, strict=True)
                 if s > NOT_IDENTIFIED_ABOVE]  # fmt: skip
        if vague:
            text = f"hardly determined in any cell: {', '.join(vague)}"
            yield Remark("not-determined", text, tuple(vague))


def soil_map(
    case: GivenCase,
    rows: Rows,
    estimator: Estimator | None = None,
    *,
    cell: float = CELL,
    reach: float = REACH,
    slopes: Floats | Sequence[float] = SLOPES,
    progress: Progress | None = None,
) -> SoilMap:
    """A map of the soil from the rows of a drive with positions.

    Parameters
    ----------
    case
        Gear, soil, noise and rover, or the path of a model file; priors for a file that needs them.
    rows
        A table as `read_map_drive` takes it.
    estimator
        A trained file with a set posterior; by default the released one for wheels of any size.
    cell, reach
        Side of a cell, and how far from a reading the soil is said to be known, m.
    slopes
        Rising slopes that the rover is to climb, rad.
    progress
        Function of the stage, of what is done, and of all of it.

    Returns
    -------
    SoilMap
        The field with its uncertainty, and what the rover does on it.

    Raises
    ------
    InputError
        For a gear or effect that the file is not for, several gears, no rover, a cell or reach
        beyond `SIZES` or without a known cell, and as `DrivenVehicle.check_slopes` does.
    TableError, FitError
        As `read_map_drive`, `follow` and `local_soils` do.
    """
    case, (low, high) = as_case(case), SIZES
    if not (low <= cell <= high and low <= reach <= high):
        raise InputError(
            f"cell is {cell:g} m and reach {reach:g} m; needed are {low:g} to {high:g} m"
        )
    if case.gears:
        raise InputError("the model file has several gears; a map is of the wheels of one: --gear")
    asked = np.asarray(slopes, dtype=np.float64)
    DrivenVehicle.of_rover(case).check_slopes(asked)
    own = Estimator.load(MODEL) if estimator is None else estimator
    if own.sets is None:
        raise InputError(f"{own.path} has no set posterior; train it with [set_posterior]")
    (own,), notes = estimators_for_case(
        [own], case.without_explanations(), "the model file", pooled=True
    )
    if case.explanations:
        text = (
            "the rover has the effects of each [[explanation]] as likely as it is; the soil is "
            "that of the trained file, without them"
        )
        notes.append(Remark("suspected", text))
    tell = progress or (lambda stage, done, total: None)
    drive = read_map_drive(rows, case)
    grid = MapGrid.around(drive.place, cell, reach)
    followed = follow(own, drive, lambda done, total: tell("following the soil", done, total))
    soils = local_soils(
        own, drive, followed, lambda done, total: tell("estimating stretches", done, total)
    )
    field = SoilField(soils)
    known = _within(grid, drive.place[followed.used], reach)
    if not known.any():
        raise InputError(
            f"no cell of {cell:g} m has its middle within {reach:g} m of a reading; give smaller "
            "ones with --cell, or a longer --reach"
        )
    mean, covariance = field.at(grid.centres[known])
    ability = map_ability(case, soils, mean, covariance, asked)
    return SoilMap(
        drive, followed, soils, field, grid, known, mean, covariance, ability, tuple(notes)
    )


def parameter_moments(
    soils: LocalSoils, score: Floats, covariance: Floats
) -> tuple[Floats, Floats]:
    """Means and standard deviations (n, p) in SI units, from normal scores."""
    from scipy.special import ndtri

    normal = ndtri((np.arange(NORMALS) + 0.5) / NORMALS)
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    values = soil_values(soils.free, score + std * normal[:, None, None])
    return values.mean(axis=0), values.std(axis=0)


def _within(grid: MapGrid, place: Floats, reach: float) -> NDArray[np.bool_]:
    """Cells whose middle is within reach of a place."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(place).query(grid.centres, distance_upper_bound=reach)
    return np.asarray(np.isfinite(distance))


def _patches(found: SoilMap) -> ReportTable:
    """The soil of each patch."""
    soils, ends, moments = found.soils, [], []
    for patch in np.unique(soils.patch):
        own = soils.patch == patch
        mean, std = parameter_moments(soils, *found.field.at(soils.place[own]))
        moments.append((mean.mean(axis=0), std.mean(axis=0)))
        ends.append(f"{soils.station[own].min():.1f} to {soils.station[own].max():.1f}")
    columns = [Column("patch, m", ends)]
    for i, coordinate in enumerate(soils.free):
        values, errors = ([float(own[k][i]) for own in moments] for k in (0, 1))
        name = coordinate.path.replace("_", " ")
        columns.append(Column(name, values, QUANTITIES[coordinate.path].unit, errors))
    return ReportTable("Soil of each patch", columns)


def _slopes(found: SoilMap) -> ReportTable:
    """A row for each slope: cells by the probability of climbing."""
    ability = found.ability
    likely = [np.mean(ability.climbed > p, axis=0).tolist() for p in (0.5, 0.9)]
    return ReportTable(
        "Probability of climbing",
        [
            Column("slope", ability.slope.tolist(), "rad", digits=3),
            Column("cells above 50 %", likely[0], "share", digits=3),
            Column("above 90 %", likely[1], "share", digits=3),
        ],
    )


def _draw_map(found: SoilMap, axes: Any) -> None:
    """Draw friction angle and its uncertainty, the probability of climbing and the slip needed."""
    (mean, std), ability = found.moments, found.ability
    factor, name = shown_column(QUANTITIES[found.soils.free[1].path].column)
    which = f"{np.rad2deg(ability.slope[-1]):g} deg"
    shown: list[tuple[str, Floats, tuple[float | None, float | None]]] = [
        (pretty(name), factor * mean[:, 1], (None, None)),
        ("its standard deviation", factor * std[:, 1], (None, None)),
        (f"probability of climbing {which}", ability.climbed[:, -1], (0.0, 1.0)),
        (f"slip needed for {which}", ability.slip[:, -1], (0.0, None)),
    ]
    grid = found.grid
    extent = (grid.west, grid.west + grid.cell * grid.shape[1],
              grid.south, grid.south + grid.cell * grid.shape[0])  # fmt: skip
    for panel, (title, values, ends) in zip(np.ravel(axes), shown, strict=True):
        image = panel.imshow(
            grid.spread(values, found.known), origin="lower", extent=extent, cmap="viridis",
            vmin=ends[0], vmax=ends[1], interpolation="nearest",
        )  # fmt: skip
        panel.figure.colorbar(image, ax=panel, shrink=0.8)
        order = np.argsort(found.drive.station)
        panel.scatter(*found.drive.place[order].T, s=0.5, color="#ffffff", lw=0)
        for change in found.changes:
            at = int(np.argmin(np.abs(found.drive.station - change)))
            panel.plot(*found.drive.place[at], "x", color="#d62728", ms=9, mew=2)
        panel.set_title(title)
        panel.set_xlabel("x, m")
        panel.set_ylabel("y, m")
