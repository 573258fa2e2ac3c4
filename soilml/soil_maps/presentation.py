"""A map as text, as JSON, as a picture, and as the files of its folder."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.quantities import QUANTITIES
from soilml.report.numbers import pretty, shown_column
from soilml.report.page import json_text
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.soil_maps.raster import geotiff, nav2_files
from soilml.soil_maps.workflow import SoilMap, parameter_moments

SIZE = (11.0, 8.5)  # Width and height of the four panels, inches
FILES = ("map.tif", "costmap.yaml", "costmap.pgm", "map.json", "map.png")


def report_of_map(found: SoilMap) -> Report:
    """The report of a map: where the soil changes, the soil of each patch, slopes."""
    drive, soils = found.drive, found.soils
    span = drive.station.max() - drive.station.min()
    changes = ", ".join(f"{s:.1f}" for s in found.changes)
    verdict = f"No sharp change of the soil was found along {span:.3g} m."
    if changes:
        verdict = f"The soil changes at {changes} m of the path, which is {span:.3g} m long."
    lines = [
        f"Within a patch it varies over about {found.field.length:.2g} m."
        if found.field.local > 0.05 and np.isfinite(found.field.length)
        else "Within a patch no variation is found."
    ]
    wheels = len(np.unique(drive.wheel))
    return Report(
        kind="map",
        verdict=verdict,
        lines=lines,
        tables=[_patches(found), *([_slopes(found)] if found.ability is not None else [])],
        pictures=[
            Picture(
                "Map", partial(_draw_map, found), 2, 2, SIZE, verdict,
                "White: the path. Crosses: changes of the soil.",
            )
        ],
        remarks=list(found.remarks()),
        title="Map of the soil",
        basis=f"{len(drive.station)} rows of {wheels} wheel{'s' * (wheels > 1)}, "
        f"{len(soils.station)} stretches; {int(found.known.sum())} cells of {found.grid.cell:g} m",
    )  # fmt: skip


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
    """A row for each slope: cells by the probability of climbing, mean slip and energy."""
    ability = found.ability
    assert ability is not None
    means = []
    for values in (ability.slip, ability.energy):
        known = np.isfinite(values)
        total = np.where(known, values, 0.0).sum(axis=0)
        means.append((total / np.where(known.any(axis=0), known.sum(axis=0), np.nan)).tolist())
    likely = [np.mean(ability.climbed > p, axis=0).tolist() for p in (0.5, 0.9)]
    return ReportTable(
        "Probability of climbing",
        [
            Column("slope", ability.slope.tolist(), "rad", digits=3),
            Column("cells above 50 %", likely[0], "share", digits=3),
            Column("above 90 %", likely[1], "share", digits=3),
            Column("mean slip", means[0], digits=2),
            Column("work", means[1], "J/m", digits=2),
        ],
    )


def map_json(found: SoilMap) -> dict[str, Any]:
    """Stretches, changes, the settings of the field by weight, and remarks."""
    soils, field = found.soils, found.field
    score, covariance = field.at(soils.place)
    mean, std = parameter_moments(soils, score, covariance)
    names = [QUANTITIES[c.path].column for c in soils.free]
    stretches: dict[str, Any] = {
        "station_m": soils.station,
        "x_m": soils.place[:, 0],
        "y_m": soils.place[:, 1],
    }
    stretches |= {"patch": soils.patch}
    for i, name in enumerate(names):
        stretches |= {name: mean[:, i], f"{name}_std": std[:, i]}
    return {
        "changes_m": found.changes.tolist(),
        "length_m": field.length,
        "local_share": field.local,
        "cell_m": found.grid.cell,
        "cells": int(found.known.sum()),
        "stretches": {name: np.asarray(values).tolist() for name, values in stretches.items()},
        "remarks": [remark.as_json() for remark in found.remarks()],
    }


def map_files(
    found: SoilMap, folder: Path, epsg: int | None, draw: Callable[[Path], None]
) -> dict[Path, Any]:
    """Content of each file of the folder of a map; `draw` makes the picture."""
    binary = {"map.tif": geotiff(found.grid, found.bands(), epsg)}
    if (occupied := found.occupied) is not None:
        binary |= nav2_files(found.grid, found.grid.spread(occupied, found.known))
    files: dict[str, Any] = {
        name: lambda path, content=content: path.write_bytes(content)
        for name, content in binary.items()
    }
    files |= {"map.json": json_text(map_json(found)), "map.png": draw}
    return {folder / name: content for name, content in files.items()}


def _draw_map(found: SoilMap, axes: Any) -> None:
    """Draw friction angle and its uncertainty, the probability of climbing and the slip needed.

    Without a rover, cohesion and its uncertainty are in the place of the last two.
    """
    mean, std = found.moments
    shown: list[tuple[str, Floats, tuple[float | None, float | None]]] = []
    for i in (1, 0)[: 1 if found.ability is not None else 2]:
        factor, name = shown_column(QUANTITIES[found.soils.free[i].path].column)
        shown.append((pretty(name), factor * mean[:, i], (None, None)))
        shown.append(("its standard deviation", factor * std[:, i], (None, None)))
    if found.ability is not None and (occupied := found.occupied) is not None:
        which = f"{np.rad2deg(found.ability.slope[-1]):g} deg"
        shown.append((f"probability of climbing {which}", 1.0 - occupied, (0.0, 1.0)))
        shown.append((f"slip needed for {which}", found.ability.slip[:, -1], (0.0, None)))
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
