"""A robot on tracks: its pull on sand and clay, and what eight runs of pull tell of the soil.

Run from the repository root: python examples/papers/tracked_robot.py
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from soilml import Case, Model, Operating, soil
from soilml.config.measurement_noise import Noise
from soilml.numerics.prior import Prior
from soilml.papers.wang2018 import LEVEL, plateau, printed
from soilml.systems.tracked_robot.group_identification import (
    PARAMETERS,
    GroupFits,
    identify_groups,
    predicted_pull,
    simulate_group,
)
from soilml.systems.tracked_robot.pull_regression import (
    Regression,
    implied_points,
    linear_regression,
)
from soilml.systems.tracked_robot.robot import BEYOND_PEAK, GROUSERS, WANG2018, track_balance

OUT = Path("demo/papers/tracked_robot.png")
PRINTED = {("sand", False): 600, ("sand", True): 620, ("clay", False): 800, ("clay", True): 950}
COLOURS = {"sand": "#c08a2d", "clay": "#8c3b2e"}
#: Between the values at which the paper's groups stand still: 20 and 40 degrees, 0.05 m, 0.9 and
#: 1.2 kPa; the rest is ours.
PRIOR = {
    "n": Prior(0.5, 1.5),
    "friction_angle": Prior(np.deg2rad(20.0), np.deg2rad(40.0)),
    "kphi": Prior(5e5, 3e6, log=True),
    "shear_modulus": Prior(0.01, 0.05),
    "cohesion": Prior(900.0, 1200.0),
}
SYMBOLS = ("n", r"$\varphi$", "$k_p$", "K", "c")
UNITS = {"kphi": 1e-3, "cohesion": 1e-3}
TABLE = ("n", "friction_angle", "kp", "shear_modulus", "cohesion")


def main() -> None:
    """Print the story and draw its picture."""
    print("One of two tracks carries 638 N; plateaus are means over slips of 0.5 to 0.9.\n")
    print("soil  grousers  printed N  computed N  difference")
    for (ground, lugs), told in PRINTED.items():
        found = plateau(ground, grousers=lugs)
        name = "12 mm" if lugs else "none"
        print(f"{ground}  {name:8s}  {told:9d}  {found:10.0f}  {found / told - 1.0:+10.1%}")
    at = Operating(slip=0.2, load=WANG2018.load)
    hanging()
    print("\nWhat carries the load at slip 0.2")
    print("soil  front wheel  belt between  rear wheel  sinkage mm  tension kN")
    for ground in COLOURS:
        model = Model(WANG2018.track, BEYOND_PEAK[ground])
        stands = track_balance(model, soil(f"wang2018/{ground}"), at)
        sunk = 1e3 * float(model(soil(f"wang2018/{ground}"), at).sinkage)
        print(
            f"{ground}  {stands.front:11.0%}  {stands.middle:12.0%}  {stands.rear:10.0%}"
            f"  {sunk:10.1f}  {1e-3 * stands.tension:10.1f}"
        )
    case, groups = eight_groups()
    fresh = simulate_group(
        case, np.linspace(0.06, 0.84, 18), WANG2018.load, np.random.default_rng(18)
    )
    lines = told_by(case, groups, fresh)
    draw(case, groups, fresh, lines)
    print(f"\npicture: {OUT}")


def hanging() -> None:
    """How much of the four plateaus hangs on what the paper does not print."""
    track, bare, hump = WANG2018.track, (), BEYOND_PEAK["clay"]
    softer = (replace(hump[0], residual=0.6),)
    sooner = replace(GROUSERS, yielding=1.5)
    cases = {
        "as assumed": (track, bare, hump, GROUSERS),
        "no hump on clay": (track, bare, bare, GROUSERS),
        "hump on sand too": (track, hump, hump, GROUSERS),
        "K_r 0.6 on clay": (track, bare, softer, GROUSERS),
        "belt 0.10 m wide": (replace(track, width=0.1), bare, hump, GROUSERS),
        "slack belt, A_12 = 0.2": (replace(track, leaving=0.2), bare, hump, GROUSERS),
        "taut belt, A_12 = 0.05": (replace(track, leaving=0.05), bare, hump, GROUSERS),
        "springs back less, rho 0.25": (replace(track, rebound=0.25), bare, hump, GROUSERS),
        "grousers mobilise sooner": (track, bare, hump, sooner),
    }
    print("\nPlateaus in N                sand  grousers  clay  grousers")
    for name, (gear, on_sand, on_clay, lugs) in cases.items():
        robot = replace(WANG2018, track=gear)
        found = [
            robot.pull(soil(f"wang2018/{ground}"), LEVEL, (*some, *beyond)).mean()
            for ground, beyond in (("sand", on_sand), ("clay", on_clay))
            for some in ((), (lugs,))
        ]
        print(f"{name:29s}" + "{:4.0f}  {:8.0f}  {:4.0f}  {:8.0f}".format(*found))


def eight_groups() -> tuple[Case, GroupFits]:
    """Eight groups of pulls on the paper's sand with the gauge's noise, and what they say."""
    noise = {"drawbar_pull_N": Noise(constant=10.0, share=0.05)}
    case = Case(Model(WANG2018.track), soil("wang2018/sand"), PRIOR, noise)
    rng = np.random.default_rng(2018)
    slips = np.linspace(0.05, 0.85, 10)
    tables = [simulate_group(case, slips, WANG2018.load, rng) for _ in range(8)]
    groups = identify_groups(case, tables)
    print("\nEight groups of ten pulls each, 5 % and 10 N noise, one load, five unknowns")
    print("parameter       true     mean      std  prior std  left of prior, a group  all rows")
    for i, name in enumerate(PARAMETERS):
        scale = UNITS.get(name, 1.0)
        true = float(getattr(case.soil, name))
        print(
            f"{name:14s} {scale * true:7.4g}  {scale * groups.mean[i]:7.4g}  "
            f"{scale * groups.std[i]:7.2g}  {scale * PRIOR[name].std:9.2g}  "
            f"{groups.left[name]:22.0%}  {groups.joint.remaining_fraction[name]:8.0%}"
        )
    print(f"told hardly or not at all by a group: {', '.join(groups.open)}")
    return case, groups


def told_by(case: Case, groups: GroupFits, fresh: object) -> Regression:
    """Predictions of the groups' average on rows that no group has seen."""
    line = linear_regression(averaged(case, groups, fresh), fresh["drawbar_pull_N"])
    book = printed()
    n = implied_points(book["regression_r2"], book["regression_f"])
    print("\nMeasured against predicted, fresh rows      r2       F   slope  points")
    print(
        f"here                                    {line.r2:6.3f}  {line.f:6.1f}  {line.slope:6.2f}"
        f"  {line.points:6d}"
    )
    print(
        f"printed (points follow from r2 and F)   {book['regression_r2']:6.3f}  "
        f"{book['regression_f']:6.1f}  {book['regression_slope']:6.2f}  {n:6.1f}"
    )
    return line


