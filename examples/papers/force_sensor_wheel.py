"""The force-sensor wheel of Nagatani et al. 2009, in simulation, from readings to drawbar pull."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

from soilml import Model, Operating, StressShift, Table, Wheel, soil
from soilml.config.case import Case
from soilml.config.measurement_noise import Noise
from soilml.gap import gap
from soilml.numerics.prior import Prior
from soilml.report.aligned_text import format_table
from soilml.systems.force_sensor_wheel import (
    MohrCoulomb,
    SensingWheel,
    SteadyRun,
    StressProfile,
    balanced_arc,
    bekker_stress_profile,
    bin_stress,
    estimate_shear_modulus,
    forces_from_profile,
    predict_pull,
    profile_from_readings,
    simulate_readings,
    solve_force_balance,
)

matplotlib.use("Agg")
import matplotlib.pyplot as plt

OUT = Path("demo/papers")
SAND = soil("nagatani2009/toyoura_sand")
STRENGTH = MohrCoulomb(friction_angle=SAND.friction_angle, cohesion=SAND.cohesion)
SENSORS = SensingWheel()
WHEEL = Wheel(radius=SENSORS.radius, width=SENSORS.width)
WEIGHT, TRUE = 28.92, float(SAND.shear_modulus)
SLIPS, SLOPES = (0.11, 0.18, 0.29, 0.39, 0.80), (0.0, 2.0, 4.0, 6.0, 8.0)
TABLE_I = (0.0072, 0.0073, 0.0070, 0.0066, 0.0026)
#: Of 70 degrees of visible contact, 45 are taken to lie in front of the axle and 25 behind it.
FRONT, REAR = np.radians([45.0, 25.0])
SINKAGE = float(SENSORS.radius * (1.0 - np.cos(FRONT)))
REBOUND = float((1.0 - np.cos(REAR)) / (1.0 - np.cos(FRONT)))
SPEED_ERROR, WEIGHT_STD = 0.015, 0.3
NEEDED = WEIGHT * np.sin(np.radians(SLOPES))


def main() -> None:
    """Print the results and draw the figure."""
    rng = np.random.default_rng(1)
    true_runs = [
        SteadyRun(slip=s, weight=WEIGHT, slope=np.radians(a))
        for s, a in zip(SLIPS, SLOPES, strict=True)
    ]
    arcs = [balanced_arc(np.radians(30.0), at, SENSORS, STRENGTH, TRUE) for at in true_runs]
    readings = [
        simulate_readings(arc, SENSORS, turns=9, crown=0.3, lugs=(0.3, 0.3), seed=i)
        for i, arc in enumerate(arcs)
    ]
    runs = [measured(at, rng) for at in true_runs]
    estimates = [
        estimate_shear_modulus(r, at, SENSORS, STRENGTH)
        for r, at in zip(readings, runs, strict=True)
    ]
    flat = estimates[0]
    later = list(zip(readings, runs, strict=True))[1:]
    pulls = [predict_pull(r, at, SENSORS, STRENGTH, flat) for r, at in later]
    wide = [
        bekker_stress_profile(WHEEL, SAND, slip=s, sinkage=SINKAGE, rebound=REBOUND) for s in SLIPS
    ]
    refitted = solve_force_balance(wide[0], true_runs[0], SENSORS, STRENGTH).shear_modulus
    known = [pulled(w, at, TRUE) for w, at in zip(wide, true_runs, strict=True)]
    tuned = [pulled(w, at, refitted) for w, at in zip(wide, true_runs, strict=True)]
    binned = bin_stress(readings[0], SENSORS)
    raw = binned.angle[binned.normal > 0]

    print(
        "Position of an arc of 30 degrees for one k_x of 7.2 mm, and its estimate by the sensors:"
    )
    print("errors of 1.5 % in speed, 0.3 N in weight and 0.02 N in each sample")
    rows = [
        (f"{s:.2f}", f"{a:.0f}", *angles(arc), *angles(g.profile), f"{1e3 * g.shear_modulus:.2f}",
         f"{1e3 * g.interval[0]:.2f}", f"{1e3 * g.interval[1]:.2f}", f"{1e3 * t:.1f}")
        for s, a, arc, g, t in zip(SLIPS, SLOPES, arcs, estimates, TABLE_I, strict=True)
    ]  # fmt: skip
    header = ("slip", "slope deg", "true from", "to deg", "estimated from", "to deg")
    print(format_table((*header, "k_x mm", "90 % from", "to", "Table I mm"), rows, text_columns=0))
    print(f"\nThe arc appears {np.rad2deg(np.ptp(raw)):.0f} degrees long with sensors of 9.5 mm.")

    print("\nDrawbar pull in N with the k_x found on level ground, and the conventional model's")
    rows = [
        (f"{s:.2f}", f"{n:.2f}", f"{p.drawbar_pull:.2f}", f"{p.interval[0]:.2f}",
         f"{p.interval[1]:.2f}", f"{k:.2f}", f"{c:.2f}")
        for s, n, p, k, c in zip(SLIPS[1:], NEEDED[1:], pulls, known[1:], tuned[1:], strict=True)
    ]  # fmt: skip
    header = ("slip", "needed", "measured stress", "90 % from", "to")
    print(format_table((*header, "conventional", "its own k_x"), rows, text_columns=0))
    print(
        f"\nThe conventional model's own k_x on level ground is {1e3 * refitted:.1f} mm. With "
        f"{1e3 * TRUE:.1f} mm it has\nthe wheel pull {known[0]:.2f} N there, which pulls nothing."
    )

    without_noise(true_runs, arcs)
    for shift, stiffer in ((0.3, 1.0), (0.57, 8.0)):
        on = "that sand" if stiffer == 1.0 else f"sand {stiffer:g} times as stiff"
        print(f"\nA wheel with stress-shift {shift:g} on {on}, its model without:")
        print(f"  {diagnosed(shift, stiffer)}")
    OUT.mkdir(parents=True, exist_ok=True)
    draw(arcs, binned, estimates, wide, pulls, known, tuned)


def without_noise(runs: list[SteadyRun], arcs: list[StressProfile]) -> None:
    """Sensitivity to the printed k_x, the contact, the disc, the lugs and the speed."""
    print("\nWithout noise")
    asked = [
        balanced_arc(np.radians(30.0), at, SENSORS, STRENGTH, modulus)
        for at, modulus in zip(runs, TABLE_I, strict=True)
    ]
    middles = [f"{np.rad2deg(0.5 * (a.exit_angle + a.entry_angle)):.0f}" for a in asked]
    print(f"  middle of the arc for each printed k_x, deg  {' '.join(middles)}")
    pulls = []
    for front in np.radians([35.0, 45.0, 50.0]):
        first, last = 1.0 - np.cos(front), 1.0 - np.cos(FRONT + REAR - front)
        sunk, back = float(SENSORS.radius * first), float(last / first)
        wide = bekker_stress_profile(WHEEL, SAND, slip=SLIPS[0], sinkage=sunk, rebound=back)
        pulls.append(f"{pulled(wide, runs[0], TRUE):.1f}")
    print(f"  pull of the conventional 70 deg, 35, 45 or 50 in front, N  {' '.join(pulls)}")
    quiet = replace(SENSORS, noise=0.0)
    ways = {
        "deconvolved": ((0.3, 0.3), profile_from_readings),
        "uncorrected": ((0.3, 0.3), as_read),
        "lugs 50 % in front, 10 % behind": ((0.5, 0.1), profile_from_readings),
    }
    for name, (lugs, way) in ways.items():
        level, later = (way(simulate_readings(arcs[i], quiet, lugs=lugs), quiet) for i in (0, 3))
        found = solve_force_balance(level, runs[0], quiet, STRENGTH).shear_modulus
        off = pulled(later, runs[3], found) - NEEDED[3]
        print(
            f"  {name}: error of k_x {found / TRUE - 1:+.0%}, of the pull at slip 0.39 {off:+.2f} N"
        )
    fast = replace(runs[0], slip=1.0 - (1.0 - SLIPS[0]) * (1.0 - SPEED_ERROR))
    found = solve_force_balance(arcs[0], fast, quiet, STRENGTH).shear_modulus
    print(f"  speed read 1.5 % low at slip 0.11: error of k_x {found / TRUE - 1:+.0%}")


def as_read(readings, wheel: SensingWheel) -> StressProfile:
    """The mean of the readings, averaged over the disc."""
    binned = bin_stress(readings, wheel)
    return StressProfile(binned.angle, binned.normal)


def measured(at: SteadyRun, rng: np.random.Generator) -> SteadyRun:
    """The run as its sensors report it."""
    slip_std = SPEED_ERROR * (1.0 - at.slip)
    return replace(
        at,
        slip=at.slip + slip_std * rng.normal(),
        weight=at.weight + WEIGHT_STD * rng.normal(),
        slip_std=slip_std,
        weight_std=WEIGHT_STD,
    )


def pulled(profile, at: SteadyRun, modulus: float) -> float:
    """Drawbar pull (N) of a profile scaled to carry the load."""
    found = forces_from_profile(
        profile,
        shear_modulus=modulus,
        friction_angle=STRENGTH.friction_angle,
        slip=at.slip,
        radius=SENSORS.radius,
        width=SENSORS.width,
    )
    return float(found.drawbar_pull / found.load * at.weight * np.cos(at.slope))


def angles(profile) -> tuple[str, str]:
    """Exit and entry in degrees."""
    return f"{np.rad2deg(profile.exit_angle):.1f}", f"{np.rad2deg(profile.entry_angle):.1f}"


def diagnosed(shift: float, stiffer: float) -> str:
    """Result of the gap workflow for a wheel whose stress is concentrated in front."""
    sand = replace(SAND, kphi=SAND.kphi * stiffer, kc=SAND.kc * stiffer)
    slip, load = (x.ravel() for x in np.meshgrid((*SLIPS[:4], 0.5), [10.0, 20.0, WEIGHT]))
    force = (Model(WHEEL) + StressShift(shift=shift))(sand, Operating(slip=slip, load=load))
    noise = {"torque_Nm": 0.01, "drawbar_pull_N": 0.15, "sinkage_m": 3e-4}
    true = dict(zip(noise, (force.torque, force.drawbar_pull, force.sinkage), strict=True))
    rng, repeats = np.random.default_rng(0), 3
    table = Table(
        {
            "run": np.repeat([f"run {i}" for i in range(repeats)], len(slip)),
            "slip": np.tile(slip, repeats),
            "load_N": np.tile(load, repeats),
        }
        | {
            name: np.concatenate([true[name] + rng.normal(0.0, std, len(slip)) for _ in range(3)])
            for name, std in noise.items()
        }
    )
    prior = {
        "friction_angle": Prior(0.5, 0.8),
        "shear_modulus": Prior(0.003, 0.02, log=True),
        "kphi": Prior(sand.kphi / 10.0, sand.kphi * 10.0, log=True),
        "n": Prior(0.6, 1.6),
    }
    case = Case(Model(WHEEL), sand, prior, {k: Noise(v) for k, v in noise.items()})
    report = gap(case, table)
    size = ", ".join(
        f"{p} {v.value:.3f} +- {v.std:.3f}" for e in report.effects for p, v in e.parameters.items()
    )
    return f"soilml gap: {report.status}; {report.sentence} {size}"


def draw(arcs, binned, estimates, wide, pulls, known, tuned) -> None:
    """Four panels."""
    figure, ((a, b), (c, d)) = plt.subplots(2, 2, figsize=(11, 7.6), layout="constrained")
    deg = np.rad2deg
    bar = {"fmt": "o", "capsize": 3, "ms": 5}
    scale = estimates[0].magnification
    a.plot(deg(binned.angle), scale * binned.normal / 1e3, ".", ms=3, color="0.55", label="sensors")
    a.plot(deg(arcs[0].angle), arcs[0].normal / 1e3, color="k", lw=3, alpha=0.35, label="true")
    found = estimates[0].profile
    a.plot(deg(found.angle), scale * found.normal / 1e3, "C0", label="found, deconvolved")
    load = forces_from_profile(
        wide[0], shear_modulus=TRUE, friction_angle=STRENGTH.friction_angle, slip=SLIPS[0],
        radius=SENSORS.radius, width=SENSORS.width,
    ).load  # fmt: skip
    a.plot(deg(wide[0].angle), wide[0].normal * WEIGHT / load / 1e3, "C3--", label="conventional")
    a.set_title("Level ground, slip 0.11; all scaled to the load")
    for arc, slip, estimate in zip(arcs, SLIPS, estimates, strict=True):
        line = b.plot(deg(arc.angle), arc.normal / 1e3, lw=3, alpha=0.3)[0]
        y = estimate.magnification * estimate.profile.normal / 1e3
        b.plot(deg(estimate.profile.angle), y, color=line.get_color(), label=f"slip {slip:.2f}")
    b.set_title("Arcs of 30 deg for k_x = 7.2 mm (pale), and estimates")
    for axes in (a, b):
        axes.set(xlim=(-40, 60), xlabel="angle on the rim, forward positive (deg)")
        axes.set_ylabel("normal stress (kPa)")
    value = np.asarray([g.shear_modulus for g in estimates])
    ends = np.asarray([g.interval for g in estimates])
    c.axhline(1e3 * TRUE, color="0.6", lw=1)
    c.errorbar(SLIPS, 1e3 * value, 1e3 * np.abs(ends.T - value), label="estimated, 90 %", **bar)
    c.plot(SLIPS, 1e3 * np.asarray(TABLE_I), "k^", ms=6, mfc="none", label="Table I (measured)")
    c.set(
        xlabel="slip", ylabel="k_x (mm)", ylim=(0, None), title="Shear modulus, true value 7.2 mm"
    )
    value = np.asarray([p.drawbar_pull for p in pulls])
    ends = np.asarray([p.interval for p in pulls])
    d.plot(SLIPS, NEEDED, "k_", ms=16, mew=2, label="required on the slope")
    d.errorbar(SLIPS[1:], value, np.abs(ends.T - value), label="from measured stress, 90 %", **bar)
    d.plot(SLIPS, known, "C3s--", ms=5, label="conventional, k_x = 7.2 mm")
    d.plot(SLIPS, tuned, "C1D:", ms=5, label="conventional, k_x of its own")
    d.set(xlabel="slip", ylabel="drawbar pull (N)", title="Drawbar pull, k_x from level ground")
    for axes in (a, b, c, d):
        axes.grid(alpha=0.25)
        axes.legend(fontsize=8)
    figure.savefig(OUT / "force_sensor_wheel.png", dpi=110)


if __name__ == "__main__":
    main()
