"""Climbing ability of a simulated rover on a known soil, predicted from gentle slopes.

Run from the repository root: python examples/papers/climbing.py
"""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib
import numpy as np

from soilml.cli import main
from soilml.io.text_tables import csv_text
from soilml.systems.climbing import SimulatedRover, modulus_per_climb
from soilml.systems.climbing.climb import Climb, WheelRun
from soilml.systems.climbing.simulated_rover import ARTIFICIAL_SLIPS, SLOPES
from soilml.systems.climbing.tables import climb_tables

matplotlib.use("Agg")
import matplotlib.pyplot as plt

OUT = Path("demo/papers")
FILES = OUT / "climbing"
GENTLE = SLOPES[:2]  # 0 and 4 degrees, as in the paper's prediction

ROVER = """\
[rover]
mass = 12.0            # kg
radius = 0.055         # m
width = 0.064          # m
front_share = 0.52     # of the weight on the front wheels, on the flat
height_ratio = 0.4     # height of the centre of mass over the wheelbase

[soil]
cohesion = 0.0         # dry sand, known as in the paper
friction_angle = 0.6632  # 38 degrees, known as in the paper

[soil.prior]
shear_modulus = [0.001, 0.05]

[noise]
speed_m_s = "0.87 %"   # within 1.5 %
slope_rad = 0.005
normal_Pa = "5 %"
entry_angle_rad = 0.005
front_load = 0.05
"""


def run() -> None:
    """Simulate, write the files, run the command, and draw."""
    FILES.mkdir(parents=True, exist_ok=True)
    true = SimulatedRover()
    rng = np.random.default_rng(4)
    climbs = true.simulate_climbs(rng, GENTLE)
    artificial = true.simulate_artificial_slip(rng)
    write_files(climbs, artificial)
    print(
        f"A simulated rover of 12 kg on sand (c 0, phi 38 deg, k_x {1e3 * true.shear[2]:.1f} mm) "
        f"climbed slopes of 0 and 4 deg\nand measured stress at artificial "
        "slip on level ground. What can it climb?\n"
    )
    command = ["climb", str(FILES / "rover.toml"), str(FILES / "runs.csv")]
    command += ["--stress", str(FILES / "stress.csv"), "--out", str(FILES), "--slip-limit", "0.3"]
    if main(command) != 0:
        raise SystemExit(2)
    report = json.loads((FILES / "climb.json").read_text())
    steepest = np.rad2deg(true.steepest)
    print(f"\ntruth: k_x {1e3 * true.shear[2]:.2f} mm, steepest slope {steepest:.1f} deg")
    draw(true, climbs, artificial, report)
    print(f"figure: {OUT / 'climbing.png'}")


def write_files(climbs: list[Climb], artificial: tuple[list[WheelRun], list[WheelRun]]) -> None:
    """ROVER.toml, RUNS.csv and STRESS.csv, as logged by a rover."""
    (FILES / "rover.toml").write_text(ROVER)
    runs, stress = climb_tables(climbs, *artificial, rim_speed=0.00915)
    (FILES / "runs.csv").write_text(csv_text(runs))
    (FILES / "stress.csv").write_text(csv_text(stress))


