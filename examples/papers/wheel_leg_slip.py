"""Slip, soil and mobility from a wheel-leg's torque, vibration and sinkage: Comin and Saaj 2017."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from soilml import Model, Operating, Wheel, soil
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.gap import gap
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.papers import comin2017_slip as chapter
from soilml.physics.gears.wheel_leg_foot import Midstance
from soilml.physics.pull_efficiency import CLASSES, THRESHOLDS, pull_efficiency, traffic_class
from soilml.systems.wheel_legs.geometry import wheel_leg
from soilml.systems.wheel_legs.resistive_force import GROUNDS
from soilml.systems.wheel_legs.sensor_fusion import (
    PROPERTIES,
    RULES,
    SENSORS,
    fit_estimators,
    score_estimators,
)
from soilml.systems.wheel_legs.slip_models import (
    TORQUE_SLIP,
    VIBRATION_SLIP,
    fit_torque_slip,
    soil_spring,
)
from soilml.systems.wheel_legs.soil_from_slip import soil_from_torque, soil_from_vibration
from soilml.systems.wheel_legs.stances import (
    FOOT,
    LOAD,
    SLIPS,
    SpringLeg,
    four_soils,
    midstance_torques,
    sample_soils,
    simulate_stance,
    simulate_stances,
    vibration_amplitude,
)
from soilml.systems.wheel_legs.walk import walk

Floats = NDArray[np.float64]

OUT = Path("demo/papers")
NAMES = ("SSC-1", "SSC-2", "SSC-3", "ES-3")
COLOURS = ("tab:orange", "tab:brown", "tab:blue", "tab:green")
PUBLISHED = (48.8, 69.0, 34.2, 54.0)
ROVER = 50.0 * 9.81  # N on each wheel
REALISATIONS = 5  # Of the noise of walks, each analysed by the gap workflow


def run() -> None:
    """Print the results and draw the figure."""
    figure, axes = plt.subplots(2, 2, figsize=(12.5, 9.5), constrained_layout=True)
    torque_slip(axes[0, 0])
    vibration_slip(axes[0, 1])
    fusion(axes[1, 0])
    mobility(axes[1, 1])
    own_gap()
    what_is_assumed()
    OUT.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT / "wheel_leg_slip.png", dpi=110)
    print(f"\nfigure: {OUT / 'wheel_leg_slip.png'}")


def torque_slip(axes: plt.Axes) -> None:
    """Torque in midstance: simulated, the fitted law, and the printed one."""
    known, torque = four_soils(), midstance_torques(four_soils())
    fitted, printed = chapter.torque_fit(), TORQUE_SLIP["terramechanics"]
    print(f"Torque in midstance (N m), {LOAD:g} N on one load testing foot")
    print("  slip     " + "".join(f"{name:>9}" for name in NAMES))
    for slip, row in zip(SLIPS, torque, strict=True):
        print(f"  {slip:<9.3f}" + "".join(f"{value:9.3f}" for value in row))
    print("  phi = c + b slope + a intercept:      c        b        a      R2")
    rows = {"fitted": (*fitted.law.friction, fitted.goodness["friction"])}
    rows["printed"] = (*printed.friction, 0.909)
    for name, row in rows.items():
        print(f"    {name:<29}" + "".join(f"{value:9.3f}" for value in row))
    others = {f"fitted at {load:g} N": (known, load) for load in (9.0, 15.0)}
    others["200 soils drawn between"] = (sample_soils(200, seed=1), LOAD)
    for name, (ground, load) in others.items():
        drawn = (
            midstance_torques(ground, load=load),
            SLIPS,
            ground.soil.friction_angle,
            ground.normal_stiffness,
        )
        other = fit_torque_slip(*drawn, "terramechanics")
        row = (*other.law.friction, other.goodness["friction"])
        print(f"    {name:<29}" + "".join(f"{value:9.3f}" for value in row))
    print("  sigma_1 = c + b slope:                c        b               R2")
    rows = {"fitted": (*fitted.law.stiffness[:2], fitted.goodness["stiffness"])}
    rows["printed"] = (*printed.stiffness[:2], 0.899)
    for name, row in rows.items():
        print(f"    {name:<29}" + "{:9.3f}{:9.3f}         {:9.3f}".format(*row))
    one = soil_from_torque(torque[2, 1], SLIPS[2], "simplified")
    angle, spread = np.rad2deg(one.friction_angle), np.rad2deg(one.std[0])
    print(f"  one stance on SSC-2, printed simplified model: phi = {angle:.0f} +- {spread:.0f}"
          f" degrees ({np.rad2deg(known.soil.friction_angle[1]):.1f} measured)")  # fmt: skip
    a, b = printed.line(known.soil.friction_angle, known.normal_stiffness)
    reach = np.asarray([0.0, 0.5])
    for k, (name, colour) in enumerate(zip(NAMES, COLOURS, strict=True)):
        axes.plot(SLIPS, torque[:, k], "o", color=colour, label=name)
        slope, start = np.polyfit(torque[:, k], SLIPS, 1)
        axes.plot(reach, (reach - start) / slope, "-", color=colour, lw=1)
        axes.plot(reach, (reach - a[k]) / b[k], "--", color=colour, lw=1)
    axes.plot([], [], "k-", lw=1, label="line of slip on torque")
    axes.plot([], [], "k--", lw=1, label="as printed")
    axes.set(xlabel="slip", ylabel="torque in midstance, N m", ylim=(0.6, 2.7))
    axes.set_title(f"Torque and slip: one foot under {LOAD:g} N")
    axes.legend(fontsize=8, loc="upper left", ncols=2)


def what_is_assumed() -> None:
    """Print what the foot carries, and what follows from printed coefficients alone."""
    chord, rise, length = 0.04, 0.0055, 0.18
    half = 0.5 * chord
    middle = (half**2 + rise**2) / (2.0 * rise)
    feet = {
        "all of it ahead of the leg": FOOT,
        "centred on the leg": Midstance(
            radius=middle, width=0.029, arc=np.arcsin(half / middle), leg_length=length,
            tip_height=rise,
        ),
    }  # fmt: skip
    print("\nThe foot of 4 cm, and the largest load (N) that each soil carries at any slip")
    head = "".join(f"{name:>8}" for name in NAMES)
    print(f"  {'arc':28s}{'R cm':>6}{'theta_1w deg':>14}{head}")
    for name, foot in feet.items():
        at = Operating(slip=SLIPS[:, None], load=1e4)
        most = Model(foot)(four_soils().soil, at).load.max(axis=0)
        cells = "".join(f"{value:8.0f}" for value in np.asarray(most))
        print(f"  {name:28s}{100 * foot.radius:6.1f}{np.rad2deg(foot.arc):14.1f}{cells}")
    known = four_soils()
    a, _ = TORQUE_SLIP["empirical"].line(known.soil.friction_angle, known.normal_stiffness)
    told = ", ".join(f"{value:.2f} on {name}" for value, name in zip(a, NAMES, strict=True))
    planar, linear = VIBRATION_SLIP["planar"], VIBRATION_SLIP["linear"]
    print(f"\nPrinted coefficients: intercepts of the empirical torque model {told};\n"
          f"c_I of the linear vibration model is the planar one's at "
          f"{(linear.c_i - planar.c_i) / planar.c_k:.2f} kN/m")  # fmt: skip


def vibration_slip(axes: plt.Axes) -> None:
    """One stance of the rotating spring, and its amplitude against slip."""
    friction = chapter.FRICTION
    leg = SpringLeg(stiffness=4000.0)
    found = simulate_stance(leg, 0.25, friction, np.deg2rad(10.0))
    axes.plot(found.time, found.acceleration / 9.81, color="tab:purple", lw=0.8)
    axes.set(xlabel="time since midstance, s", ylabel="hub acceleration, g", ylim=(-0.75, 1.9))
    axes.set_title("Stick-slip: a leg of 4 kN/m, friction drops by 10 degrees, slip 0.25")
    slips = np.linspace(0.02, 0.5, 25)
    inner = axes.inset_axes((0.1, 0.54, 0.86, 0.43))
    for drop in (5.0, 10.0, 20.0):
        shaken = vibration_amplitude(leg, slips, friction, np.deg2rad(drop)) / 9.81
        inner.plot(slips, shaken, ".-", lw=0.8, label=f"drop {drop:g} degrees")
    known = four_soils()
    increment, spring = soil_spring(known.soil.friction_angle, known.normal_stiffness)
    line = VIBRATION_SLIP["planar"].line(increment[2], spring[2])
    inner.plot(line[0] + line[1] * 9.81 * np.asarray([0.0, 0.6]), [0.0, 0.6], "k--", lw=1,
               label="printed, SSC-3")  # fmt: skip
    inner.set(xlim=(0, 0.52), ylim=(0, 1.25))
    inner.set_xlabel("slip", fontsize=8, labelpad=1)
    inner.set_ylabel("amplitude, g", fontsize=8)
    inner.tick_params(labelsize=7)
    inner.legend(fontsize=7, ncols=2, loc="upper left")
    planar = chapter.vibration_fit(True)
    print("\nStick-slip of the rotating spring, 63 legs and soils")
    print(f"  R2 of slip on amplitude, median leg   {planar.goodness['slip']:6.2f}")
    print(f"  R2 of the planes: intercept, slope    {planar.goodness['intercept']:6.2f}"
          f"{planar.goodness['slope']:6.2f}   (printed 0.98, 0.96)")  # fmt: skip
    one = soil_from_vibration(2.0, 0.25)
    angle, spread = np.rad2deg(one.friction_angle), np.rad2deg(one.std[0])
    print(f"  2 m/s^2 at slip 0.25, printed linear model: phi = {angle:.0f} +- {spread:.0f}"
          " degrees")  # fmt: skip
    print("  springs of the four soils by table VII: "
          + ", ".join(f"{k / 1e3:.2f} kN/m and {np.rad2deg(d):.0f} degrees"
                      for k, d in zip(spring, increment, strict=True)))  # fmt: skip


def fusion(axes: plt.Axes) -> None:
    """Torque, vibration and sinkage on simulated soils: each alone and fused."""
    train, test = simulate_stances(400, seed=1), simulate_stances(400, seed=2)
    print("\nOne stance on each of 400 simulated test soils")
    names = (*SENSORS, *RULES)
    for k, name in enumerate(PROPERTIES):
        unit, scale = (("degrees", 180.0 / np.pi), ("N/cm²", 1e-4))[k]
        estimators = fit_estimators(train, name)
        found = score_estimators(estimators, test)
        print(f"  {name.replace('_', ' '):<24} {'RMSE':>8} {'std':>8} {'in 95 %':>8}  {unit}")
        for sensor in names:
            row = found[sensor]
            print(f"    {sensor:<22} {scale * row.rmse:8.2f} {scale * row.predicted_std:8.2f}"
                  f" {100 * row.coverage_95:7.0f}%")  # fmt: skip
        between = {
            "torque, vibration": (0, 1),
            "torque, sinkage": (0, 2),
            "vibration, sinkage": (1, 2),
        }
        correlations = ", ".join(
            f"{two} {estimators.correlation[at]:.2f}" for two, at in between.items()
        )
        print(f"    correlation of the errors: {correlations}")
        truth = np.std(test.ground.soil.friction_angle if k == 0 else test.ground.normal_stiffness)
        place = np.arange(len(names)) + 0.38 * (k - 0.5)
        label = f"{name.replace('_', ' ')} (spread {scale * truth:.1f} {unit})"
        bars = axes.bar(place, [found[n].rmse / truth for n in names], 0.36, label=label)
        axes.bar_label(bars, [f"{100 * found[n].coverage_95:.0f}" for n in names], fontsize=8)
    axes.set_xticks(range(len(names)), [n.replace(" ", "\n") for n in names])
    axes.set(ylabel="RMSE over the spread of the soils", ylim=(0, 1.35))
    axes.set_title("Three sensors and three rules; above: coverage of the 95 % intervals")
    axes.legend(fontsize=8)


def mobility(axes: plt.Axes) -> None:
    """Pull efficiency of the heavier rover's wheel as a function of width and slip."""
    print("\nPull efficiency (%) of a wheel of 0.15 m radius under 50 kg")
    print("  width m  slip" + "".join(f"{name:>8}" for name in NAMES) + "   classes as published")
    want = traffic_class(np.asarray(PUBLISHED) / 100)
    for width in (0.12, 0.15, 0.18, 0.21):
        for slip in (0.1, 0.2, 0.4):
            found = np.stack([efficiency(name, width, slip) for name in NAMES])
            right = int((traffic_class(found) == want).sum())
            cells = "".join(f"{100 * value:8.1f}" for value in found)
            print(f"  {width:7.2f}  {slip:4.1f}{cells}   {right} of 4")
    print("  published    " + "".join(f"{value:8.1f}" for value in PUBLISHED))
    widths = np.linspace(0.1, 0.26, 9)
    for name, colour, value in zip(NAMES, COLOURS, PUBLISHED, strict=True):
        lines = [100 * efficiency(name, widths, slip) for slip in (0.1, 0.2, 0.5)]
        axes.plot(widths, lines[1], color=colour, label=name)
        axes.fill_between(widths, lines[0], lines[2], color=colour, alpha=0.2)
        axes.plot(chapter.WIDTH, value, "D", color=colour, mec="k", ms=6)
    for level in THRESHOLDS:
        axes.axhline(100 * level, color="0.5", lw=0.8, ls=":")
    sides = axes.twinx()
    sides.set(ylim=(0, 80))
    sides.set_yticks([17.5, 42.5, 57.5, 72.5], CLASSES, rotation=90, va="center")
    sides.tick_params(length=0)
    axes.plot([], [], "D", color="w", mec="k", label="published")
    axes.set(
        xlabel="width of the wheel (not printed), m", ylabel="pull efficiency, %", ylim=(0, 80)
    )
    axes.set_title("A 300 kg rover on six wheels: slip 0.2, band 0.1 to 0.5")
    axes.legend(fontsize=8, loc="lower right")


