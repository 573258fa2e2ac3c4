"""A robot on tracks: pull on sand and clay, evaluation of signals, and soil from eight groups.

Run from the repository root: python examples/papers/tracked_robot.py
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from soilml import Case, Model, Operating, SlipSinkage, soil
from soilml.config.measurement_noise import Noise
from soilml.numerics.prior import Prior
from soilml.papers.wang2018 import LEVEL, plateau, printed
from soilml.systems.tracked_robot import (
    BEYOND_PEAK,
    GROUSERS,
    WANG2018,
    GroupFits,
    Regression,
    identify_groups,
    linear_regression,
    low_pass,
    rear_sinkage,
    settling_from_moments,
    slip_from_displacements,
    stationary_mean,
    track_balance,
)
from soilml.systems.tracked_robot.group_identification import (
    PARAMETERS,
    implied_points,
    predicted,
    simulate_group,
)

OUT = Path("demo/papers/tracked_robot.png")
PRINTED = {("sand", False): 600, ("sand", True): 620, ("clay", False): 800, ("clay", True): 950}
COLOURS = {"sand": "#c08a2d", "clay": "#8c3b2e"}
#: Bounds at which the paper's groups end: 20 and 40 degrees, 0.05 m, 0.9 and 1.2 kPa; the others
#: are our choice.
PRIOR = {
    "n": Prior(0.5, 1.5),
    "friction_angle": Prior(np.deg2rad(20.0), np.deg2rad(40.0)),
    "kphi": Prior(5e5, 3e6, log=True),
    "shear_modulus": Prior(0.01, 0.05),
    "cohesion": Prior(900.0, 1200.0),
}
SYMBOLS = ("n", r"$\varphi$", "$k_p$", "K", "c")
UNITS = {"kphi": 1e-3, "cohesion": 1e-3}
GROUPS = 8
LABELS = ("simulated", "Table 1", "truth of the simulated")
TABLE = ("n", "friction_angle", "kp", "shear_modulus", "cohesion")


def main() -> None:
    """Print the results and draw the figure."""
    print("One of two tracks carries 638 N; plateaus are means over slips of 0.5 to 0.9.\n")
    print("soil  grousers  printed N  computed N  difference")
    for (ground, lugs), printed_pull in PRINTED.items():
        found = plateau(ground, grousers=lugs)
        name = "12 mm" if lugs else "none"
        print(
            f"{ground}  {name:8s}  {printed_pull:9d}  {found:10.0f}  "
            f"{found / printed_pull - 1.0:+10.1%}"
        )
    at = Operating(slip=0.2, load=WANG2018.load)
    sensitivity_to_assumptions()
    strength_of_clay()
    print("\nDistribution of the load at slip 0.2")
    print("soil  front wheel  belt between  rear wheel  sinkage mm  tension kN")
    for ground in COLOURS:
        model = Model(WANG2018.track, BEYOND_PEAK[ground])
        balance = track_balance(model, soil(f"wang2018/{ground}"), at)
        sunk = 1e3 * float(model(soil(f"wang2018/{ground}"), at).sinkage)
        print(
            f"{ground}  {balance.front:11.0%}  {balance.middle:12.0%}  {balance.rear:10.0%}"
            f"  {sunk:10.1f}  {1e-3 * balance.tension:10.1f}"
        )
    track = replace(WANG2018.track, leaving=0.2)
    balance = track_balance(Model(track), soil("wang2018/sand"), at)
    print(f"sand with a slack belt, A_12 = 0.2: front wheel {balance.front:.0%}, belt between "
          f"{balance.middle:.0%}, tension {1e-3 * balance.tension:.1f} kN")  # fmt: skip
    mean_of_the_groups()
    grouser_gains()
    trim_by_moments()
    sinkage_under_pull()
    pull_test()
    case, groups = eight_groups()
    fresh = simulate_group(
        case, np.linspace(0.06, 0.84, 18), WANG2018.load, np.random.default_rng(18)
    )
    lines = regression_of_fresh_rows(case, groups, fresh)
    draw(case, groups, fresh, lines)
    print(f"\nfigure: {OUT}")


def trim_by_moments() -> None:
    """Trim angle from the balance of moments: the tail sinks as the pull increases."""
    sand, slip = soil("wang2018/sand"), np.asarray([0.02, 0.1, 0.5])
    at, model = Operating(slip=slip, load=WANG2018.load), Model(WANG2018.track)
    settling = settling_from_moments(model, sand, at, behind=0.01, hitch=0.03)
    trimmed = Model(replace(WANG2018.track, settling=settling))
    pull, trim = trimmed(sand, at).drawbar_pull, track_balance(trimmed, sand, at).trim
    print("\nTrim on sand from moments: centre of mass 10 mm behind the middle, hitch 30 mm high")
    print("slip   pull N  trim deg")
    for row in zip(slip, 2.0 * pull, np.rad2deg(trim), strict=True):
        print("{:4.2f}  {:7.0f}  {:8.2f}".format(*row))


def pull_test() -> None:
    """Slip, sinkage and mean pull from the simulated signals of one pull test."""
    rate, rng = 100.0, np.random.default_rng(7)
    time = np.arange(0.0, 60.0, 1.0 / rate)
    ramp = np.clip((time - 8.0) / 10.0, 0.0, 1.0)  # pause, then 10 s until the pull is constant
    pull = 560.0 * ramp + 15.0 * rng.standard_normal(len(time))
    belt = 0.02 * time
    robot = (1.0 - 0.3 * ramp.mean()) * belt
    shaking = 0.005 * np.sin(2.0 * np.pi * 15.0 * time)
    trim, spacing, depth = 0.03, 0.7, 0.018
    front = 0.2 + 0.5 * spacing * np.sin(trim) + shaking
    rear = 0.2 + depth - 0.5 * spacing * np.sin(trim) - shaking
    sinkage = rear_sinkage(
        low_pass(rear, rate, 2.0), low_pass(front, rate, 2.0), np.full(len(time), trim), spacing
    )
    plateau_pull = stationary_mean(pull, above=50.0)
    slip = slip_from_displacements(belt, robot, span=1000)
    print(f"\nOne simulated pull test: 560 N, slip {0.3 * ramp.mean():.3f}, sinkage 18 mm")
    print(
        f"  mean pull {plateau_pull.mean:.1f} +- {plateau_pull.std_error:.1f} N from "
        f"{plateau_pull.start / rate:.0f} to {plateau_pull.stop / rate:.0f} s\n"
        f"  slip {slip.mean():.3f}, sinkage {1e3 * np.median(sinkage):.1f} mm after the low-pass"
    )


def sensitivity_to_assumptions() -> None:
    """The four plateaus under other assumptions on what the paper does not print."""
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


def strength_of_clay() -> None:
    """What friction and cohesion of clay would carry without a hump, and on which area."""
    clay, track, weight = soil("wang2018/clay"), WANG2018.track, 2.0 * WANG2018.load
    area = 2.0 * track.base * track.width
    friction, cohesion = weight * np.tan(clay.friction_angle), area * clay.cohesion
    lost, resistance, limit = 0.05, 60.0, 920.0  # N; 15 % above the printed 800 N
    allowed = ((limit + resistance) / (1.0 - lost) - friction) / clay.cohesion
    print("\nStrength of clay under both tracks: ", end="")
    print(f"friction {friction:.0f} N, cohesion {cohesion:.0f} N on {area:.3f} m2.")
    print(
        f"Without a hump, with {lost:.0%} of it not mobilised and {resistance:g} N of resistance,"
    )
    print(f"a pull below {limit:g} N needs an area below {allowed:.3f} m2.")


def mean_of_the_groups() -> None:
    """The printed mean of k_p, and that of the likely number in place of a misprint."""
    groups = [v for key, v in printed().items() if key.startswith("table1_") and key[-3:] == "_kp"]
    others = np.sum(groups) - 117.08
    means = [f"{(others + one) / 8.0:.1f} with {one:g}" for one in (117.08, 1170.8)]
    print(f"\nMean of k_p over the eight groups, kPa/m^n: {', '.join(means)}")


def grouser_gains() -> None:
    """What grousers add, and the largest pull, by where soil between them yields."""
    slips = np.linspace(0.01, 0.9, 90)
    print("\nGain by grousers, and largest pull on clay (N), by j_k, where soil yields")
    print("j_k / K   sand   clay   largest on clay")
    for ratio in (3.0, 2.0, 1.5, 1.0):
        found, largest = [], 0.0
        for ground in COLOURS:
            some = (replace(GROUSERS, yielding=ratio), *BEYOND_PEAK[ground])
            pull = WANG2018.pull(soil(f"wang2018/{ground}"), LEVEL, some).mean()
            found.append(pull - plateau(ground, grousers=False))
            largest = WANG2018.pull(soil(f"wang2018/{ground}"), slips, some).max()
        print("{:7.1f}   {:4.0f}   {:4.0f}   {:15.0f}".format(ratio, *found, largest))
    print("printed     20    150   below 1200, where the axis of its figure ends")
    area = (
        2.0 * 2.0 * GROUSERS.height * WANG2018.track.base
    )  # both sides of the blocks of two tracks
    sides = [area * float(soil(f"wang2018/{ground}").cohesion) for ground in COLOURS]
    print("sides    {:5.0f}  {:5.0f}   cohesion on both sides of the sheared block".format(*sides))
    residual = BEYOND_PEAK["clay"][0].residual
    hump = residual * (1.0 + (1.0 / (residual * (1.0 - np.exp(-1.0))) - 1.0) * np.e)
    print(f"hump             {hump:5.1f}   times the shear at small displacement, by eq. 6")


def sinkage_under_pull() -> None:
    """Sinkage of the rear wheel, as the paper measures it, against the pull of both tracks."""
    sand, slip = soil("wang2018/sand"), np.asarray([0.02, 0.1, 0.2, 0.5])
    at, track = Operating(slip=slip, load=WANG2018.load), WANG2018.track
    cases = {"trim constant": (track, ())}
    for hitch in (0.03, 0.1):
        settling = settling_from_moments(Model(track), sand, at, behind=0.0, hitch=hitch)
        name = f"moments, hitch at {hitch:g} m"
        cases[name] = (replace(track, settling=settling), ())
    cases["and slip-sinkage, n1 0.4"] = (cases[name][0], (SlipSinkage(n1=0.4),))
    print("\nPull of both tracks (N), and sinkage of the rear wheel (mm), on sand")
    print("slip                      " + "".join(f"{s:14.2f}" for s in slip))
    for name, (gear, some) in cases.items():
        force = Model(gear, some)(sand, at)
        trim = gear.contact_geometry(force.sinkage, sand, at).trim
        rear = 1e3 * (force.sinkage + gear.base * np.sin(trim))
        pairs = zip(2.0 * force.drawbar_pull, rear, strict=True)
        print(f"{name:26s}" + "".join(f"{pull:7.0f} {sunk:6.2f}" for pull, sunk in pairs))


def eight_groups() -> tuple[Case, GroupFits]:
    """Simulate eight groups of pulls on the paper's sand with measurement noise, and fit them."""
    noise = {"drawbar_pull_N": Noise(constant=10.0, share=0.05)}
    case = Case(Model(WANG2018.track), soil("wang2018/sand"), PRIOR, noise)
    rng = np.random.default_rng(2018)
    slips = np.linspace(0.05, 0.85, 10)
    tables = [simulate_group(case, slips, WANG2018.load, rng) for _ in range(GROUPS)]
    groups = identify_groups(case, tables)
    print("\nEight groups of ten pulls each, 5 % and 10 N noise, one load, five unknowns")
    print("parameter       true     mean      std  prior std  prior remaining, a group  all rows")
    for i, name in enumerate(PARAMETERS):
        scale = UNITS.get(name, 1.0)
        true = float(getattr(case.soil, name))
        print(
            f"{name:14s} {scale * true:7.4g}  {scale * groups.mean[i]:7.4g}  "
            f"{scale * groups.std[i]:7.2g}  {scale * PRIOR[name].std:9.2g}  "
            f"{groups.remaining_fraction[name]:22.0%}  "
            f"{groups.pooled.remaining_fraction[name]:8.0%}"
        )
    print(f"hardly identified or not identified: {', '.join(groups.unidentified)}")
    return case, groups