def averaged(case: Case, groups: GroupFits, table: object) -> np.ndarray:
    """Pull that the average of the groups predicts, N."""
    return predicted_pull(case, replace(groups.joint, values=groups.mean), table)


def draw(case: Case, groups: GroupFits, fresh: object, line: Regression) -> None:
    """Four panels."""
    figure, axes = plt.subplots(2, 2, figsize=(11.5, 8.6), layout="constrained")
    draw_pull(axes[0, 0])
    draw_stress(axes[0, 1])
    draw_groups(axes[1, 0], case, groups)
    draw_regression(axes[1, 1], case, groups, fresh, line)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT, dpi=110)
    plt.close(figure)


def draw_pull(ax: plt.Axes) -> None:
    """Drawbar pull against slip, printed plateaus beside it."""
    slip = np.linspace(0.005, 0.95, 60)
    for (ground, lugs), told in PRINTED.items():
        effects = (*((GROUSERS,) if lugs else ()), *BEYOND_PEAK[ground])
        pull = WANG2018.pull(soil(f"wang2018/{ground}"), slip, effects)
        name = f"{ground}, 12 mm grousers" if lugs else f"{ground}, bare"
        style = "--" if lugs else "-"
        ax.plot(slip, pull, style, color=COLOURS[ground], label=name)
        ax.plot(1.0, told, "^" if lugs else "o", color=COLOURS[ground], ms=7, clip_on=False)
    ax.plot([], [], "ok", label="printed plateau, bare")
    ax.plot([], [], "^k", label="printed plateau, grousers")
    ax.set(xlabel="slip", ylabel="drawbar pull of the robot, N", xlim=(0, 1), ylim=(0, 1350))
    ax.set_title("Grousers matter on clay, hardly on sand")
    ax.legend(fontsize=8, ncols=2, loc="lower right")


