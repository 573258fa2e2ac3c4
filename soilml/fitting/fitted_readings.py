"""Readings beside what a model predicts for them: by channel against slip, residuals below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate, rates_at
from soilml.fitting.least_squares import Solution
from soilml.fitting.levels import load_levels
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.quantities import Z_90, column
from soilml.report.figure_style import AFTER, BEFORE, LOADS, PRIOR, UNCHANGED, take_axes
from soilml.report.numbers import channel_name, channel_unit, pretty, significant, with_unit
from soilml.report.report import Picture

MOST_LOADS = 4  # Levels of load that the upper panels show; the residuals are those of all
COMPRESSED = 12.0  # Residual in standard deviations from which on the axis is compressed


@dataclass(frozen=True)
class FittedReadings:
    """Readings (m,) of all channels with the predictions of a fitted model, SI units."""

    readings: Readings
    std: Floats  # standard deviations of their noise
    after: Floats  # predictions and their variances by the uncertainty of the fit
    after_variance: Floats
    before: Floats | None = None  # predictions without what was added to the model, if anything

    @staticmethod
    def of(
        case: Case,
        readings: Readings,
        free: Sequence[Coordinate],
        values: Floats,
        covariance: Floats,
    ) -> FittedReadings:
        """Readings and predictions at values (p,) of free parameters with a covariance (p, p).

        Noise that is not declared is that of the residuals.
        """
        x = np.asarray([c.prior.fraction(float(v)) for c, v in zip(free, values, strict=True)])
        found = linearise(case, free, x, readings)
        rates = rates_at(free, x)
        variance = np.einsum(
            "ij,jk,ik->i", found.jacobian, covariance / np.outer(rates, rates), found.jacobian
        )
        std = readings.noise_at(found.prediction)
        residual = readings.measured - found.prediction
        for k in range(len(readings.channels)):
            own = (readings.channel == k) & ~np.isfinite(std)
            std[own] = np.sqrt(np.nanmean(residual[own] ** 2)) if own.any() else 1.0
        return FittedReadings(readings, std, found.prediction, variance)

    @staticmethod
    def of_solutions(before: Solution, after: Solution, std: Floats) -> FittedReadings:
        """Readings with the predictions of two fits; `std` (m,) is their noise."""
        readings, jacobian = after.problem.readings, after.derivatives
        variance = np.einsum("ij,jk,ik->i", jacobian, after.covariance, jacobian)
        return FittedReadings(readings, std, after.prediction, variance, before.prediction)

    def picture(self, with_added: str = "") -> Picture:
        """Readings and predictions over slip, a column of panels for each channel.

        with_added: What `after` has that `before` has not, in words.
        """
        columns = [column(name) for name in self.readings.channels]
        count, names = len(columns), ", ".join(map(channel_name, columns))
        lines = "Lines: the model on the estimated soil, without errors that all rows share."
        if self.before is not None:
            lines = f"Dashed: the soil alone. Solid: {with_added or 'with what was added'}."
        alt = f"{names} over slip, measured and predicted, with residuals below"
        caption = (
            f"Points: readings, coloured by load. {lines} Bands: 90 % of a reading, by its noise "
            "and the uncertainty of the fit. Below: residuals of all readings in standard "
            "deviations; grey: 90 % of noise."
        )
        size = (4.6 * count, 5.4)
        return Picture("Measured and predicted", self.plot, 2, count, size, alt, caption)

    def plot(self, ax: Any = None) -> NDArray[Any]:
        """Draw the picture into axes (2, channels); see `take_axes`."""
        columns = [column(name) for name in self.readings.channels]
        axes = take_axes(ax, 2, len(columns), (4.6 * len(columns), 5.4))
        for k, name in enumerate(columns):
            factor, unit = channel_unit(name)
            top, low = axes[:, k]
            for colour, load, rows, line in self._shown(k):
                self._draw_load(top, factor, colour, load, rows, line)
            top.set_title(channel_name(name))
            top.set_ylabel(with_unit(channel_name(name), pretty(unit)))
            top.legend(ncols=2)
            self._draw_residuals(low, np.flatnonzero(self.readings.channel == k))
            low.set_xlabel("slip")
            low.set_ylabel("residual, sigma")
            low.set_xlim(top.get_xlim())
        return axes

    def _shown(self, channel: int) -> Iterator[tuple[str, float, NDArray[Any], NDArray[Any]]]:
        """Levels of load spread over all: colour, load (N), readings, those of the line by slip.

        The line is that of the run with most readings at this load: runs may differ in speed.
        """
        readings, load = self.readings, self.readings.load
        own = np.flatnonzero((readings.channel == channel) & np.isfinite(readings.measured))
        if not own.size:
            return
        levels, run = load_levels(load), readings.run[readings.row]
        present = np.unique(levels.index[own])
        most = min(MOST_LOADS, len(present))
        picked = present[np.linspace(0, len(present) - 1, most).round().astype(int)]
        colours = np.linspace(0, len(LOADS) - 1, most).round().astype(int)
        for level, colour in zip(picked, colours, strict=True):
            rows = own[levels.index[own] == level]
            runs, counts = np.unique(run[rows], return_counts=True)
            line = rows[run[rows] == runs[int(np.argmax(counts))]]
            line = line[np.argsort(readings.slip[line], kind="stable")]
            yield LOADS[colour], float(np.median(load[rows])), rows, line

    def _draw_load(
        self, axes: Any, factor: float, colour: str, load: float, *parts: NDArray[Any]
    ) -> None:
        (rows, line), measured = parts, self.readings.measured
        slip, after = self.readings.slip[line], factor * self.after[line]
        variance = np.maximum(self.after_variance[line], 0.0) + self.std[line] ** 2
        band = factor * Z_90 * np.sqrt(variance)
        if np.unique(slip).size > 1:
            axes.fill_between(slip, after - band, after + band, color=colour, alpha=0.15, lw=0)
            axes.plot(slip, after, color=colour, lw=1.7)
            if self.before is not None:
                axes.plot(slip, factor * self.before[line], "--", color=colour, lw=1.1)
        else:
            axes.errorbar(slip, after, band, fmt="_", color=colour, ms=14, lw=4, alpha=0.3)
        label = f"{significant(load, 3)} N"
        at = self.readings.slip[rows]
        axes.plot(at, factor * measured[rows], "o", color=colour, ms=4, label=label)

    def _draw_residuals(self, axes: Any, rows: NDArray[Any]) -> None:
        axes.axhspan(-Z_90, Z_90, color=PRIOR, alpha=0.6, lw=0)
        axes.axhline(0.0, color=UNCHANGED, lw=0.8)
        slip, measured, most = self.readings.slip[rows], self.readings.measured[rows], 3.5
        shown = [(self.after, AFTER, "o", "with it")]
        if self.before is not None:
            shown.insert(0, (self.before, BEFORE, "x", "soil alone"))
        for prediction, colour, marker, label in shown:
            residual = (measured - prediction[rows]) / self.std[rows]
            axes.plot(slip, residual, marker, color=colour, ms=3.6, label=label)
            finite = np.abs(residual[np.isfinite(residual)])
            most = max(most, 1.2 * float(finite.max()) if finite.size else 0.0)
        if self.before is not None:
            axes.legend(ncols=2)
        if most > COMPRESSED:
            axes.set_yscale("symlog", linthresh=3.0)
            ticks = [10.0 ** int(np.log10(most)), 3.0]
            both = [*(-t for t in ticks), 0.0, *ticks]
            axes.set_yticks(both, [f"{t:g}" for t in both])
            axes.minorticks_off()
        axes.set_ylim(-most, most)
