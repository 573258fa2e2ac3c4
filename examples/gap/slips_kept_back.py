"""How well models predict the measured slips that they have not seen, beside a Gaussian process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from gap_baselines import predicted, process_of_readings

from soilml import read_case, read_table
from soilml.config.case import Case
from soilml.gap import gap
from soilml.io.table import Table
from soilml.quantities import CHANNELS, column

#: Width of a level of slip: rows of one level are kept back together.
LEVEL = 0.1
#: The levels kept back: those between others, and the smallest and the largest.
PLACES = {"between": "slips between others", "ends": "smallest and largest slip"}
METHODS = ("soil alone", "returned model", "process")

Errors = dict[str, dict[str, float]]


def errors(folder: str) -> Errors:
    """RMS error of predicted readings over their declared noise, by place and method.

    Each level of slip is kept back in turn, and `gap` sees the others. *process* is a Gaussian
    process of the readings without any model. Nothing where too few readings are left to analyse.
    """
    case = read_case(f"{folder}/model.toml")
    rows = read_table(f"{folder}/runs.csv")
    level = np.round(rows["slip"] / LEVEL)
    found: dict[str, dict[str, list[np.ndarray]]] = {}
    for one in np.unique(level):
        kept = level == one
        seen, unseen = rows.rows(~kept), rows.rows(kept)
        report = gap(case, seen, seed=0)
        if not report.soil_before:
            continue
        place = "ends" if one in (level.min(), level.max()) else "between"
        soil = case.with_values({path: own.value for path, own in report.soil_before.items()})
        by_model = predicted(soil, unseen), predicted(report.model, unseen)
        by_process = process_of_readings(case, seen, unseen)
        for name, y in zip(METHODS, (*by_model, by_process), strict=True):
            found.setdefault(place, {}).setdefault(name, []).append(_off(case, y, unseen))
    return {
        place: {name: float(np.sqrt(np.mean(np.concatenate(own) ** 2))) for name, own in by.items()}
        for place, by in found.items()
    }


def _off(case: Case, y: Mapping[str, np.ndarray], rows: Table) -> np.ndarray:
    """Errors (n,) of all readings of some rows, over their declared noise."""
    off = []
    for name in CHANNELS:
        if column(name) in case.noise:
            reading = rows[column(name)]
            own = (y[name] - reading) / case.noise[column(name)].std(reading)
            off.append(own[np.isfinite(reading)])
    return np.concatenate(off)


def table(
    titles: Mapping[str, str], found: Mapping[str, Errors]
) -> tuple[list[str], list[list[str]]]:
    """Header and rows of a table, by the title of each set."""
    header = ["set", *(f"{place}: {name}" for place in PLACES for name in METHODS)]
    rows = []
    for name, own in found.items():
        cells = [own.get(place, {}).get(method) for place in PLACES for method in METHODS]
        if any(cells):
            rows.append([titles[name], *("-" if c is None else f"{c:.2f}" for c in cells)])
    return header, rows


def verdict(found: Sequence[Errors]) -> str:
    """How often the returned model is nearer to the readings than the others, in a list."""
    said = []
    for place, words in PLACES.items():
        own = [e[place] for e in found if place in e]
        if not own:
            continue
        for other in ("soil alone", "process"):
            ratio = np.asarray([e["returned model"] / e[other] for e in own])
            nearer = f"nearer to the readings in {int(np.sum(ratio < 1.0))} of {len(ratio)} sets"
            said.append(
                f"- {words}, over the {other}: {nearer}; errors {np.median(ratio):.2f} times as "
                f"large in the median, {ratio.max():.2f} times in the worst set"
            )
    return "\n".join(said)
