"""Intervals of a model file where sensors and model are wrong: `python bench/run.py model-errors`.

`python bench/model_errors.py [FILE]` prints the tables of one file for the wheel of the recipe
`wheel`. Sets are simulated by the reference wheel of blind sets, which shares no code with the
package that the file was trained with.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from benchmarks_file import ROOT
from wrong_worlds import (
    LAW_WORLDS,
    NOISE_OF_LOAD,
    NOISE_OF_SLIP,
    WORLDS,
    SimulatedDrives,
    World,
    simulate,
    unlisted_worlds,
)

from datagen.generate import generate
from datagen.recipe import packaged_file, read_recipe
from soilml import Estimator
from soilml.onboard.estimate import Estimate
from soilml.onboard.set_contract import COMMON_ERROR_INPUTS, MODEL_ERROR_INPUT
from training.dataset import read_dataset
from training.export.model_file import export_model
from training.spec import read_spec
from training.train import train

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Soils of each line, rows of each set, and the seed of both.
SETS, ROWS, SEED = 100, 16, 1
#: Sensors that are exact, as files took them before they knew of errors, and a right model.
EXACT = dict.fromkeys(COMMON_ERROR_INPUTS, 0.0)
#: A model that is right, and one with its usual errors, beside those of the sensors.
RIGHT_MODEL, USUAL_MODEL = {MODEL_ERROR_INPUT: 0.0}, {MODEL_ERROR_INPUT: 1.0}
#: Specs of files that pool the readings of a set as Gaussians.
POOLED = ("linear", "mlp", "lssvm")
#: Rows that those of the worlds are trained on.
WORLD_ROWS = 60_000
#: Nominal coverage of the intervals.
COVERAGE = 0.9


@dataclass(frozen=True)
class Scores:
    """Answers to the sets of one line: intervals (sets, q) in widths of the prior."""

    covered: Floats
    width: Floats
    score: Floats
    error: Floats
    refused: Floats  # (sets,) bool

    @staticmethod
    def of(estimates: Sequence[Estimate], truth: Floats) -> Scores:
        r"""Scores of estimates.

        The score of an interval (l, u) for a value x, which is least in expectation for the
        quantiles of the true distribution, is

        .. math:: (u - l) + \frac{2}{\alpha} \left[(l - x)_+ + (x - u)_+\right], \qquad
            \alpha = 0.1

        Source: Gneiting and Raftery, J. American Statistical Association 102, 2007, section 6.2.
        """
        prior_std = estimates[0].prior_std
        low, high, mean = (
            np.stack([getattr(e, key) for e in estimates]) for key in ("low", "high", "mean")
        )
        outside = np.maximum(low - truth, 0.0) + np.maximum(truth - high, 0.0)
        return Scores(
            covered=((truth >= low) & (truth <= high)).astype(float),
            width=(high - low) / prior_std,
            score=(high - low + 2.0 / (1.0 - COVERAGE) * outside) / prior_std,
            error=(mean - truth) / prior_std,
            refused=np.asarray([not e.in_range for e in estimates]),
        )


def answers(
    estimator: Estimator, drives: SimulatedDrives, channels: Sequence[str], declared: World | None
) -> list[Estimate]:
    """Estimates of all sets; `declared` is the world whose noise of slip and load is known."""
    found = []
    for index in range(len(drives.truth)):
        rows = {key: drives.readings[key][index] for key in ("slip", "load", *channels)}
        if declared is not None:
            rows["slip_std"] = np.full(ROWS, declared.slip_std)
            rows["load_std"] = declared.load_std * rows["load"]
        found.append(estimator.run(**rows))
    return found


def with_prior(estimates: Sequence[Estimate], estimator: Estimator) -> list[Estimate]:
    """The estimates with the prior in the place of those that were refused."""
    return [e if e.in_range else estimator.prior_estimate() for e in estimates]


def lines_of(estimator: Estimator, world: World, channels: Sequence[str]) -> tuple[Scores, ...]:
    """Scores with the model right, with its usual errors, and of the file's own answer.

    Before them those with exact sensors and the prior for refused sets.
    """
    drives = simulate(world, SETS, ROWS, SEED)
    before = with_prior(answers(estimator.on(**EXACT), drives, channels, None), estimator)
    right, usual, own = (
        answers(given, drives, channels, world)
        for given in (estimator.on(**RIGHT_MODEL), estimator.on(**USUAL_MODEL), estimator)
    )
    return tuple(Scores.of(found, drives.truth) for found in (before, right, usual, own))


def coverage_table(estimator: Estimator, worlds: Sequence[World], channels: Sequence[str]) -> str:
    """A line for each world: coverage, refusals, interval score."""
    lines = [
        "| what is wrong | exact sensors: refused | 90 % of c, phi, K | score | typical errors "
        "of sensors: refused | 90 % | score | model_error 1: refused | 90 % | score | "
        "inferred: refused | 90 % | score |",
        "|---|" + "---:|---|---:|" * 4,
    ]
    totals = []
    for world in worlds:
        found = lines_of(estimator, world, channels)
        totals.append([(s.refused.mean(), s.covered.mean(axis=0), s.score.mean()) for s in found])
        lines.append(f"| {world.name} | {' | '.join(map(_cells, totals[-1]))} |")
    means = [
        tuple(np.mean(part, axis=0) for part in zip(*one, strict=True))
        for one in zip(*totals, strict=True)
    ]
    lines.append(f"| **mean** | {' | '.join(map(_cells, means))} |")
    return "\n".join(lines)


def _cells(found: tuple[Any, ...]) -> str:
    """Refused sets, coverage and score of one answer."""
    refused, covered, score = found
    held = " / ".join(f"{100 * share:.0f}" for share in covered)
    return f"{refused:.0%} | {held} | {score:.2f}"


def pooled_table(folder: Path, worlds: Sequence[World] | None = None) -> str:
    """Files without a set posterior, torque alone: coverage of single readings and of sets.

    The released files are trained on the model as if it were right, the others on [worlds].
    """
    lines = [
        "| file | what is wrong | one reading: 90 % of c, phi, K | set: refused | 90 % | width | "
        "score |",
        "|---|---|---|---:|---|---:|---:|",
    ]
    files = {f"`wheel_{spec}`": ROOT / "exported" / f"wheel_{spec}.onnx" for spec in POOLED}
    files |= {f"{spec}, worlds": file for spec, file in trained_on_worlds(folder).items()}
    for name, file in files.items():
        estimator, scores = Estimator.load(file), []
        for world in worlds or (*WORLDS, *unlisted_worlds()):
            drives = simulate(world, SETS, ROWS, SEED)
            one, truth = (
                estimator(**{k: drives.readings[k] for k in estimator.inputs}),
                drives.truth,
            )
            inside = (one.low <= truth[:, None]) & (truth[:, None] <= one.high)
            sets = Scores.of(answers(estimator, drives, CHANNELS["torque"], None), truth)
            own = (inside.mean(axis=(0, 1)), sets.refused.mean(), sets.covered.mean(axis=0))
            scores.append((*own, sets.width.mean(), sets.score.mean()))
            lines.append(_pooled_line(name, world.name, scores[-1]))
        mean = [np.mean(part, axis=0) for part in zip(*scores, strict=True)]
        lines.append(_pooled_line(name, "**mean**", mean))
    return "\n".join(lines)


def _pooled_line(name: str, world: str, of: Sequence[Any]) -> str:
    single, pooled = (" / ".join(f"{100 * share:.0f}" for share in held) for held in (of[0], of[2]))
    return f"| {name} | {world} | {single} | {of[1]:.0%} | {pooled} | {of[3]:.2f} | {of[4]:.2f} |"


def trained_on_worlds(folder: Path) -> dict[str, Path]:
    """Files of the specs that pool readings, trained on the recipe `wheel` with [worlds]."""
    recipe = folder / "worlds.toml"
    packaged = packaged_file("wheel", "datagen", "recipes").read_text(encoding="utf-8")
    recipe.write_text(f"{packaged}\n[worlds]\n", encoding="utf-8")
    data, files = folder / "worlds.parquet", {}
    generate(read_recipe(recipe).sized(WORLD_ROWS), data)
    for name in POOLED:
        spec, files[name] = read_spec(name), folder / f"worlds_{name}.onnx"
        export_model(
            train(spec, read_dataset(data, spec.features, spec.targets)), files[name], data
        )
    return files


def refused_table(estimator: Estimator, worlds: Sequence[World], channels: Sequence[str]) -> str:
    """Of the sets that are refused: coverage, error and width, beside those of the prior."""
    lines = [
        "| what is wrong | refused | 90 % of c, phi, K | rms error | width | rms error of prior |",
        "|---|---:|---|---|---|---|",
    ]
    for world in worlds:
        drives = simulate(world, SETS, ROWS, SEED)
        found = answers(estimator, drives, channels, None)
        refused = np.flatnonzero([not e.in_range for e in found])
        if not len(refused):
            lines.append(f"| {world.name} | 0 | | | | |")
            continue
        truth = drives.truth[refused]
        prior = Scores.of([estimator.prior_estimate()] * len(refused), truth)
        own = Scores.of([found[i] for i in refused], truth)
        covered = " / ".join(f"{100 * share:.0f}" for share in own.covered.mean(axis=0))
        cells = [_rms(own.error), _each(own.width.mean(axis=0) / prior.width.mean(axis=0))]
        cells.append(_rms(prior.error))
        lines.append(f"| {world.name} | {len(refused)} | {covered} | {' | '.join(cells)} |")
    return "\n".join(lines)


def price_table(estimator: Estimator) -> str:
    """Width of the intervals of sound sets with usual errors over that with exact sensors."""
    drives = simulate(WORLDS[0], SETS, ROWS, SEED)
    lines = ["| what may be wrong | torque: c, phi, K | all channels: c, phi, K |", "|---|---|---|"]
    usual = dict(estimator.sets.common_errors) if estimator.sets else {}
    sensors = {name: std for name, std in usual.items() if name != MODEL_ERROR_INPUT}
    cases = {f"{name} {std:g}": EXACT | {name: std} for name, std in sensors.items() if std}
    cases |= {"all errors of sensors": usual | RIGHT_MODEL}
    for size in (0.5, 1.0):
        cases[f"and model_error {size:g}"] = usual | {MODEL_ERROR_INPUT: size}
    cases["and errors of the model whose size is inferred"] = usual
    known = {c: _widths(estimator.on(**EXACT), drives, CHANNELS[c]) for c in CHANNELS}
    for name, errors in cases.items():
        given = estimator.on(**errors)
        cells = [_each(_widths(given, drives, CHANNELS[c]) / known[c]) for c in CHANNELS]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


#: Channels that are measured.
CHANNELS = {"torque": ("torque",), "all channels": ("torque", "sinkage", "drawbar_pull")}


def _widths(estimator: Estimator, drives: SimulatedDrives, channels: Sequence[str]) -> Floats:
    found = Scores.of(answers(estimator, drives, channels, None), drives.truth)
    return np.asarray(found.width.mean(axis=0))


def _rms(values: Floats) -> str:
    return _each(np.sqrt(np.mean(values**2, axis=0)))


def _each(values: Floats) -> str:
    return " / ".join(f"{value:.2f}" for value in values)


def tables(folder: Path, file: Path = ROOT / "exported" / "wheel.onnx") -> str:
    """All tables of a model file; the folder is for files that are trained."""
    estimator = Estimator.load(file)
    parts = [
        "### Width of sound sets with typical errors, over that with exact sensors",
        price_table(estimator),
    ]
    for label, channels in CHANNELS.items():
        parts += [
            f"### Coverage and interval score, {label}",
            coverage_table(estimator, (*WORLDS, *LAW_WORLDS), channels),
            f"### Refused sets of a model that is taken as right, {label}",
            refused_table(estimator.on(**RIGHT_MODEL), WORLDS[1:], channels),
        ]
    parts += [
        "### Noise of slip and load that is declared, torque",
        coverage_table(estimator, (*NOISE_OF_SLIP, *NOISE_OF_LOAD), CHANNELS["torque"]),
    ]
    parts += ["### Files without a set posterior", pooled_table(folder)]
    for label, channels in CHANNELS.items():
        parts += [
            f"### Mechanisms of the blind sets that no error describes, {label}",
            coverage_table(estimator, unlisted_worlds(), channels),
        ]
    return "\n\n".join(parts)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        print(tables(Path(temporary), *map(Path, sys.argv[1:2])))
