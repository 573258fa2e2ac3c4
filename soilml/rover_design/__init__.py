"""Wheels of a rover for a slope: designs compared over soils and typical errors of the model."""

from __future__ import annotations

import os

from soilml.rover_design.report import DesignReport, Progress, design_report
from soilml.rover_design.search import DESIGNS
from soilml.rover_design.study import DesignStudy, read_study

__all__ = ["DesignReport", "DesignStudy", "design", "design_report", "read_study"]


def design(
    study: DesignStudy | str | os.PathLike[str],
    *,
    designs: int = DESIGNS,
    draws: int = 1000,
    optimise: bool = True,
    progress: Progress | None = None,
) -> DesignReport:
    """Which wheels climb a slope, with what margin and probability.

    Parameters
    ----------
    study
        The question: a file with [rover], [wheel], [soil] and [goal], or what `read_study` makes of
        it.
    designs
        Number of designs of the sweep.
    draws
        Number of draws of the soil and of the model's error.
    optimise
        Whether to search between the designs of the sweep too.
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
    return design_report(study, designs=designs, draws=draws, optimise=optimise, progress=progress)