def efficiency(name: str, width: Floats | float, slip: float) -> Floats:
    """Pull efficiency of a rover's wheel on a soil of table I."""
    wheel, at = Model(Wheel(radius=0.15, width=width)), Operating(slip=slip, load=ROVER)
    return np.asarray(pull_efficiency(wheel, soil(f"comin2017/{name.lower()}"), at))


def own_gap() -> None:
    """The midstance model compared with walks by resistive forces in place of measurements."""
    first, *others = [gap(*walked_rows(seed)) for seed in range(REALISATIONS)]
    print("\nThe paper's own gap: midstance integrals against walks by resistive forces, SSC-2")
    print(f"  {first.status}: {first.sentence}")
    angle = np.rad2deg(first.soil_before["friction_angle"].value)
    true = np.rad2deg(soil("comin2017/ssc-2").friction_angle)
    print(f"  friction angle fitted {angle:.0f} degrees, {true:.0f} measured")
    print(f"  by realisations of the noise, {REALISATIONS} in all:")
    firsts = [" + ".join(r.cause_set[0]) if r.cause_set else "" for r in (first, *others)]
    counts = Counter(zip([r.status for r in (first, *others)], firsts, strict=True))
    for (status, cause), count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        print(f"    {status:<13} {cause or 'no cause':<32} {count:>2}")


