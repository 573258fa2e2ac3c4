"""What an import gives: rows, windows, what was left out, and remarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from soilml.config.measurement_noise import Noise
from soilml.io.table import Table
from soilml.log_import.wheel_rows import WheelSeries
from soilml.log_import.windows.steady import Stretch
from soilml.remarks import Remark
from soilml.results import Result

if TYPE_CHECKING:
    from soilml.report.report import Report


@dataclass(frozen=True, repr=False)
class ImportedLog(Result):
    """The result of an import.

    Attributes
    ----------
    table
        One row for each steady window of each wheel.
    bias
        Errors that all rows share, by column, as `[bias]` of a model file states them.
    series
        Each wheel in each run.
    remarks
        What looks odd, most important first.
    implausible
        Those of them that say that the map is wrong.
    radius
        Radius of the wheel, m; NaN where the map has none.
    """

    table: Table
    bias: dict[str, Noise]
    series: tuple[WheelSeries, ...]
    remarks: tuple[Remark, ...] = ()
    implausible: tuple[Remark, ...] = ()
    radius: float = float("nan")
    sources: tuple[str, ...] = ()
    map_name: str = "map"

    @property
    def runs(self) -> int:
        """How many runs there are, each wheel's counted."""
        return len(self.series) or len(set(self.table["run"]))

    def left_out(self) -> list[tuple[str, Stretch]]:
        """Runs and their stretches that are not in the table, with the reason."""
        return [(s.run, stretch) for s in self.series for stretch in s.stretches if stretch.why]

    def bias_toml(self) -> str:
        """The table [bias] of a model file."""
        if not self.bias:
            return (
                "# No constant of the map has a standard deviation: rows share no stated error.\n"
            )
        lines = [
            "# Errors that all rows share, from the uncertainties of the map. Add this table to",
            "# the model file, for `soilml identify`, `gap`, `pull` and `estimate --model`; zero",
            "# declares a sensor to be exact.",
            "[bias]",
        ]
        lines += [f"{key} = {_setting(noise)}" for key, noise in self.bias.items()]
        return "\n".join(lines) + "\n"

    def report(self) -> Report:
        """Rows over slip, runs over time, what was left out, and what looks odd."""
        from soilml.log_import.import_report import report_of_import

        return report_of_import(self)

    def frame_columns(self) -> dict[str, Any]:
        """The rows, SI units."""
        return {"row": np.arange(len(self.table)), **self.table.columns}

    def as_json(self) -> dict[str, Any]:
        """The content of the JSON file beside the report."""
        return {
            "map": self.map_name,
            "logs": list(self.sources),
            "rows": [
                {n: getattr(v, "item", lambda v=v: v)() for n, v in row.items()}
                for row in self.table
            ],
            "bias": {
                key: {"share": n.share, "constant": n.constant} for key, n in self.bias.items()
            },
            "runs": [
                {
                    "run": s.run,
                    "duration_s": float(s.time[-1] - s.time[0]),
                    "step_s": float(s.time[1] - s.time[0]),
                    "windows": [[w.start, w.stop] for w in s.stretches if not w.why],
                    "notes": [note.as_json() for note in s.notes],
                }
                for s in self.series
            ],
            "remarks": [remark.as_json() for remark in (*self.implausible, *self.remarks)],
        }


def _setting(noise: Noise) -> str:
    rounded = Noise(float(f"{noise.constant:.3g}"), float(f"{noise.share:.3g}"))
    value = rounded.as_setting()
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
