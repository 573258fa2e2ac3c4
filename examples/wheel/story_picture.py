"""The picture of `make demo`: four panels, from training to a board that was adapted."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from hidden_world import LaterSoils

from soilml import Estimator
from soilml.gap.pictures import draw_bars
from soilml.io.atomic_files import atomic_output
from soilml.quantities import Z_90, column
from soilml.report.figure_style import AFTER, BEFORE, report_style
from soilml.report.numbers import channel_name
from training.adaptation import AdaptReport

#: Methods of the first panel: name in compare.csv, label, marker, colour.
METHODS = (
    ("linear", "linear model", "v", "#9a9a9a"),
    ("mlp", "MLP", "^", "#c05aa0"),
    ("lssvm", "LS-SVM", "s", "#3c9a5f"),
    ("fused", "set posterior", "D", AFTER),
    ("analytic nonlinear", "least squares on the full model, 10 sets", "o", "black"),
)


def draw_story(folder: Path, report: AdaptReport, later: LaterSoils) -> None:
    """Draw the files of the folder, the adaptation and the further soils into story.png."""
    from matplotlib.figure import Figure

    with report_style():
        figure = Figure(figsize=(12.0, 9.0), layout="constrained")
        panels = list(figure.subplots(2, 2).flat)
        draw_methods(panels[0], folder / "compare.csv")
        draw_disagreement(panels[1], report)
        draw_gap(panels[2], folder / "adapted/gap/gap.json")
        draw_board(panels[3], folder, later)
        with atomic_output(folder / "story.png") as part:
            figure.savefig(part, format="png", dpi=90, metadata={"Software": "soilml"})


def draw_methods(axes: Any, path: Path) -> None:
    """Error over the prior's standard deviation by method, for sets of 1, 6 and 18 readings."""
    with path.open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    ticks = sorted({int(line["rows_in_set"]) for line in table})
    for name, label, marker, colour in METHODS:
        own = [line for line in table if line["method"] == name]
        shares = [(int(x["rows_in_set"]), float(x["rmse_share_of_prior"])) for x in own]
        errors = [np.sqrt(np.mean([x**2 for m, x in shares if m == n])) for n in ticks]
        axes.plot(ticks, errors, marker=marker, color=colour, label=label)
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{n}" for n in ticks])
    axes.minorticks_off()
    axes.set_ylim(0.0, 1.0)
    axes.set_xlabel("readings of slip, torque and load on one soil")
    axes.set_ylabel("error of c, φ, K over the prior's deviation")
    axes.set_title("1  Trained on the model: one reading tells little, a set much")
    axes.legend(fontsize=9, frameon=False, loc="lower left")


def draw_disagreement(axes: Any, report: AdaptReport) -> None:
    """Sinkage of a run that was kept back, predicted by both files from its first rows."""
    assert report.judgement is not None
    run = min(report.judgement.runs, key=lambda one: one.first_rows)
    key = column("sinkage")
    order = np.argsort(run.rows["slip"], kind="stable")
    slip = run.rows["slip"][order]
    after, band = (1e3 * x[order] for x in (run.after.mean[key], Z_90 * run.after.std[key]))
    axes.fill_between(slip, after - band, after + band, color=AFTER, alpha=0.2, lw=0)
    axes.plot(slip, 1e3 * run.rows[key][order], "o", color="black", label="measured")
    axes.plot(
        slip, 1e3 * run.before.mean[key][order], "--", color=BEFORE, lw=2, label="model as it was"
    )
    axes.plot(slip, after, color=AFTER, lw=2, label=f"with {' + '.join(report.effects)}, 90 %")
    axes.set_xlabel("slip")
    axes.set_ylabel("sinkage (mm)")
    load = float(np.median(run.rows["load_N"]))
    axes.set_title(f"2  A campaign disagrees: the run at {load:.0f} N, kept back")
    axes.legend(fontsize=9, frameon=False)


def draw_gap(axes: Any, path: Path) -> None:
    """Mean squared residuals by channel before and after, with the effect that was named."""
    found = json.loads(path.read_text(encoding="utf-8"))
    part = found["gap"]["train"]
    pairs = {"all readings": part} | {channel_name(k): v for k, v in part["channels"].items()}
    rows = {name: (one["before"], one["after"]) for name, one in pairs.items()}
    draw_bars(axes, rows, [value for pair in rows.values() for value in pair])
    effect = found["effects"][0]
    axes.set_title(
        f"3  The missing effect: {effect['name']}, probability {effect['probability']:.2f}"
    )


def draw_board(axes: Any, folder: Path, later: LaterSoils) -> None:
    """Cohesion of further soils by the old and by the adapted file."""
    true = 1e-3 * later.truth[:, 0]
    ends = np.asarray([true.min(), true.max()])
    axes.plot(ends, ends, color="black", lw=1.2, label="truth")
    parts = (("fused.onnx", BEFORE, "before"), ("adapted/adapted.onnx", AFTER, "adapted"))
    for file, colour, label in parts:
        estimator = Estimator.load(folder / file)
        mean, low, high = (1e-3 * x[:, 0] for x in later.estimates(estimator))
        error, held = later.figures(estimator)
        text = f"{label}: RMSE {error[0]:.0f} Pa, {100 * held[0]:.0f} % in the 90 % intervals"
        spread = [np.maximum(mean - low, 0.0), np.maximum(high - mean, 0.0)]
        axes.errorbar(true, mean, spread, fmt="o", color=colour, ms=4, lw=1, alpha=0.8, label=text)
    axes.set_xlabel("true cohesion (kPa)")
    axes.set_ylabel("cohesion by the board (kPa)")
    axes.set_ylim(0.0, 1.4 * ends[1])
    axes.set_title(f"4  Board, {true.size} further soils with the same effect")
    axes.legend(fontsize=9, frameon=False, loc="upper left")