def walked_rows(seed: int) -> tuple[Case, Table]:
    """The midstance model as a case, and rows of walks with a realisation of their noise."""
    loads, slips = (8.0, 11.0, 14.0, 17.0), np.linspace(0.05, 0.5, 6)
    load, slip = (v.ravel() for v in np.meshgrid(loads, slips, indexing="ij"))
    legs = [wheel_leg("LTF", mass=value / 9.81) for value in load]
    walked = walk(legs, GROUNDS["SSC-2"], slip=slip, turns=1.0, steps=500).after(0.4 * np.pi)
    draw = np.random.default_rng(seed).standard_normal
    torque = walked.at_midstance(walked.torque)
    sinkage = walked.at_midstance(walked.sinkage) + FOOT.tip_height  # of the foot's lowest point
    table = Table({
        "run": np.asarray([f"{value:g} N" for value in load]), "slip": slip, "load_N": load,
        "torque_Nm": torque * (1 + 0.02 * draw(load.size)),
        "sinkage_m": sinkage + 5e-4 * draw(load.size),
    })  # fmt: skip
    ground = soil("comin2017/ssc-2", shear_modulus=0.017 * FOOT.area**0.5)
    case = Case(
        Model(FOOT), ground,
        prior={
            "cohesion": Prior(0.0, 5000.0), "friction_angle": Prior(0.35, 0.9),
            "shear_modulus": Prior(1e-4, 2e-2, log=True), "kphi": Prior(1e5, 2.5e6, log=True),
        },
        noise={"torque_Nm": Noise(share=0.02), "sinkage_m": Noise(constant=5e-4)},
    )  # fmt: skip
    return case, table


if __name__ == "__main__":
    run()
