"""One wheel in all runs: its rows, what is left out of them, and what looks odd."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Noise
from soilml.log_import.channels.inputs import Inputs, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.channels.wheel_quantities import Conversion
from soilml.log_import.checks.columns import unit_remarks, with_shared_errors
from soilml.log_import.checks.row_checks import hints_of
from soilml.log_import.checks.sensors import dead_sensors, drop_clipped, untared_sensors
from soilml.log_import.checks.slip_checks import RowsToCheck
from soilml.log_import.mapping.log_map import LogMap, WheelMap
from soilml.log_import.readers import Progress
from soilml.log_import.rows import (
    WindowRow,
    add_stated_errors,
    by_name,
    irregular_windows,
    pool_errors,
    table_rows,
    unusable,
    window_row,
)
from soilml.log_import.stances import largest_acceleration, leg_angle, stances
from soilml.log_import.windows.steady import Stretch, steady_windows
from soilml.remarks import Remark


@dataclass
class WheelSeries:
    """One wheel in one run: quantities over time, or lines of a table; and its rows.

    run: Name of the run in the table.
    quantities: Samples (n,) by name, at the `time` (n,), s.
    stretches: Steady windows and what is left out, with the reason.
    """

    source: Run
    wheel: WheelMap
    inputs: Inputs | None = None
    dead: dict[str, str] = field(default_factory=dict)  # Sensors, with the reason
    quantities: dict[str, Floats] = field(default_factory=dict)
    rows: list[WindowRow] = field(default_factory=list)
    odd: dict[int, Remark] = field(default_factory=dict)  # Why rows are irregular, by place
    kept: list[WindowRow] = field(default_factory=list)  # Rows that can be used
    left_out: list[Stretch] = field(default_factory=list)

    @property
    def run(self) -> str:
        """Name of the run in the table."""
        return "_".join(filter(None, (self.source.name, self.wheel.name)))

    @property
    def time(self) -> Floats:
        """Grid (n,), s; empty for lines of a table."""
        return np.zeros(0) if self.inputs is None else self.inputs.time

    @property
    def stretches(self) -> list[Stretch]:
        """Steady windows and what is left out, in order of time."""
        windows = (row.window for row in self.kept)
        return sorted([*self.left_out, *windows], key=lambda s: s.start)

    @property
    def notes(self) -> tuple[Remark, ...]:
        """What was repaired, tared or doubted in this run."""
        tared = () if self.inputs is None else self.inputs.notes
        dead = (
            Remark("dead-sensor", f"[{role}] is dead: {why}", (role,))
            for role, why in self.dead.items()
        )
        return (*self.source.notes, *tared, *dead)


class WheelRows:
    """The rows of a wheel with one gear: of samples over time, or of a table of steady runs."""

    def __init__(
        self, log_map: LogMap, wheel: WheelMap, runs: Sequence[Run], progress: Progress
    ) -> None:
        wheel, self.computed = with_shared_errors(wheel, runs)
        self.log_map, self.wheel = log_map, wheel
        self.of = f" of wheel {wheel.name}" if wheel.name else ""
        self.conversion = Conversion(wheel, log_map.vehicle)
        self.runs = [WheelSeries(run, wheel) for run in runs]
        if log_map.runs.each_row:
            for one in self.runs:
                one.rows = table_rows(one.source, self.conversion)
        else:
            self._find_windows(progress)
        # the slip of stances may be what is asked for
        needed = ("slip", "load") if wheel.leg is None else ("load",)
        for one in self.runs:
            for k, row in enumerate(one.rows):
                if why := unusable(row, one.dead, needed) or one.odd.get(k):
                    one.left_out.append(replace(row.window, why=why))
                else:
                    one.kept.append(row)

    def _find_windows(self, progress: Progress) -> None:
        """Find the rows of runs over time."""
        inputs = [wheel_inputs(one.source, self.wheel) for one in self.runs]
        stage = f"finding steady windows{self.of}"
        for i, (one, own, dead) in enumerate(
            zip(self.runs, inputs, dead_sensors(inputs), strict=True)
        ):
            progress(stage, i, len(self.runs))
            one.inputs, one.dead = own, dead
            for role in dead:
                own.values[role] = np.full(own.time.size, np.nan)
            one.rows = self._windows(one, own)
            clipped = drop_clipped(own, one.rows)
            self.computed += [r.under(f"run {one.source.name}: ") for r in clipped]
            one.odd = irregular_windows(one.rows) if self.wheel.leg is None else {}
        progress(stage, len(self.runs), len(self.runs))
        pool_errors([row for one in self.runs for k, row in enumerate(one.rows)
                     if k not in one.odd])  # fmt: skip
        for one, own in zip(self.runs, inputs, strict=True):
            for row in one.rows:
                add_stated_errors(row, own, self.conversion)

    def _windows(self, one: WheelSeries, inputs: Inputs) -> list[WindowRow]:
        """The rows of a run over time; what is left out of it joins its stretches."""
        angle = leg_angle(inputs, self.wheel) if self.wheel.leg is not None else None
        quantities = self.conversion.of({**inputs.values, **inputs.constants})
        one.quantities = {n: np.broadcast_to(v, inputs.time.shape) for n, v in quantities.items()}
        settings, name = self.log_map.windows, one.source.name
        left_out = tuple(e for e in self.log_map.left_out if e.run in ("", name))
        parts: Iterator[tuple[Stretch, Stretch | None]]
        if angle is not None:
            parts = stances(inputs, angle, self.wheel, left_out)
        else:
            found = steady_windows(inputs.time, one.quantities, settings, left_out, inputs.motion)
            parts = ((stretch, None) for stretch in found)
        rows = []
        for stretch, within in parts:
            if stretch.why:
                one.left_out.append(stretch)
                continue
            row = window_row(stretch, inputs, quantities, one.source, self.conversion, within)
            if within is not None and "vibration" in inputs.values:
                largest, error = largest_acceleration(inputs, stretch, within)
                row.values["vibration"], row.std["vibration"] = largest, error
            rows.append(row)
        return rows

    def hints(self) -> list[Remark]:
        """What says that the map is wrong, by all windows, left out or not."""
        source = f"{self.log_map.source}: "
        units = unit_remarks(self.wheel, self.runs[0].source)
        wrong = [r.under(source) for r in units if r.code == "unit-of-another-kind"]
        return [*wrong, *self._checked([row for one in self.runs for row in one.rows], True)]

    def _checked(self, rows: Sequence[WindowRow], wrong: bool) -> Iterator[Remark]:
        """Hints at what is `wrong`, or merely odd, in rows."""
        values = by_name([row.values for row in rows])
        radius = self.wheel.radius.value if self.wheel.radius is not None else None
        weight = None
        if (vehicle := self.log_map.vehicle) is not None:
            weight = (vehicle.mass.value * vehicle.gravity / vehicle.wheels,) * 2
        for hint in hints_of(RowsToCheck(values, radius, self.wheel, weight)):
            if hint.wrong == wrong:
                yield Remark(hint.code, f"{self.log_map.source}{self.of}: {hint.text}", hint.about)

    def remarks(self) -> list[Remark]:
        """Dead and untared sensors; odd rows, and rows of a table that are left out."""
        kept = [row for one in self.runs for row in one.kept]
        found = [*self.computed, *self._checked(kept, False)]
        for one in self.runs:
            if one.inputs is None:
                file = one.source.recordings[0].file.name
                found += [s.why.under(f"row {s.start + 1:.0f} of {file} is left out: ")
                          for s in one.left_out if s.why]  # fmt: skip
            else:
                for role, why in one.dead.items():
                    text = f"run {one.source.name}: the sensor of [{role}]{self.of} is dead: {why}"
                    found.append(Remark("dead-sensor", text, (role, one.source.name)))
        if self.log_map.runs.each_row:
            return found
        found += untared_sensors(self.wheel, [one.inputs for one in self.runs if one.inputs])
        units = unit_remarks(self.wheel, self.runs[0].source)
        return found + [remark for remark in units if remark.code == "unit-differs"]

    def shared_errors(self) -> dict[str, Noise]:
        """The errors that the rows share by the constants of the map."""
        means = by_name([row.means for one in self.runs for row in one.kept])
        return self.conversion.shared_errors(means) if means else {}
