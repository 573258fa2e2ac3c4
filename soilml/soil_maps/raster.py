"""Grids of a map, and the files in which other programs read them: GeoTIFF, Nav2's map_server."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.optional_imports import need

MOST_CELLS = 4_000_000
# Tags and keys of GeoTIFF (OGC 19-008r4, annex B), and two of GDAL
_SCALE, _TIEPOINT, _KEYS, _METADATA, _NODATA = 33550, 33922, 34735, 42112, 42113
_MODEL_TYPE, _RASTER_TYPE = 1024, 1025
_USER_DEFINED, _PIXEL_IS_AREA = 32767, 1
UNKNOWN = 255  # Pixel of a cell without an answer


@dataclass(frozen=True)
class MapGrid:
    """Square cells: rows from south to north, columns from west to east."""

    west: float  # m
    south: float  # m
    cell: float  # Side of a cell, m
    shape: tuple[int, int]  # Rows and columns

    @staticmethod
    def around(place: Floats, cell: float, margin: float) -> MapGrid:
        """The grid that contains places (n, 2) and a margin; its corners are multiples of a cell.

        Raises `InputError` for more cells than a map may have.
        """
        low = np.floor((place.min(axis=0) - margin) / cell)
        high = np.ceil((place.max(axis=0) + margin) / cell)
        columns, rows = high - low
        if not columns * rows <= MOST_CELLS:
            raise InputError(
                f"the map would have {columns * rows:.3g} cells of {cell:g} m; at most "
                f"{MOST_CELLS} are possible: give larger ones with --cell, or map parts of it"
            )
        return MapGrid(float(low[0] * cell), float(low[1] * cell), cell, (int(rows), int(columns)))

    @property
    def centres(self) -> Floats:
        """Middles of the cells, (cells, 2), m."""
        rows, columns = self.shape
        x = self.west + self.cell * (np.arange(columns) + 0.5)
        y = self.south + self.cell * (np.arange(rows) + 0.5)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def spread(self, values: Floats, known: Any) -> Floats:
        """Values (k,) of the cells that are known (cells,) as a grid; NaN elsewhere."""
        whole = np.full(self.shape[0] * self.shape[1], np.nan)
        whole[known] = values
        return whole.reshape(self.shape)


def geotiff(grid: MapGrid, bands: Mapping[str, Floats]) -> bytes:
    """A GeoTIFF with a band of 32-bit numbers for each grid of values, NaN where unknown.

    Coordinates are local, in m.

    Raises `MissingLibraryError` where tifffile is not installed.
    """
    need("tifffile", "map", "map")
    import tifffile

    keys = [(_MODEL_TYPE, _USER_DEFINED), (_RASTER_TYPE, _PIXEL_IS_AREA)]
    directory = [1, 1, 0, len(keys), *(n for key, value in keys for n in (key, 0, 1, value))]
    names = "".join(
        f'<Item name="DESCRIPTION" sample="{i}" role="description">{escape(name)}</Item>'
        for i, name in enumerate(bands)
    )
    north = grid.south + grid.cell * grid.shape[0]
    tags = [
        (_SCALE, "d", 3, (grid.cell, grid.cell, 0.0), True),
        (_TIEPOINT, "d", 6, (0.0, 0.0, 0.0, grid.west, north, 0.0), True),
        (_KEYS, "H", len(directory), directory, True),
        (_METADATA, "s", 0, f"<GDALMetadata>{names}</GDALMetadata>", True),
        (_NODATA, "s", 0, "nan", True),
    ]
    content = io.BytesIO()
    tifffile.imwrite(
        content,
        np.stack([values[::-1] for values in bands.values()]).astype(np.float32),
        photometric="minisblack",
        planarconfig="separate" if len(bands) > 1 else None,
        compression="zlib",
        metadata=None,
        software="soilml",
        extratags=tags,
    )
    return content.getvalue()


def nav2_files(grid: MapGrid, occupied: Floats) -> dict[str, bytes]:
    """costmap.yaml and costmap.pgm for nav2_map_server in its mode `raw`.

    A pixel is the occupancy itself, 0 to 100, and 255 where it is unknown (nav2_map_server, map_io:
    values above 100 are unknown).

    occupied: Probability by cell, NaN where unknown.
    """
    known = np.isfinite(occupied)
    pixel = np.full(grid.shape, UNKNOWN, np.uint8)
    pixel[known] = np.round(100.0 * np.clip(occupied[known], 0.0, 1.0)).astype(np.uint8)
    head = f"P5\n{grid.shape[1]} {grid.shape[0]}\n255\n".encode()
    yaml = (
        f"image: costmap.pgm\nmode: raw\nresolution: {grid.cell!r}\n"
        f"origin: [{grid.west!r}, {grid.south!r}, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    return {"costmap.yaml": yaml.encode(), "costmap.pgm": head + pixel[::-1].tobytes()}
