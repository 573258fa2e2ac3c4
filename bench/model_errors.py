"""Intervals of a model file and of `identify` where sensors and model are wrong.

Sets are simulated by the reference wheel of blind sets, which shares no code with the package.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, each, percent, rms, table
from scipy.stats import binom
from wrong_worlds import LAW_WORLDS, WORLDS, simulate, unlisted_worlds

from datagen.recipe import read_recipe
from soilml import Estimator, Table, identify
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS, MODEL_ERROR_INPUT
from soilml.quantities import SHEAR, column

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Soils of each line, rows of each set, and the seed of both; soils of a quick look.
SETS, ROWS, SEED, QUICK_SETS = 100, 16, 1, 4
#: The same for `identify`; half of the sets has the first number of rows, half the second.
IDENTIFIED_SETS, IDENTIFIED_ROWS, IDENTIFIED_SEED = 10, (16, 48), 8
#: Sensors that are exact, as files took them before they knew of errors.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
#: Answers, and what the file is told of errors. Where the sensors are taken as exact, a refused set
#: has the prior.
FIRST = "exact sensors, prior where refused"
ANSWERS: dict[str, dict[str, float]] = {
    FIRST: EXACT,
    "typical errors of sensors": {MODEL_ERROR_INPUT: 0.0},
    "`model_error` 1": {MODEL_ERROR_INPUT: 1.0},
    "inferred": {},
}
CHANNELS = {"torque": ("torque",), "all channels": ("torque", "sinkage", "drawbar_pull")}
#: Worlds of each part.
PARTS = {
    "Wrong sensors, wrong laws": (*WORLDS, *LAW_WORLDS),
    "Mechanisms of the blind sets that no error describes": unlisted_worlds(),
}
KNOWN = {world.name: world for worlds in PARTS.values() for world in worlds}
#: Nominal coverage.
COVERAGE = 0.9
#: Width of the central 90 % of a uniform prior, in its standard deviations.
PRIOR_WIDTH = 0.9 * np.sqrt(12.0)
ABOUT = (
    f"`wheel.onnx` on {SETS} soils a line, {ROWS} rows each at three loads, 2 % torque noise. Sets "
    "are simulated by the reference wheel of blind sets, which shares no code with `soilml`. First "
    "comes the file with exact sensors and the prior for refused sets. Answers with typical errors "
    "of the sensors follow: with an exact model (`model_error` 0), with typical errors of the "
    "model (`model_error` 1), and the file's own answer, which infers their size. Score: mean of "
    "the interval score over parameters and sets, in standard deviations of the prior; the prior "
    "has about 3.3."
)
ABOUT_IDENTIFY = (
    f"{IDENTIFIED_SETS} sets of each world, half of {IDENTIFIED_ROWS[0]} and half of "
    f"{IDENTIFIED_ROWS[1]} rows: the default answer of `identify` and the exact posterior. Widths "
    "are over that of the prior; the interval score is in standard deviations of the prior, lower "
    "is better. Laws of the lower worlds have the reference sizes of the blind sets."
)


def cases(sample: Sample) -> list[Row]:
    """Each world with each set of channels."""
    sets = QUICK_SETS if sample.quick else SETS
    return [
        {"part": part, "world": world.name, "channels": name, "sets": sets}
        | {"seed": sample.of((SEED,))[0]}
        for part, worlds in PARTS.items()
        for name in CHANNELS
        for world in (worlds[:2] if sample.quick else worlds)
    ]


def interval_scores(low: Floats, high: Floats, truth: Floats, std: Floats) -> dict[str, Floats]:
    r"""Coverage, width and score (sets, q) of intervals (l, u) for values x, in units of `std`.

    The score, which is least in expectation for the quantiles of the true distribution, is

    .. math:: (u - l) + \frac{2}{\alpha} \left[(l - x)_+ + (x - u)_+\right], \qquad
        \alpha = 0.1

    Source: Gneiting and Raftery, J. American Statistical Association 102, 2007, section 6.2.
    """
    outside = np.maximum(low - truth, 0.0) + np.maximum(truth - high, 0.0)
    return {
        "covered": ((truth >= low) & (truth <= high)).astype(float),
        "width": (high - low) / std,
        "score": (high - low + 2.0 / (1.0 - COVERAGE) * outside) / std,
    }


def one_world(case: Row) -> list[Row]:
    """Means over the sets of a world: refusals, coverage and score of each answer."""
    file, rows = Estimator.load(ROOT / "exported" / "wheel.onnx"), []
    drives = simulate(KNOWN[case["world"]], case["sets"], ROWS, case["seed"])
    names, truth = ("slip", "load", *CHANNELS[case["channels"]]), drives.truth
    for name, told in ANSWERS.items():
        estimator = file.on(**told)
        found = [
            estimator.run(**{key: drives.readings[key][index] for key in names})
            for index in range(case["sets"])
        ]
        if name == FIRST:
            found = [e if e.in_range else estimator.prior_estimate() for e in found]
        refused = np.mean([not e.in_range for e in found])
        low, high = (np.stack([getattr(e, key) for e in found]) for key in ("low", "high"))
        scores = interval_scores(low, high, truth, found[0].prior_std)
        means = {k: v.mean(axis=0) for k, v in scores.items()}
        means["score"] = means["score"].mean()
        error = (np.stack([e.mean for e in found]) - truth) / found[0].prior_std
        means["error"] = rms(error, axis=0)
        rows.append({"answer": name, "refused": refused} | means)
    return rows


def tables(rows: list[Row]) -> str:
    """A table for each part and set of channels, and the means over its worlds."""
    columns = {
        "refused": each("refused", ".0%"),
        "90 % of c, phi, K": percent("covered"),
        "RMSE": each("error"),
        "score": each("score"),
    }
    text = []
    for part in PARTS:
        for name in CHANNELS:
            own = [r for r in rows if r["part"] == part and r["channels"] == name]
            own += [row | {"world": "**mean**"} for row in own]
            if own:
                by = {"what is wrong": "world", "answer": "answer"}
                text.append(f"### {part}, {name}\n\n{table(own, by, columns)}")
    return "\n\n".join(text)


def identify_cases(sample: Sample) -> list[Row]:
    """Each world with each set of channels."""
    sets, worlds = (2, WORLDS[:2]) if sample.quick else (IDENTIFIED_SETS, (*WORLDS, *LAW_WORLDS))
    own = {"sets": sets, "seed": sample.of((IDENTIFIED_SEED,))[0]}
    return [own | {"world": w.name, "channels": c} for w in worlds for c in CHANNELS]


def identified(case: Row) -> list[Row]:
    """Each set: the averaged answer, and the exact posterior.

    `flagged` says whether the verdict is that the model does not fit.
    """
    model, found = read_recipe("wheel").case, []
    std = np.asarray([model.prior[name].std for name in SHEAR])
    for half, rows in enumerate(IDENTIFIED_ROWS):
        drives = simulate(KNOWN[case["world"]], case["sets"], rows, case["seed"])
        for index in range(half, case["sets"], len(IDENTIFIED_ROWS)):
            truth = drives.truth[index]
            names = ("slip", "load", *CHANNELS[case["channels"]])
            columns = {column(key): drives.readings[key][index] for key in names}
            for name in ("averaged", "posterior"):
                answer = identify(model, Table(columns), SHEAR, name)
                low, high = answer.interval
                own = interval_scores(low, high, truth, std)
                found.append(
                    {"answer": name}
                    | own
                    | {"score": own["score"].mean(), "relative": own["width"].mean() / PRIOR_WIDTH}
                    | {"flagged": not answer.fits}
                )
    return found


def identify_tables(rows: list[Row]) -> str:
    """A line for each world, channels and answer; the means; how often the misfit is told."""
    columns = {
        "90 % of c, phi, K": percent("covered"),
        "width": each("relative"),
        "score": each("score"),
        "said not to fit": percent("flagged"),
    }
    every = [*rows, *(row | {"world": "mean"} for row in rows)]
    by = {"what is wrong": "world", "channels": "channels", "answer": "answer"}
    count = len([r for r in rows if r["world"] == rows[0]["world"]]) // (2 * len(CHANNELS))
    low, high = (100.0 * binom.ppf(q, count, COVERAGE) / count for q in (0.025, 0.975))
    chance = (
        f"By chance alone, 95 of 100 cells of {count} sets lie between {low:.0f} and {high:.0f} "
        f"where the coverage is {100 * COVERAGE:.0f}."
    )
    return f"{chance}\n\n{table(every, by, columns)}"


MODEL_ERRORS = Bench(
    "model-errors", "Wrong sensors and wrong models", ABOUT, cases, one_world, tables
)
IDENTIFY_ERRORS = Bench(
    "identify-errors",
    "The averaged answer of identify",
    ABOUT_IDENTIFY,
    identify_cases,
    identified,
    identify_tables,
)