def draw(
    true: SimulatedRover,
    climbs: list[Climb],
    artificial: tuple[list[WheelRun], list[WheelRun]],
    report: dict,
) -> None:
    """Stress by slip, k_x by slope, pull against slip, steepest slope."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    draw_stress(axes[0, 0], artificial[0])
    draw_modulus(axes[0, 1], true)
    draw_pull(axes[1, 0], true, climbs, report)
    draw_slope(axes[1, 1], true, climbs, report)
    figure.savefig(OUT / "climbing.png", dpi=110)


def draw_stress(axis, front: list[WheelRun]) -> None:
    """Stress on the front wheel at the artificial slips, which moves forward with slip."""
    colours = plt.cm.viridis(np.linspace(0.0, 0.85, len(ARTIFICIAL_SLIPS)))
    for number, slip in enumerate(ARTIFICIAL_SLIPS):
        runs = [run for run in front if abs(run.slip - slip) < 0.03]
        for i, run in enumerate(runs):
            stressed = run.profile.normal > 0
            axis.plot(
                np.rad2deg(run.profile.angle[stressed]),
                1e-3 * run.profile.normal[stressed],
                lw=0.8,
                color=colours[number],
                label=f"slip {slip:g}" if i == 0 else None,
            )
    axis.set(
        title="Stress on the front wheel at artificial slip, on the flat",
        xlabel="angle on the rim, from straight down, forward (deg)",
        ylabel="measured normal stress (kPa)",
    )
    axis.legend(frameon=False)


def draw_modulus(axis, true: SimulatedRover) -> None:
    """k_x of each slope, also with an error of the speed."""
    climbs = true.simulate_climbs(np.random.default_rng(8))
    cohesion, friction, modulus = true.shear
    slopes = np.rad2deg(SLOPES)
    for error, colour, mark in ((-0.015, "C0", "v"), (0.0, "k", "o"), (0.015, "C3", "^")):
        each = modulus_per_climb(
            true.rover, climbs, cohesion=cohesion, friction_angle=friction, speed_error=error
        )
        mean = 1e3 * np.asarray([np.mean(each[4 * i : 4 * i + 4]) for i in range(len(slopes))])
        label = "speed as measured" if error == 0.0 else f"speed {100 * error:+.1f} %"
        axis.plot(slopes, mean, marker=mark, color=colour, label=label)
    axis.axhline(1e3 * modulus, color="0.6", ls="--", label="truth")
    axis.set(
        title="Shear modulus estimated on each slope alone (4 runs each)",
        xlabel="slope (deg)",
        ylabel="k_x (mm)",
    )
    axis.set_ylim(0.0, None)
    axis.legend(frameon=False)


def draw_pull(axis, true: SimulatedRover, climbs: list[Climb], report: dict) -> None:
    """Predicted drawbar pull, the true one, and the climbs."""
    slip, pull = report["curve"]["slip"], report["curve"]["drawbar_pull_N"]
    axis.fill_between(
        slip, pull["p05"], pull["p95"], color="C0", alpha=0.25, label="predicted, 90 %"
    )
    axis.plot(slip, pull["median"], color="C0")
    axis.plot(true.curve[0], true.curve[1], "k--", label="truth")
    weight = true.rover.weight
    measured = [c.front.slip for c in climbs]
    axis.plot(
        measured, [weight * np.sin(c.slope) for c in climbs], "C2o", label="measured: 0 and 4 deg"
    )
    later = SLOPES[2:]
    needed = weight * np.sin(later)
    axis.plot(
        [true.slip_at(s) for s in later], needed, "C1s", label="8, 10 and 12 deg: not yet climbed"
    )
    axis.axhline(0.0, color="0.8", lw=0.8)
    axis.set(
        title="Drawbar pull of the rover, predicted before the steep slopes",
        xlabel="slip",
        ylabel="drawbar pull (N)",
        xlim=(0.0, 0.72),
        ylim=(-8.0, None),
    )
    axis.legend(frameon=False, loc="lower right")


def draw_slope(axis, true: SimulatedRover, climbs: list[Climb], report: dict) -> None:
    """Slope climbed at each slip, and the steepest."""
    slip, slope = report["curve"]["slip"], report["curve"]["slope_rad"]
    axis.fill_between(
        slip, np.rad2deg(slope["p05"]), np.rad2deg(slope["p95"]), color="C0", alpha=0.25
    )
    axis.plot(slip, np.rad2deg(slope["median"]), color="C0", label="predicted, 90 %")
    axis.plot(true.curve[0], np.rad2deg(true.curve[2]), "k--", label="truth")
    best = report["steepest_slope_rad"]
    axis.axhspan(np.rad2deg(best["p05"]), np.rad2deg(best["p95"]), color="C3", alpha=0.15)
    axis.axhline(np.rad2deg(best["median"]), color="C3", label="steepest slope, 90 %")
    axis.axhline(np.rad2deg(true.steepest), color="k", ls=":", label="true steepest slope")
    axis.set(
        title="Slope climbed at each slip",
        xlabel="slip",
        ylabel="slope (deg)",
        xlim=(0.0, 0.72),
        ylim=(-4.0, None),
    )
    axis.legend(frameon=False, loc="lower right")


if __name__ == "__main__":
    run()