def draw_stress(ax: plt.Axes) -> None:
    """Stresses along the belt."""
    ground, points = soil("wang2018/sand"), 1200
    at = Operating(slip=0.2, load=WANG2018.load)
    profile = Model(WANG2018.track).profile(ground, at, points)
    sunk = Model(WANG2018.track)(ground, at).sinkage
    belt = WANG2018.track.contact_geometry(sunk, ground, at)
    ends = (
        0.0,
        float(0.1 * belt.entry),
        float(0.1 * (belt.entry + belt.leave)),
        float(0.1 * (belt.entry + belt.leave) + belt.arc_radius * (belt.leave + belt.meet)),
    )
    total = ends[3] + 0.1 * float(belt.meet + belt.exit)
    way = np.linspace(0.0, total, points)
    ax.plot(way, 1e-3 * profile.normal, color="#26547c", label="normal")
    ax.plot(way, 1e-3 * profile.shear, color="#d1495b", label="shear")
    ax.axvspan(ends[0], ends[2], color="0.92")
    ax.axvspan(ends[3], total, color="0.92")
    top = 1e-3 * float(profile.normal.max())
    for x, text in ((ends[1] + 0.02, "unloading"), (ends[3] - 0.19, "reloading")):
        ax.annotate(text, (x, 0.9 * top), fontsize=9, va="top")
    ax.annotate("front\nwheel", (0.01, 1.08 * top), fontsize=8, va="top")
    ax.annotate("rear\nwheel", (ends[3] - 0.005, 1.08 * top), fontsize=8, va="top", ha="right")
    ax.set(xlabel="way along the belt from entry, m", ylabel="stress, kPa")
    ax.set(xlim=(0, total), ylim=(0, 1.15 * top))
    ax.set_title("Stress under a track on sand, slip 0.2")
    ax.legend(fontsize=8, loc="upper center")


def draw_groups(ax: plt.Axes, case: Case, groups: GroupFits) -> None:
    """Where in its prior each group puts each parameter: simulated and printed ones."""
    book = printed()
    for i, name in enumerate(PARAMETERS):
        prior = PRIOR[name]
        true = prior.fraction(float(getattr(case.soil, name)))
        ours = [prior.fraction(float(v)) for v in groups.values[:, i]]
        theirs = [v for k, v in book.items() if k[:6] == "table1" and k.endswith(f"_{TABLE[i]}")]
        factor = {"friction_angle": np.pi / 180.0, "kphi": 1e3, "cohesion": 1e3}.get(name, 1.0)
        shown = [prior.fraction(factor * v) for v in theirs]
        spread = np.linspace(-0.08, 0.08, 8)
        ax.plot(i - 0.17 + spread, ours, "o", color="#26547c", label="simulated" if not i else None)
        ax.plot(
            i + 0.17 + spread,
            shown,
            "D",
            mfc="none",
            color="#c08a2d",
            label="Table 1" if not i else None,
        )
        ax.hlines(
            true,
            i - 0.35,
            i + 0.02,
            color="#d1495b",
            lw=2,
            label="truth of the simulated" if not i else None,
        )
    ax.axhspan(0.0, 1.0, color="0.95", zorder=0)
    ax.set_xticks(range(5), SYMBOLS)
    ax.set(ylabel="place within the prior, 0 to 1", ylim=(-0.06, 1.24))
    ax.set_title("Five unknowns from pull at one load: most run to an end")
    ax.legend(fontsize=8, ncols=3, loc="upper center")


def draw_regression(
    ax: plt.Axes, case: Case, groups: GroupFits, fresh: object, line: Regression
) -> None:
    """Fresh measurements against what the average of the groups predicts."""
    x, y = averaged(case, groups, fresh), 1.0 * fresh["drawbar_pull_N"]
    ends = np.asarray([0.0, 1.1 * max(x.max(), y.max() / 2)])
    ax.plot(2 * x, 2 * y, "o", color="#26547c", label="fresh rows")
    ax.plot(2 * ends, 2 * ends, color="0.6", lw=1, label="agreement")
    fitted = line.intercept + line.slope * ends
    said = f"line: slope {line.slope:.2f} ± {line.slope_std:.2f}, r² {line.r2:.3f}, F {line.f:.0f}"
    ax.plot(2 * ends, 2 * fitted, color="#d1495b", label=said)
    ax.set(xlabel="predicted pull of the robot, N", ylabel="measured pull (simulated), N")
    ax.set(xlim=(0, 2 * ends[1]), ylim=(0, 2 * ends[1]))
    ax.set_title("A soil that is not identified still predicts pull")
    ax.legend(fontsize=8, loc="upper left")


if __name__ == "__main__":
    main()
