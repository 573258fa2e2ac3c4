"""Wheel-legs walking over soft ground: Comin and Saaj 2017, the terradynamics of section III-A.

    python examples/papers/wheel_legs.py

prints slip and sinkage by legs and feet, and draws demo/papers/wheel_legs.png.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

from soilml.systems.wheel_legs.gait_metrics import compare_feet, compare_legs, gait_metrics
from soilml.systems.wheel_legs.geometry import MAX_LEGS, wheel_leg
from soilml.systems.wheel_legs.resistive_force import GROUNDS, LinearGround
from soilml.systems.wheel_legs.sinkage_fit import fit_simulated_sinkage, simulate_sinkage
from soilml.systems.wheel_legs.walk import plate_stresses, walk

OUT = Path("demo/papers/wheel_legs.png")
SAND = LinearGround(stiffness=0.7e6)
FOOT_COLOURS = {"none": "#8a8f98", "LTF": "#d1495b", "SRF": "#2e86ab", "CIF": "#3a7d44"}
STATE_MARKS = {"loose": "v", "medium": "o", "dense": "^"}
SOIL_COLOURS = ("#d1495b", "#edae49", "#2e86ab", "#3a7d44")
SOIL, EDGE = "#efe6d5", "#b9a37e"
CM = 100.0
LEGS = range(1, MAX_LEGS + 1)


def figures(legs, feet, soils, fit):
    """Print the results."""
    print("Legs without feet on alpha_z = 0.7 N/cm3, a full turn:")
    print("  legs   slip rms   sinkage rms   sinkage max")
    for n, (slip, rms, most) in enumerate(
        zip(legs.rms_slip, legs.rms_sinkage, legs.max_sinkage, strict=True), 1
    ):
        print(f"  {n:4d} {slip:10.2f} {rms * CM:10.1f} cm {most * CM:10.1f} cm")
    print("\nFive legs, alpha_z from 0.4 to 1.0 N/cm3:")
    print("  foot    sinkage           slip              slope of sinkage      slope of slip")
    sinking, slipping = feet.sensitivity(feet.sinkage), feet.sensitivity(feet.slip)
    for i, foot in enumerate(feet.feet):
        z, s = feet.sinkage[i] * CM, feet.slip[i]
        print(
            f"  {foot:5s} {z[0]:5.1f} to {z[-1]:4.1f} cm  {s[0]:5.2f} to {s[-1]:5.2f}  "
            f"{sinking[0][i] * 1e8:6.1f} +- {sinking[1][i] * 1e8:3.1f} cm   "
            f"{slipping[0][i] * 1e6:6.2f} +- {slipping[1][i] * 1e6:4.2f}  per N/cm3"
        )
    ltf, srf = feet.feet.index("LTF"), feet.feet.index("SRF")
    margins = [slope[0][ltf] / slope[0][srf] - 1.0 for slope in (sinking, slipping)]
    print("  the LTF is more sensitive than the SRF by {:.0%} and {:.0%}".format(*margins))
    print("\nSoil from midstance sinkage, four soils in three states:")
    print("                     fitted   printed")
    print(f"  s_sigma, N/cm    {fit.s_sigma / CM:8.2f}      3.39")
    print(f"  R2               {fit.stiffness_r2:8.2f}      0.77")
    print(f"  s_I, rad         {fit.s_i:8.2f}      0.76")
    print(f"  s_Z, rad/cm      {fit.s_z / CM:8.3f}    -0.07")
    print(f"  R2               {fit.friction_r2:8.2f}      0.98")
    more = fit_simulated_sinkage(simulate_sinkage(offset=True))
    print(
        f"  error on soils left out: sigma_1 {fit.stiffness_scatter:.0%}\n"
        f"  with sigma_0 in the walk: s_sigma {more.s_sigma / CM:.1f}, R2 {more.stiffness_r2:.2f}, "
        f"error {more.stiffness_scatter:.0%}"
    )
    estimate = fit(0.05, 0.005)
    print(
        f"  sunk 5.0 +- 0.5 cm: sigma_1 {estimate.normal_stiffness / 1e4:.1f} +- "
        f"{estimate.normal_stiffness_std / 1e4:.1f} N/cm2, phi {estimate.friction_angle:.2f} +- "
        f"{estimate.friction_angle_std:.2f} rad, "
        f"standard deviation of the soils {np.std(soils.friction_angle):.2f}"
    )


def unprinted():
    """How figure 5 depends on ground and body, and what eq. 29 says of SSC-1."""
    print("\nWhat is not printed: number of legs at which the largest sinkage first drops by 5 %")
    cases = {
        "as assumed: 0.7 N/cm3, body 2 cm below the hub": (0.7e6, {}),
        "ground of 0.4 N/cm3": (0.4e6, {}),
        "ground of 1.0 N/cm3": (1.0e6, {}),
        "body 5 cm below the hub": (0.7e6, {"clearance": 0.05}),
        "body of twice the area": (0.7e6, {"body_area": 0.08}),
        "legs bent forwards": (0.7e6, {"leg": replace(wheel_leg().leg, arc=-0.03)}),
    }
    walkers = [wheel_leg("none", legs=n, **change) for _, change in cases.values() for n in LEGS]
    grounds = [LinearGround(stiffness=a) for a, _ in cases.values() for _ in LEGS]
    deepest = gait_metrics(walk(walkers, grounds)).max_sinkage.reshape(len(cases), -1)
    for name, sunk in zip(cases, deepest, strict=True):
        drops = np.flatnonzero(1.0 - sunk[1:] / sunk[:-1] >= 0.05)
        print(f"  {name:48s} {2 + drops[0] if drops.size else 'none'}")
    soil, tip = GROUNDS["SSC-1"], wheel_leg("LTF").plates()
    area = np.sum(tip.area[10:30])  # of the foot of one leg
    pressed = (3.75 * 9.81 / area - soil.offset) / soil.stiffness
    by_angle, by_stress = (soil.friction_angle - 0.76) / -0.07, 3.39e4 / soil.normal_stiffness
    print(f"\nSinkage on SSC-1, cm: {by_angle:.1f} by s_I and s_Z of eq. 29, ", end="")
    print(f"{by_stress:.1f} by s_sigma,")
    print(f"{pressed * CM:.1f} where 3.75 kg stand on the {area * 1e4:.1f} cm2 of one LTF")


def strip(axes):
    """The walker at moments of its walk, the ground pushing on its plates."""
    wheel = wheel_leg("LTF")
    walked = walk(wheel, SAND, turns=2.0)
    start, count, shift = 1000, 6, 0.42
    moments = start + np.round(np.linspace(0, 200, count)).astype(int)
    origin = walked.x[start, 0]
    spots = []
    for k, i in enumerate(moments):
        found = plate_stresses(walked, i, wheel, SAND)
        move = -origin + k * shift - (walked.x[i, 0] - origin)
        x, z = found.x[:-1] + move, found.z[:-1]
        spots.append((walked.x[i, 0] + move, walked.z[i, 0]))
        per_leg = x.size // wheel.legs
        for leg in range(wheel.legs):
            part = slice(leg * per_leg, (leg + 1) * per_leg)
            hub, n = np.array([spots[-1]]), wheel.leg.segments
            points = np.column_stack([x[part], z[part]])
            axes.plot(*np.vstack([hub, points[:n]]).T, color="#3b4252", lw=2.0, zorder=4)
            axes.plot(*points[n:].T, color=FOOT_COLOURS["LTF"], lw=3.0, zorder=5)
        pushed = np.flatnonzero(z < 0)
        force = np.column_stack([found.ahead, found.up])[:-1][pushed] * 1.2e-6
        ends = np.column_stack([x[pushed], z[pushed]])
        axes.add_collection(
            LineCollection(
                np.stack([ends - force, ends], axis=1), colors="#b5651d", linewidths=0.9, zorder=3
            )
        )
        axes.plot(*spots[-1], "o", color="#3b4252", ms=6, zorder=6)
        turned = np.rad2deg(walked.angle[i] - walked.angle[start])
        axes.annotate(
            f"{turned:.0f}$\\degree$\nslip {walked.slip[i, 0]:+.2f}\n{walked.torque[i, 0]:.1f} N m",
            (spots[-1][0], 0.325),
            ha="center",
            va="bottom",
            fontsize=8,
            color="#3b4252",
        )
    left, right = -0.22, (count - 1) * shift + 0.22
    axes.fill_between([left, right], -0.19, 0.0, color=SOIL, zorder=0)
    axes.plot([left, right], [0, 0], color=EDGE, lw=1.2, zorder=1)
    axes.set(xlim=(left, right), ylim=(-0.19, 0.43), aspect="equal", yticks=[-0.1, 0, 0.1, 0.2])
    axes.set_xticks([])
    axes.set_ylabel("height, m")
    axes.set_title(
        "One stride on five legs with load testing feet, left to right; lines: stress of the "
        "ground on the feet, 1.2 cm for 1 N/cm$^2$",
        loc="left",
        fontsize=10,
    )
    for side in ("top", "right", "bottom"):
        axes.spines[side].set_visible(False)


def numbers(axes, legs):
    """Slip and sinkage over the number of legs."""
    n = np.arange(1, legs.rms_slip.size + 1)
    axes.plot(n, legs.rms_slip, "o-", color="#3b4252", label="slip, rms")
    axes.plot(
        n, legs.rms_slip_propelled, "o:", color="#3b4252", mfc="w", label="slip, rms, propelled"
    )
    axes.set(xlabel="legs, without feet", ylabel="slip", ylim=(0, 1), xticks=n)
    other = axes.twinx()
    other.plot(n, legs.max_sinkage * CM, "s-", color="#b5651d", label="sinkage, largest")
    other.plot(n, legs.rms_sinkage * CM, "s:", color="#b5651d", mfc="w", label="sinkage, rms")
    other.set_ylim(0, 20)
    other.set_ylabel("sinkage, cm", color="#b5651d")
    other.tick_params(axis="y", colors="#b5651d")
    lines = [*axes.get_lines(), *other.get_lines()]
    axes.legend(
        lines,
        [line.get_label() for line in lines],
        fontsize=7.5,
        frameon=False,
        ncols=2,
        loc="lower left",
        handlelength=1.6,
        columnspacing=0.9,
    )
    axes.set_title("Each leg lowers the slip;\nthe fifth lifts the body off", fontsize=10)
    axes.spines["top"].set_visible(False)
    other.spines["top"].set_visible(False)


def compared(axes, feet):
    """Sinkage and slip of the feet as the ground grows firmer."""
    for foot, z, s in zip(feet.feet, feet.sinkage * CM, feet.slip, strict=True):
        axes.plot(z, s, "-", color=FOOT_COLOURS[foot], lw=2)
        axes.scatter(z, s, s=18 + 60 * (feet.stiffness / 1e6) ** 2, color=FOOT_COLOURS[foot])
        axes.annotate(
            foot if foot != "none" else "no foot",
            (z[0], s[0]),
            xytext=(4, 6),
            textcoords="offset points",
            color=FOOT_COLOURS[foot],
            fontsize=9,
        )
    axes.axhline(0, color="#cccccc", lw=0.8, zorder=0)
    axes.set(xlabel="sinkage, mean of a turn, cm", ylabel="slip, mean of a turn")
    axes.set(xlim=(0, 17.5), ylim=(-0.05, 0.23))
    axes.set_title(
        "Larger feet sink and slip less\n(dots: $\\alpha_z$ 0.4 to 1.0 N/cm$^3$)",
        fontsize=10,
    )


def characterised(axes, soils, fit):
    """Normal stiffness against midstance sinkage: simulated, fitted, printed."""
    colour = dict(zip(dict.fromkeys(soils.soil), SOIL_COLOURS, strict=True))
    for i, name in enumerate(soils.soil):
        axes.plot(
            soils.sinkage[i] * CM,
            soils.normal_stiffness[i] / 1e4,
            STATE_MARKS[soils.state[i]],
            color=colour[name],
            ms=7,
            label=name if soils.state[i] == "medium" else None,
        )
    z = np.linspace(0.012, 0.17, 200)
    estimate = fit(z)
    mean, std = estimate.normal_stiffness / 1e4, estimate.normal_stiffness_std / 1e4
    axes.plot(z * CM, mean, color="#3b4252", label=f"fitted, {fit.s_sigma / CM:.1f} N/cm / z")
    axes.fill_between(z * CM, mean - std, mean + std, color="#3b4252", alpha=0.12, lw=0)
    axes.plot(z * CM, 3.39 / (z * CM), "--", color="#8a8f98", label="printed, 3.39 N/cm / z")
    axes.set(
        xlabel="midstance sinkage, cm",
        ylabel="normal stiffness $\\sigma_1$, N/cm$^2$",
        xlim=(0, 17.5),
        ylim=(0, 6),
    )
    axes.legend(fontsize=7.5, frameon=False)
    axes.set_title(
        "Stiffness from sinkage (loose, raked, dense:\n"
        "down, round, up); band: soils left out of the fit",
        fontsize=10,
    )


def main():
    """Simulate, tell, draw."""
    legs, feet = compare_legs(SAND), compare_feet()
    soils = simulate_sinkage()
    fit = fit_simulated_sinkage(soils)
    figures(legs, feet, soils, fit)
    unprinted()
    figure = plt.figure(figsize=(13, 8.2), layout="constrained")
    grid = figure.add_gridspec(2, 3, height_ratios=[0.95, 1.0])
    strip(figure.add_subplot(grid[0, :]))
    numbers(figure.add_subplot(grid[1, 0]), legs)
    compared(figure.add_subplot(grid[1, 1]), feet)
    characterised(figure.add_subplot(grid[1, 2]), soils, fit)
    for axes in figure.axes[2:]:
        axes.spines["top"].set_visible(False)
    for axes in figure.axes[3:]:
        axes.spines["right"].set_visible(False)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT, dpi=110)
    print(f"\npicture: {OUT}")


if __name__ == "__main__":
    main()
