"""Five examples of a model that lacks an effect: `make gap`."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set
from datagen.blind_sets.plans import Plan
from soilml.cli import main
from soilml.io.text_tables import csv_text
from soilml.report.aligned_text import format_table

#: The plans of the stories; the analysis does not receive the truth.
PLANS = {
    "slip-sinkage": Plan("B", "slip-sinkage/lyasko", 1.0, 0.01, 8, "dry-sand", 3, seed=2),
    "torque-sensor": Plan("S", "torque-gain", 1.0, 0.01, 8, "dry-sand", 3, seed=3),
    "nothing": Plan("N0", "", 0.0, 0.01, 8, "dry-sand", 3, seed=4),
    "unknown": Plan("C", "ripple", 1.0, 0.01, 8, "dry-sand", 3, seed=5),
}
#: Hidden in the story of the slope: a little bulldozing, in times the formula.
SHARE = 0.05


@dataclass(frozen=True)
class Story:
    """The result of a story: the hidden cause, the content of gap.json, and the true soil."""

    hidden: str
    report: dict[str, Any]
    soil: dict[str, float]


def run_gap(folder: Path, model: str, columns: dict[str, Any], *options: str) -> dict[str, Any]:
    """Write model and runs, run `soilml gap`, and read gap.json."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(model)
    (folder / "runs.csv").write_text(csv_text(columns))
    out = folder / "gap"
    given = ["gap", str(folder / "model.toml"), str(folder / "runs.csv"), "--out", str(out)]
    if main([*given, *options]) != 0:
        raise SystemExit(1)
    found: dict[str, Any] = json.loads((out / "gap.json").read_text())
    return found


def both(drawn: BlindSet) -> dict[str, Any]:
    """The runs and the region held out from them, in one table."""
    names = [name for name in drawn.columns if name in drawn.region]
    region = {n: drawn.region[n] for n in names}
    region["run"] = np.asarray([f"heavy_{run}" for run in region["run"]])
    return {n: [*drawn.columns[n], *region[n]] for n in names}


def hidden_story(name: str, folder: Path) -> Story:
    """A story whose data come from the generator of blind sets."""
    plan = PLANS[name]
    drawn = draw_blind_set(replace(plan))
    report = run_gap(folder / name, drawn.model, drawn.columns)
    return Story(plan.cause or "nothing", report, drawn.truth["soil"])


def slip_sinkage(folder: Path) -> Story:
    """Slip-sinkage by a law outside the catalogue, with soil that varies from run to run."""
    drawn = draw_blind_set(PLANS["slip-sinkage"])
    columns = both(drawn)
    heaviest = max(columns["load_N"])
    report = run_gap(
        folder / "slip-sinkage", drawn.model, columns, "--holdout", f"load_N={float(heaviest)!r}"
    )
    return Story("slip-sinkage, z = z0 (1 + s) / (1 - s / 2)", report, drawn.truth["soil"])


def reverse_run(folder: Path) -> tuple[Story, Story]:
    """A little bulldozing, which only a run in reverse distinguishes from a slope of the bed."""
    place = folder / "slope"
    place.mkdir(parents=True, exist_ok=True)
    (place / "rig.toml").write_text(TRUTH.format(share=SHARE))
    rng = np.random.default_rng(7)
    forward = [_simulated(place, f"run_{i}", 40.0 + 15.0 * i, 0.05, rng) for i in range(8)]
    first = run_gap(place, MODEL, _pooled(forward))
    suggested = [run for run in first["next_runs"] if run["kind"] == "reverse"]
    print(f"suggested: {suggested[0]['text'] if suggested else 'no reverse run'}\n")
    backward = [_simulated(place, f"back_{i}", 40.0 + 35.0 * i, -0.05, rng) for i in range(4)]
    second = run_gap(place, MODEL, _pooled([*forward, *backward]))
    soil = {"friction_angle": 0.5}
    return Story("bulldozing", first, soil), Story("bulldozing, with a reverse run", second, soil)


def _simulated(
    place: Path, run: str, load: float, speed: float, rng: np.random.Generator
) -> dict[str, Any]:
    """A run of eight slips from `soilml simulate`, with 1 % noise."""
    out = place / "simulated.csv"
    asked = ["--slip", "0.05:0.6:8", "--load", f"{load:g}", "--speed", f"{speed:g}", "--run", run]
    if main(["simulate", str(place / "rig.toml"), *asked, "--out", str(out)]) != 0:
        raise SystemExit(1)
    with out.open() as lines:
        rows = list(csv.DictReader(lines))
    out.unlink()
    columns: dict[str, Any] = {"run": [row["run"] for row in rows]}
    for name in ("slip", "load_N", "speed_m_s", "torque_Nm", "drawbar_pull_N", "sinkage_m"):
        columns[name] = np.asarray([float(row[name]) for row in rows])
    for name, floor in (("torque_Nm", 0.0), ("drawbar_pull_N", 0.2), ("sinkage_m", 0.0)):
        std = np.hypot(0.01 * columns[name], floor)
        columns[name] = columns[name] + std * rng.standard_normal(len(rows))
    return columns


def _pooled(runs: list[dict[str, Any]]) -> dict[str, Any]:
    return {name: [v for run in runs for v in run[name]] for name in runs[0]}


MODEL = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
cohesion = 900.0
friction_angle = 0.52
shear_modulus = 0.015
kc = 990.0
kphi = 1528000.0
n = 1.1
[soil.prior]
cohesion = [0.0, 4000.0]
friction_angle = [0.3, 0.8]
shear_modulus = [0.003, 0.04]
[noise]
torque_Nm = "1 %"
drawbar_pull_N = "1 % + 0.2"
sinkage_m = "1 %"
"""
TRUTH = (
    MODEL.replace("cohesion = 900.0", "cohesion = 1040.0")
    .replace("friction_angle = 0.52", "friction_angle = 0.50")
    .replace("shear_modulus = 0.015", "shear_modulus = 0.012")
    + '[[effect]]\nname = "bulldozing"\nshare = {share}\n'
)


def run_stories(folder: Path) -> list[Story]:
    """All stories, in the order of the table."""
    first, second = reverse_run(folder)
    rest = [hidden_story(name, folder) for name in ("torque-sensor", "nothing", "unknown")]
    return [slip_sinkage(folder), first, second, *rest]


def line(story: Story) -> tuple[str, ...]:
    """A story as a row of the table."""
    report = story.report
    causes = " | ".join("+".join(names) for names in report["cause_set"]) or "-"
    region = report["gap"].get("held_out_region")
    gap = "-" if region is None else f"{region['before']:.3g} -> {region['after']:.3g}"
    phi = "-"
    if "friction_angle" in report["soil_after"]:
        off = [
            abs(
                np.degrees(
                    report[f"soil_{when}"]["friction_angle"]["value"] - story.soil["friction_angle"]
                )
            )
            for when in ("before", "after")
        ]
        phi = f"{off[0]:.2f} -> {off[1]:.2f}"
    return story.hidden, report["status"], causes, gap, phi


def run() -> None:
    """Run all stories and print their results."""
    folder = Path("demo/gap")
    header = ("hidden", "status", "causes", "held-out region", "phi error, deg")
    print(format_table(header, [line(story) for story in run_stories(folder)], text_columns=3))
    print(f"\nreports: {folder}/*/gap/report.html", file=sys.stderr)


if __name__ == "__main__":
    run()
