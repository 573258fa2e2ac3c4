"""Which row could be measured next, and the uncertainty expected to remain after each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.experiment_design.expected_variance import (
    OUTCOMES,
    expected_variance,
    predicted_readings,
)
from soilml.experiment_design.parameter_samples import ParameterSamples
from soilml.physics.operating_point import MOST_SLIP, Operating
from soilml.quantities import NOT_IDENTIFIED_ABOVE, column
from soilml.remarks import Remark
from soilml.report.numbers import parameter_name, share_left
from soilml.report.report import Picture, Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result

#: Default slips, and the number of default loads.
SLIPS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
LOADS = 5
#: Default loads run from this multiple of the smallest measured to this of the largest.
LIGHTER, HEAVIER = 0.5, 2.0
#: Most grid points that are labelled with their value in a map, and most ticks of an axis.
MOST_LABELS, TICKS = 80, 8
MOST_POINTS = 1000  # Most operating points of a grid


@dataclass(frozen=True)
class CandidateGrid:
    """Slips and loads (N) that can be driven, each once and ascending."""

    slips: tuple[float, ...]
    loads: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.slips or not self.loads:
            raise InputError("no slips or no loads; give at least one of each")
        for slip in self.slips:
            if not -MOST_SLIP < slip < MOST_SLIP:
                raise InputError(f"slip {slip:g} cannot be driven; needed is one inside -1..1")
        for load in self.loads:
            if not 0.0 < load < 1e7:
                raise InputError(f"load {load:g} N cannot be driven; needed is one inside 0..1e7")
        if len(self.slips) * len(self.loads) > MOST_POINTS:
            raise InputError(
                f"{len(self.slips)} slips times {len(self.loads)} loads are too many to try; at "
                f"most {MOST_POINTS} operating points are possible"
            )


def candidate_grid(
    slips: Sequence[float] | None,
    loads: Sequence[float] | None,
    measured_loads: Floats | Sequence[float] = (),
) -> CandidateGrid:
    """The grid of given slips and loads (N); by default `SLIPS`, and loads about those measured.

    Raises `InputError` where there are neither loads nor measured loads.
    """
    if loads is None:
        if len(measured_loads) == 0:
            raise InputError("no loads and no measured rows: give --load 30,60,120, or RUNS.csv")
        low, high = LIGHTER * float(np.min(measured_loads)), HEAVIER * float(np.max(measured_loads))
        loads = [float(f"{load:.2g}") for load in np.geomspace(low, high, LOADS)]
    return CandidateGrid(tuple(sorted({*(slips or SLIPS)})), tuple(sorted({*loads})))


def channel_sets(declared: Sequence[str]) -> list[tuple[str, ...]]:
    """The first channel with declared noise (torque), and it together with each other one."""
    if not declared:
        raise InputError("none of the measured channels has its noise declared in [noise]")
    first, *others = declared
    return [(first,), *[(first, other) for other in others]]


@dataclass(frozen=True)
class RatedRow:
    """A row to measure, and the fraction of each prior's width expected to remain after it, (p,).

    The fraction is the root of the expected variance over the prior's standard deviation.
    """

    slip: float
    load: float  # N
    channels: tuple[str, ...]
    remaining_fraction: Floats

    @property
    def overall(self) -> float:
        """Root mean square of the fractions: 1 where nothing is known."""
        return float(np.sqrt(np.mean(self.remaining_fraction**2)))


@dataclass(frozen=True, repr=False)
class Advice(Result):
    """Expected effect of each next measurement.

    Attributes
    ----------
    names
        The p parameters that are rated.
    current_fraction
        Fraction (p,) of each prior's width that remains before the next measurement.
    choices
        All candidates at which the wheel can be driven.
    excluded_points
        Number of grid points at which the wheel might not be carried.
    measured
        Operating points of earlier rows; None without.
    remarks
        What to know of the rows and of the ratings.
    """

    names: tuple[str, ...]
    current_fraction: Floats
    choices: tuple[RatedRow, ...]
    excluded_points: int
    measured: Operating | None = None
    remarks: tuple[Remark, ...] = ()

    def with_channels(self, channels: tuple[str, ...]) -> tuple[RatedRow, ...]:
        """The choices that measure these channels."""
        return tuple(c for c in self.choices if c.channels == channels)

    @property
    def channel_sets(self) -> tuple[tuple[str, ...], ...]:
        """Sets of channels among the choices, the smallest first."""
        return tuple(dict.fromkeys(c.channels for c in self.choices))

    def best(self, name: str | None = None, channels: tuple[str, ...] | None = None) -> RatedRow:
        """The choice with the least remaining fraction of one parameter, or of all (`overall`)."""
        choices = self.with_channels(channels or self.channel_sets[0])
        if name is None:
            return min(choices, key=lambda c: c.overall)
        i = list(self.names).index(name)
        return min(choices, key=lambda c: float(c.remaining_fraction[i]))

    def report(self) -> Report:
        """The best next rows, and maps of what each row would leave."""
        columns = []
        for name, values in self.best_columns().items():
            if name.endswith("_left"):
                symbol = parameter_name(name.removesuffix("_left")).split()[-1]
                columns.append(Column(f"{symbol} left", values.tolist(), "share", digits=2))
            elif name != "channels":
                unit = "N" if name == "load_N" else "1"
                columns.append(Column(name.removesuffix("_N"), list(values), unit, digits=3))
        verdict, count = f"Measure next: {_row_text(self, self.best())}.", len(self.names)
        vague = _vague(self)
        return Report(
            kind="plan",
            verdict=verdict,
            lines=[] if self.measured is None else list(_lines(self)),
            tables=[ReportTable("Rows to measure next", columns, "Width left of each prior.")],
            pictures=[
                Picture(
                    "Next rows", partial(_draw_maps, self), 1, count, (3.8 * count, 3.6), verdict,
                    "Expected width, in percent of the prior's, after a row at this slip and load. "
                    "Frame: the best row. Rings: measured rows. Blank: soils may not carry it.",
                )
            ],
            remarks=self.remarks,
            status=f"{len(vague)} of {count} open" if vague else "identified",
            title="Measurement to make next",
        )  # fmt: skip

    def frame_columns(self) -> dict[str, Any]:
        """A row for each candidate, the best first, with the fractions that it leaves."""
        ranked = sorted(self.choices, key=lambda c: c.overall)
        return self._columns([(str(i), c) for i, c in enumerate(ranked, 1)])

    def best_columns(self) -> dict[str, Any]:
        """A row for each best candidate: in all, and for each parameter."""
        rows = [("best in all", self.best())]
        rows += [
            (f"best in all with {own[1]}", self.best(None, own)) for own in self.channel_sets[1:]
        ]
        rows += [(f"best for {name}", self.best(name)) for name in self.names]
        return self._columns(rows)

    def _columns(self, rows: Sequence[tuple[str, RatedRow]]) -> dict[str, Any]:
        choices = [choice for _, choice in rows]
        columns: dict[str, Any] = {
            "row": [why.replace("_", " ") for why, _ in rows],
            "channels": [" + ".join(map(column, c.channels)) for c in choices],
            "slip": np.asarray([c.slip for c in choices]),
            "load_N": np.asarray([c.load for c in choices]),
        }
        for i, name in enumerate(self.names):
            columns[f"{name}_left"] = np.asarray([c.remaining_fraction[i] for c in choices])
        columns["all_left"] = np.asarray([c.overall for c in choices])
        return columns


def rate_rows(
    case: Case,
    samples: ParameterSamples,
    grid: CandidateGrid,
    *,
    covariates: Mapping[str, float] | None = None,
    outcome_count: int = OUTCOMES,
) -> Advice:
    """Rate every slip, load and set of channels by the variance expected to remain after a row.

    All ratings assume that the model is correct. A remaining fraction is an expectation over
    readings; the one realised differs.

    samples: What is known of the parameters: samples of the prior, or of a posterior.
    grid: Slips and loads (N) that can be driven.
    covariates: Further fields of `Operating`, the same for all candidates.
    outcome_count: Number of simulated readings of each candidate.

    Raises `FitError` where every point has a probability of 5 % or more that the wheel is not
    carried, and `InputError` where no noise is declared.

    References: Chaloner and Verdinelli, Statistical Science 10, 1995.
    """
    points = list(product(grid.slips, grid.loads))
    slip, load = np.asarray(points).T
    others = {key: np.full(len(points), value) for key, value in (covariates or {}).items()}
    ahead = predicted_readings(case, samples, Operating(slip=slip, load=load, **others))

    names = tuple(f.path for f in samples.free)
    drivable = np.flatnonzero(ahead.drivable)
    if not drivable.size:
        raise FitError(
            "at each of these slips and loads some soils that are still possible do not carry the "
            "wheel: try smaller loads, or narrow [soil.prior]"
        )
    outcomes, choices = expected_variance(samples, len(ahead.channels), outcome_count), []
    for channels in channel_sets(ahead.channels):
        for k in drivable:
            log = outcomes.log_likelihood(ahead, channels, int(k))
            left = np.sqrt(outcomes.remaining_variance(log))
            choices.append(RatedRow(*points[k], channels, left))
    return Advice(
        names=names,
        current_fraction=samples.remaining_fraction,
        choices=tuple(choices),
        excluded_points=len(points) - drivable.size,
    )


def _vague(advice: Advice) -> list[str]:
    """The parameters that the rows do not identify."""
    shares = zip(advice.names, advice.current_fraction, strict=True)
    return [name for name, share in shares if share > NOT_IDENTIFIED_ABOVE]


def _row_text(advice: Advice, choice: RatedRow) -> str:
    """A row, and the fraction of each prior expected to remain after it."""
    pairs = zip(advice.names, choice.remaining_fraction, strict=True)
    fractions = ", ".join(f"{name.replace('_', ' ')} {fraction:.0%}" for name, fraction in pairs)
    return f"slip {choice.slip:.3g} at {choice.load:.3g} N (expected to leave {fractions})"


def _lines(advice: Advice) -> Iterator[str]:
    """What is left of a parameter that is not identified, now and after the best row for it."""
    for name in _vague(advice):
        i = advice.names.index(name)
        now = float(advice.current_fraction[i])
        text = f"These rows leave {share_left(now)} the prior's width of {name.replace('_', ' ')}"
        text += f"; the best row for it leaves {advice.best(name).remaining_fraction[i]:.0%}"
        yield f"{text}."


def _draw_maps(advice: Advice, axes: Any) -> None:
    """Draw a map for each parameter into axes (1, parameters)."""
    from matplotlib.patches import Rectangle

    choices = advice.with_channels(advice.channel_sets[0])
    slips = sorted({c.slip for c in choices})
    loads = sorted({c.load for c in choices})
    for i, (name, panel) in enumerate(zip(advice.names, np.ravel(axes), strict=True)):
        fraction = np.full((len(loads), len(slips)), np.nan)
        for c in choices:
            cell = loads.index(c.load), slips.index(c.slip)
            fraction[cell] = c.remaining_fraction[i]
        panel.pcolormesh(fraction, cmap="viridis", vmin=0.0, vmax=1.0)
        for (row, col), share in np.ndenumerate(fraction):
            ink = "#010101" if share > 0.6 else "#fdfdfd"
            if np.isfinite(share) and fraction.size <= MOST_LABELS:
                text = f"{100 * share:.0f}"
                panel.text(col + 0.5, row + 0.5, text, ha="center", va="center", color=ink)
        best = advice.best(name)
        corner = slips.index(best.slip), loads.index(best.load)
        panel.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor="#d62728", linewidth=2.5))
        if (measured := advice.measured) is not None:
            slip = np.interp(np.atleast_1d(measured.slip), slips, np.arange(len(slips)) + 0.5)
            load = np.interp(np.atleast_1d(measured.load), loads, np.arange(len(loads)) + 0.5)
            panel.plot(slip, load, "o", color="#d62728", fillstyle="none", markersize=18, mew=2)
        across, up = (range(0, n, -(-n // TICKS)) for n in (len(slips), len(loads)))
        panel.set_xticks([k + 0.5 for k in across], [f"{slips[k]:.3g}" for k in across])
        panel.set_yticks([k + 0.5 for k in up], [f"{loads[k]:.3g}" for k in up])
        panel.grid(visible=False)
        panel.set_title(f"{name.replace('_', ' ')}: now {advice.current_fraction[i]:.0%}")
        panel.set_xlabel("slip of the next row")
        panel.set_ylabel("load of the next row, N")
