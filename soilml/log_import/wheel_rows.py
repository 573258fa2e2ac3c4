"""One wheel in all runs: its rows, what is left out of them, and what looks odd."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.log_import.channels.inputs import Inputs, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.wheel_quantities import Conversion, SharedError
from soilml.log_import.checks.checked_rows import RowsToCheck
from soilml.log_import.checks.columns import differing_units, unit_hints, with_shared_errors
from soilml.log_import.checks.row_hints import hints_of
from soilml.log_import.checks.sensors import dead_sensors, drop_clipped, untared_sensors
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.readers import Progress
from soilml.log_import.rows import (
    WheelSeries,
    WindowRow,
    add_stated_errors,
    by_name,
    irregular_windows,
    pool_errors,
    table_rows,
    unusable,
    window_row,
)
from soilml.log_import.stance_rows import stance_rows, without_rolling
from soilml.log_import.windows.steady import Stretch, steady_windows
from soilml.remarks import Remark


class WheelRows:
    """The rows of a wheel with one gear: of samples over time, or of a table of steady runs.

    kept: By run, the rows that can be used.
    stretches: By run, what is left out, with the reason.
    """

    def __init__(
        self, log_map: LogMap, wheel: WheelMap, runs: Sequence[Run], progress: Progress
    ) -> None:
        wheel, self.computed = with_shared_errors(wheel, runs)
        self.log_map, self.wheel, self.runs = log_map, wheel, runs
        self.of = f" of wheel {wheel.name}" if wheel.name else ""
        self.conversion = Conversion(wheel, log_map.vehicle)
        self.inputs: list[Inputs] = []
        self.dead: list[dict[str, str]] = [{} for _ in runs]
        self.quantities: list[dict[str, Floats]] = []
        self.stretches: list[list[Stretch]] = [[] for _ in runs]
        self.rows: list[list[WindowRow]] = []
        odd: dict[tuple[int, int], Remark] = {}
        if log_map.runs.each_row:
            self.rows = [table_rows(run, self.conversion) for run in runs]
        else:
            self.inputs = [wheel_inputs(run, wheel) for run in runs]
            self.dead = dead_sensors(self.inputs)
            stage = f"finding steady windows{self.of}"
            for i in range(len(runs)):
                progress(stage, i, len(runs))
                self.rows.append(self._windows(i))
            progress(stage, len(runs), len(runs))
            odd = irregular_windows(self.rows)
            pool_errors([row for i, rows in enumerate(self.rows) for k, row in enumerate(rows)
                         if (i, k) not in odd])  # fmt: skip
            for inputs, rows in zip(self.inputs, self.rows, strict=True):
                for row in rows:
                    add_stated_errors(row, inputs, self.conversion)
        # the slip of stances may be what is asked for
        needed = ("slip", "load") if wheel.leg is None else ("load",)
        self.kept: list[list[WindowRow]] = []
        for i, rows in enumerate(self.rows):
            why = [unusable(row, self.dead[i], needed) or odd.get((i, k))
                   for k, row in enumerate(rows)]  # fmt: skip
            pairs = list(zip(rows, why, strict=True))
            self.stretches[i] += [replace(row.window, why=w) for row, w in pairs if w]
            self.kept.append([row for row, w in pairs if not w])

    def _windows(self, i: int) -> list[WindowRow]:
        """The rows of a run over time; what is left out of it joins its stretches."""
        run, inputs, windows = self.runs[i], self.inputs[i], self.log_map.windows
        for role in self.dead[i]:
            inputs.values[role] = np.full(inputs.time.size, np.nan)
        angle = without_rolling(inputs, self.wheel) if self.wheel.leg is not None else None
        quantities = self.conversion.of({**inputs.values, **inputs.constants})
        series = {n: np.broadcast_to(v, inputs.time.shape) for n, v in quantities.items()}
        self.quantities.append(series)
        left_out = tuple(e for e in self.log_map.left_out if e.run in ("", run.name))
        if angle is not None:
            out, rows = stance_rows(inputs, angle, series, self.conversion, windows, left_out)
            self.stretches[i] += out
            return rows
        stretches = steady_windows(inputs.time, series, windows, left_out)
        self.stretches[i] += [s for s in stretches if s.why]
        kept = (s for s in stretches if not s.why)
        rows = [window_row(s, inputs, quantities, run, self.conversion) for s in kept]
        self.computed += [r.under(f"run {run.name}: ") for r in drop_clipped(inputs, rows)]
        return rows

    def hints(self) -> list[Remark]:
        """What says that the map is wrong, by all windows, left out or not."""
        units = unit_hints(self.log_map, self.wheel, self.runs[0])
        return [*units, *self._checked(self.rows, True)]

    def _checked(self, rows: Sequence[Sequence[WindowRow]], wrong: bool) -> Iterator[Remark]:
        """Hints at what is `wrong`, or merely odd, in rows of runs."""
        values = by_name([row.values for own in rows for row in own])
        radius = self.wheel.radius.value if self.wheel.radius is not None else None
        weight = None
        if (vehicle := self.log_map.vehicle) is not None:
            weight = (vehicle.mass.value * vehicle.gravity / vehicle.wheels,) * 2
        for hint in hints_of(RowsToCheck(values, radius, self.wheel, weight)):
            if hint.wrong == wrong:
                yield Remark(hint.code, f"{self.log_map.source}{self.of}: {hint.text}", hint.about)

    def remarks(self) -> list[Remark]:
        """Dead and untared sensors; odd rows, and rows of a table that are left out."""
        found = [*self.computed, *self._checked(self.kept, False)]
        if self.log_map.runs.each_row:
            return found + [
                s.why.under(f"row {s.start + 1:.0f} of {run.recordings[0].file.name} is left out: ")
                for run, own in zip(self.runs, self.stretches, strict=True) for s in own if s.why
            ]  # fmt: skip
        for run, dead, inputs in zip(self.runs, self.dead, self.inputs, strict=True):
            if len(dead) > 2 and len(dead) >= len(inputs.values) - 1:
                text = f"run {run.name}: no sensor{self.of} says anything: an empty log?"
                found.append(Remark("empty-log", text, (run.name,)))
                continue
            for role, why in dead.items():
                text = f"run {run.name}: the sensor of [{role}]{self.of} is dead: {why}"
                found.append(Remark("dead-sensor", text, (role, run.name)))
        found += untared_sensors(self.wheel, self.inputs)
        return found + differing_units(self.wheel, self.runs[0])

    def shared_errors(self) -> tuple[dict[str, Noise], list[SharedError]]:
        """The errors that the rows share by the constants of the map."""
        means = by_name([row.means for own in self.kept for row in own])
        return self.conversion.shared_errors(means) if means else ({}, [])

    def series(self, i: int) -> WheelSeries:
        """Quantities and stretches of one run."""
        run = self.runs[i]
        stretches = [*self.stretches[i], *(row.window for row in self.kept[i])]
        dead = (
            Remark("dead-sensor", f"[{role}] is dead: {why}", (role,))
            for role, why in self.dead[i].items()
        )
        return WheelSeries(
            run=f"{run.name}_{self.wheel.name}" if self.wheel.name else run.name,
            drive=run.name,
            time=self.inputs[i].time,
            quantities=self.quantities[i],
            stretches=tuple(sorted(stretches, key=lambda s: s.start)),
            notes=(*run.notes, *self.inputs[i].notes, *dead),
        )
