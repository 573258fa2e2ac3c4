"""The answer to a question of a design, and how it is found."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.wheeled_rover import GRAVITY
from soilml.remarks import Remark
from soilml.results import Result
from soilml.rover_design.performance import Outcomes, evaluate
from soilml.rover_design.search import (
    DESIGNS,
    QUANTILES,
    Designs,
    best_design,
    meets,
    pareto_front,
    quantile_of_worlds,
    searched,
    summary,
)
from soilml.rover_design.study import DesignStudy, read_study
from soilml.rover_design.uncertainty import (
    DRAWS,
    VarianceShare,
    possible_tests,
    variance_shares,
)
from soilml.rover_design.worlds import DrawnWorlds, draw_worlds, soil_of_rows

if TYPE_CHECKING:
    from soilml.report.report import Report

WORLDS = 1000  # Draws of soil and model error under which designs are compared
#: Function of a stage, of the designs done and of those in all.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, repr=False)
class DesignReport(Result):
    """Designs that were tried, the best of them, and what its margin depends on.

    study: The question.
    designs: All designs that were tried, under the same draws.
    best: Results of the best design by column name, under `DRAWS` draws of its own.
    best_dimensions: Its dimensions.
    met: Whether it meets the goal with the probability that the risk leaves.
    front: Numbers of the designs that no other one beats in margin and in what is to be least.
    by_soil: What the best design does on each of several soils, by column name; empty for one.
    shares: First-order shares of the variance of the best design's margin.
    tests: Tests that would reduce it.
    remarks: What limits the answer.
    """

    study: DesignStudy
    designs: Designs
    best: dict[str, float]
    best_dimensions: dict[str, float]
    met: bool
    front: NDArray[np.int64]
    by_soil: dict[str, dict[str, float]]
    shares: tuple[VarianceShare, ...]
    tests: tuple[VarianceShare, ...]
    remarks: tuple[Remark, ...]

    def report(self, title: str = "Wheels of a rover") -> Report:
        """The best design, those beside it, and what its margin depends on."""
        from soilml.rover_design.presentation import report_of_design

        return report_of_design(self, title)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each design that was tried: its dimensions and results, SI units."""
        return {"design": np.arange(self.designs.count), **self.designs.columns}

    def as_json(self) -> dict[str, Any]:
        """The content of the JSON file, in SI units."""
        goal = self.study.goal
        return {
            "goal": {
                "slope_rad": goal.slope,
                "margin_N": goal.margin,
                "risk": goal.risk,
                "slip_limit": goal.slip_limit,
                "torque_limit_Nm": goal.torque_limit,
                "energy_limit_J_per_m": goal.energy_limit,
                "least": goal.least,
            },
            "gravity_m_s2": self.study.gravity,
            "soils": list(self.study.soil.entries) or self.study.soil.files,
            "met": self.met,
            "best": {**self.best_dimensions, **self.best},
            "front": self.front.tolist(),
            "designs": {name: values.tolist() for name, values in self.designs.columns.items()},
            "by_soil": self.by_soil,
            "variance_shares": {one.inputs[0]: one.share for one in self.shares},
            "tests": [
                {"test": one.text, "inputs": list(one.inputs), "share": one.share,
                 "command": one.command}
                for one in self.tests
            ],
            "warnings": [remark.as_json() for remark in self.remarks],
        }  # fmt: skip