def regression_of_fresh_rows(case: Case, groups: GroupFits, fresh: object) -> Regression:
    """Regression of new measurements on the predictions of the groups' average."""
    line = linear_regression(mean_prediction(case, groups, fresh), fresh["drawbar_pull_N"])
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


def mean_prediction(case: Case, groups: GroupFits, table: object) -> np.ndarray:
    """Pull predicted by the average of the groups, N."""
    return predicted(case, replace(groups.pooled, values=groups.mean), table)


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
    """Drawbar pull against slip, with the printed plateaus."""
    slip = np.linspace(0.005, 0.95, 60)
    for (ground, lugs), printed_pull in PRINTED.items():
        effects = (*((GROUSERS,) if lugs else ()), *BEYOND_PEAK[ground])
        pull = WANG2018.pull(soil(f"wang2018/{ground}"), slip, effects)
        name = f"{ground}, 12 mm grousers" if lugs else f"{ground}, bare"
        style = "--" if lugs else "-"
        ax.plot(slip, pull, style, color=COLOURS[ground], label=name)
        ax.plot(1.0, printed_pull, "^" if lugs else "o", color=COLOURS[ground], ms=7, clip_on=False)
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
    bottom, front = float(0.1 * belt.entry), float(0.1 * (belt.entry + belt.leave))
    rear = front + float(belt.arc_radius * (belt.leave + belt.meet))
    total = rear + 0.1 * float(belt.meet + belt.exit)
    way = np.linspace(0.0, total, points)
    ax.plot(way, 1e-3 * profile.normal, color="#26547c", label="normal")
    ax.plot(way, 1e-3 * profile.shear, color="#d1495b", label="shear")
    ax.axvspan(0.0, front, color="0.92")
    ax.axvspan(rear, total, color="0.92")
    top = 1e-3 * float(profile.normal.max())
    for x, text in ((bottom + 0.02, "unloading"), (rear - 0.19, "reloading")):
        ax.annotate(text, (x, 0.9 * top), fontsize=9, va="top")
    ax.annotate("front\nwheel", (0.01, 1.08 * top), fontsize=8, va="top")
    ax.annotate("rear\nwheel", (rear - 0.005, 1.08 * top), fontsize=8, va="top", ha="right")
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
        spread = np.linspace(-0.08, 0.08, GROUPS)
        simulated, published, truth = LABELS if i == 0 else (None, None, None)
        ax.plot(i - 0.17 + spread, ours, "o", color="#26547c", label=simulated)
        ax.plot(i + 0.17 + spread, shown, "D", mfc="none", color="#c08a2d", label=published)
        ax.hlines(true, i - 0.35, i + 0.02, color="#d1495b", lw=2, label=truth)
    ax.axhspan(0.0, 1.0, color="0.95", zorder=0)
    ax.set_xticks(range(5), SYMBOLS)
    ax.set(ylabel="position within the prior, 0 to 1", ylim=(-0.06, 1.24))
    ax.set_title("Five unknowns from pull at one load: most end at a bound")
    ax.legend(fontsize=8, ncols=3, loc="upper center")


def draw_regression(
    ax: plt.Axes, case: Case, groups: GroupFits, fresh: object, line: Regression
) -> None:
    """Fresh measurements against what the average of the groups predicts."""
    x, y = mean_prediction(case, groups, fresh), 1.0 * fresh["drawbar_pull_N"]
    ends = np.asarray([0.0, 1.1 * max(x.max(), y.max() / 2)])
    ax.plot(2 * x, 2 * y, "o", color="#26547c", label="fresh rows")
    ax.plot(2 * ends, 2 * ends, color="0.6", lw=1, label="agreement")
    fitted = line.intercept + line.slope * ends
    said = f"line: slope {line.slope:.2f} ± {line.slope_std:.2f}, r² {line.r2:.3f}, F {line.f:.0f}"
    ax.plot(2 * ends, 2 * fitted, color="#d1495b", label=said)
    ax.set(xlabel="predicted pull of the robot, N", ylabel="measured pull (simulated), N")
    ax.set(xlim=(0, 2 * ends[1]), ylim=(0, 2 * ends[1]))
    ax.set_title("A soil that is not identified still predicts the pull")
    ax.legend(fontsize=8, loc="upper left")


if __name__ == "__main__":
    main()