def design(
    study: DesignStudy | str | os.PathLike[str],
    *,
    designs: int = DESIGNS,
    draws: int = WORLDS,
    progress: Progress | None = None,
) -> DesignReport:
    """Which wheels climb a slope, with what margin and probability.

    All designs are compared under the same draws of the soil and of the model's error; the best one
    is evaluated again under others, so that its figures are not those of a lucky draw.

    Parameters
    ----------
    study
        The question: a file with [rover], [wheel], [soil] and [goal], or what `read_study` makes of
        it.
    designs
        Number of designs of the first round; later rounds search about the best one.
    draws
        Number of draws of the soil and of the model's error.
    progress
        Function of the stage, the designs done and all of them.

    Returns
    -------
    DesignReport
        The best design, all that were tried, and what its margin depends on.

    Raises
    ------
    InputError
        For a figure of the file that is missing or out of bounds, or a wheel that leaves the ground
        on the slope.
    FitError, TableError
        As `identify`, where the soil is that of measured rows.
    """
    if not isinstance(study, DesignStudy):
        study = read_study(study)

    rows = soil_of_rows(study.soil)
    worlds = draw_worlds(study.soil, draws, study.goal.slip_limit, rows=rows)
    found = searched(study, worlds, designs, progress and partial(progress, "designs"))
    best = best_design(study, found)
    dimensions = {name: float(values[best]) for name, values in found.dimensions.items()}
    own = draw_worlds(study.soil, DRAWS, study.goal.slip_limit, seed=1, rows=rows)
    outcome = evaluate(study, {k: np.asarray([v]) for k, v in dimensions.items()}, own)
    results = {name: float(values[0]) for name, values in summary(study, outcome).items()}
    enough = results["probability"] >= 1.0 - study.goal.risk
    remarks = (*worlds.remarks, *_remarks(study, found, dimensions, results, outcome, draws))
    return DesignReport(
        study=study,
        designs=found,
        best=results,
        best_dimensions=dimensions,
        met=enough,
        front=pareto_front(study, found),
        by_soil=_by_soil(own, outcome),
        shares=tuple(variance_shares(own, outcome)),
        tests=tuple(possible_tests(own, outcome)),
        remarks=remarks,
    )


def _by_soil(worlds: DrawnWorlds, outcome: Outcomes) -> dict[str, dict[str, float]]:
    """Probability of meeting the goal, and margin, on each soil; none of one soil alone."""
    found = {}
    for number, name in enumerate(worlds.kinds if len(worlds.kinds) > 1 else ()):
        own = worlds.kind == number
        found[name] = {"probability": float(outcome.met[0, own].mean())} | {
            f"margin_N{ending}": float(quantile_of_worlds(outcome.margin[:, own], q)[0])
            for ending, q in QUANTILES.items()
        }
    return found


def _remarks(
    study: DesignStudy,
    found: Designs,
    best: dict[str, float],
    results: dict[str, float],
    outcome: Outcomes,
    draws: int,
) -> Iterator[Remark]:
    """What limits the answer for the best design."""
    chance, needed = results["probability"], 1.0 - study.goal.risk
    compared = bool(meets(study, found).any())
    if compared != (chance >= needed):
        text = (
            f"the best design stands on the limit: it meets the goal with {chance:.1%} under draws "
            f"of its own, needed is {needed:.1%}; take one of the front beyond it"
        )
        yield Remark("on-the-limit", text)
    elif not compared:
        text = "no design within the limits meets the goal at this risk; shown is the likeliest"
        yield Remark("goal-not-met", text)
    for name in study.varied:
        ends = study.dimensions[name].values[0], study.dimensions[name].values[-1]
        if study.dimensions[name].searched and best[name] in ends and name != study.goal.least:
            text = f"{name} is at the end of its limits: {best[name]:g}"
            yield Remark("at-limit", text, (name,), "note")
    sunk = float(np.mean(~np.isfinite(outcome.margin)))
    if sunk >= 0.0005:
        yield Remark("not-carried", f"{sunk:.1%} of the soils do not carry a wheel at any slip")
    if best["lug_height"] > 0.0:
        text = (
            "lugs may pull more: of 10 mm on two measured wheels they added 10 N, where this model "
            "adds 1 to 2 N; drive a wheel with them and without"
        )
        yield Remark("lugs-understated", text, ("lug_height",), "note")
    if abs(study.gravity / GRAVITY["earth"] - 1.0) > 0.02:
        text = (
            f"gravity is {study.gravity:.3g} m/s^2: the soil is taken to have the parameters that "
            "it has on Earth, which tests under low gravity do not confirm"
        )
        yield Remark("other-gravity", text)
    if study.soil.rows is not None:
        text = "smooth errors are as before the rows, whose posterior gives soil and effects"
        yield Remark("errors-before-rows", text, severity="note")
    error = 100.0 * math.sqrt(max(results["probability"] * (1.0 - results["probability"]), 1e-4))
    text = (
        "probabilities and bands are over the soils and typical errors of the model, with a "
        f"standard error of {error / math.sqrt(draws):.1f} % in the comparison and of "
        f"{error / math.sqrt(DRAWS):.1f} % for the best design; straight up the slope, all wheels "
        "driven at one slip, loads of equally stiff wheels"
    )
    yield Remark("band-content", text, severity="note")
