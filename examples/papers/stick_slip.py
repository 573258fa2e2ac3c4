"""What makes the vibration of a wheel-leg grow with its slip: mechanisms against printed lines.

Comin and Saaj 2017 print a straight line of slip on vibration for each soil (eqs. 24, 25, 28) and a
spring on Coulomb friction (eqs. 20-23) as its reason. Run from the repository root:
python examples/papers/stick_slip.py
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from datagen.generate import generate
from datagen.recipe import packaged_file, read_recipe
from soilml.papers import comin2017_slip as chapter
from soilml.report.aligned_text import format_table
from soilml.systems.wheel_legs.slip_models import (
    GRAVITY,
    VIBRATION_SLIP,
    fit_lines,
    fit_vibration_slip,
    soil_spring,
)
from soilml.systems.wheel_legs.stances import SLIPS, SpringLeg, four_soils, vibration_amplitude
from training.dataset import read_dataset
from training.spec import read_spec
from training.train import train

Floats = NDArray[np.float64]

OUT = Path("demo/papers/stick_slip.png")
NAMES = ("SSC-1", "SSC-2", "SSC-3", "ES-3")
COLOURS = ("tab:orange", "tab:brown", "tab:blue", "tab:green")
#: Legs and soils of each mechanism: stiffness, N/m, and drop over the friction angle.
STIFFNESSES = (2500.0, 4000.0, 6000.0, 8000.0)
DROPS = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
SOFTENING = 0.03  # m, of the example that is drawn
MECHANISMS: dict[str, dict[str, tuple[float, ...]]] = {
    "drop at once (the paper's)": {},
    "damping of the hub": {"damping": (0.02, 0.05, 0.3, 0.7)},
    "mass of the foot": {"foot_mass": (0.05, 0.1, 0.5)},
    "bending of the leg": {"bending": (0.1, 0.2, 0.6, 1.0)},
    "partial stick": {"healing": (0.0, 0.25, 0.5, 0.75)},
    "drop over some sliding": {"softening": (0.005, 0.01, 0.02, SOFTENING, 0.05)},
}
FIVE = SLIPS[:, None]
STRAIGHT = 0.9  # R^2 of slip on vibration that counts as a straight line
DROP_OF_LEG = "fall of the hub grows with slip"
ROWS = 3000


@dataclass(frozen=True)
class Tried:
    """Variants of a mechanism: settings (variants,), R^2 and misfit in g (variants, soils)."""

    settings: dict[str, Floats]
    straight: Floats
    misfit: Floats


def printed_lines(slip: Floats) -> Floats:
    """Vibration (g), (slips, soils), by the printed linear model on the soils of table I."""
    known = four_soils()
    drop, spring = soil_spring(known.soil.friction_angle, known.normal_stiffness)
    a, b = VIBRATION_SLIP["linear"].line(drop, spring)
    return np.asarray((slip - a) / b / GRAVITY)


def simulated(settings: Mapping[str, Floats | float], slip: Floats = FIVE) -> Floats:
    """Vibration (g), (slips, variants, soils), of legs at 0.3 rad/s; `drop`: share of the angle."""
    angle = np.asarray(four_soils().soil.friction_angle)
    leg = {key: np.asarray(value)[..., None] for key, value in settings.items() if key != "drop"}
    drop = np.asarray(settings["drop"])[..., None] * angle
    slip = slip.reshape(-1, *(1,) * drop.ndim)
    return vibration_amplitude(SpringLeg(**leg), slip, angle, drop) / GRAVITY


def tried(options: dict[str, tuple[float, ...]]) -> Tried:
    """All variants of a mechanism at the slips above zero, where there is stick-slip at all."""
    (key, values), *_ = [*options.items(), ("damping", (0.1,))]
    grid = (v.ravel() for v in np.meshgrid(STIFFNESSES, DROPS, values, indexing="ij"))
    settings = dict(zip(("stiffness", "drop", key), grid, strict=True))
    vibration = simulated(settings, FIVE[1:])
    flat = vibration.reshape(len(vibration), -1)
    straight = np.nan_to_num(fit_lines(flat, SLIPS[1:])[2]).reshape(vibration.shape[1:])
    return Tried(settings, straight, rms(vibration - printed_lines(FIVE[1:])[:, None]))


def rms(values: Floats) -> Floats:
    """Root mean square over the slips."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def left_out(misfit: Floats) -> float:
    """Misfit (g) on each soil of the variant that is best on the other three."""
    soils = range(misfit.shape[1])
    best = [np.argmin(np.mean(np.delete(misfit, k, axis=1) ** 2, axis=1)) for k in soils]
    return float(np.sqrt(np.mean([misfit[b, k] ** 2 for b, k in zip(best, soils, strict=True)])))


def fall_of_the_hub() -> Tried:
    """Delta a = f (k_S / M) i l sin(pi/n) tan(pi/n): what the hub falls while its foot slides.

    f is the share of the slipped distance that is slid in one event. A line through zero for any f.
    """
    leg, shares = SpringLeg(stiffness=4000.0), np.linspace(0.02, 1.0, 50)
    angle = np.pi / float(leg.legs)
    fall = shares * FIVE[1:] * float(leg.length) * np.sin(angle) * np.tan(angle)
    vibration = float(leg.stiffness) / float(leg.hub_mass) * fall[..., None] / GRAVITY
    misfit = rms(vibration - printed_lines(FIVE[1:])[:, None])
    return Tried({"share": shares}, np.ones_like(misfit), misfit)


def mechanisms() -> dict[str, float]:
    """Print what each mechanism reaches; the best straight one that softens over 3 cm."""
    rows: list[tuple[str, ...]] = []
    chosen: dict[str, float] = {}
    for name, options in MECHANISMS.items():
        found = tried(options)
        lines = found.straight.min(axis=1) >= STRAIGHT
        whole = np.sqrt(np.mean(found.misfit**2, axis=1))
        rows.append(line_of(name, found, whole, lines))
        if "softening" in options:
            allowed = lines & (found.settings["softening"] == SOFTENING)
            best = int(np.argmin(np.where(allowed, whole, np.inf)))
            chosen = {key: float(values[best]) for key, values in found.settings.items()}
    fall = fall_of_the_hub()
    whole = np.sqrt(np.mean(fall.misfit**2, axis=1))
    rows.append(line_of(DROP_OF_LEG, fall, whole, np.ones(len(whole), bool)))
    printed = printed_lines(FIVE[1:])
    mean = rms(printed - printed.mean(axis=1, keepdims=True))
    other = (printed.sum(axis=1, keepdims=True) - printed) / 3.0
    apart = np.sqrt(np.mean(rms(printed - other) ** 2))
    rows.append(("one line for all soils", "", "", "", f"{np.sqrt(np.mean(mean**2)):.2f}",
                 f"{apart:.2f}"))  # fmt: skip
    print(f"Mechanisms at 0.3 rad/s, {len(STIFFNESSES) * len(DROPS)} legs for each of their sizes\n"
          f"straight: R2 of slip on vibration {STRAIGHT} or more on all four soils; misfit to the\n"
          "printed lines in g, best of all, and on a soil that was left out\n")  # fmt: skip
    head = ("mechanism", "variants", "straight", "median R2", "best misfit", "left out")
    print(format_table(head, rows), end="\n\n")
    return chosen


def line_of(name: str, found: Tried, whole: Floats, lines: NDArray[np.bool_]) -> tuple[str, ...]:
    """A line of the table."""
    return (
        name, f"{len(found.misfit)}", f"{lines.mean():.0%}", f"{np.median(found.straight):.2f}",
        f"{whole.min():.2f}", f"{left_out(found.misfit):.2f}",
    )  # fmt: skip


def planes() -> None:
    """Print the fit of table V to the 63 legs and soils, with a drop at once and a gradual one."""
    stiffness, drop = (v.ravel() for v in np.meshgrid(chapter.STIFFNESSES, chapter.DROPS))
    rows = []
    for name, softening in (("at once", 0.0), (f"over {100 * SOFTENING:g} cm", SOFTENING)):
        leg = SpringLeg(stiffness=stiffness, softening=softening)
        vibration = vibration_amplitude(leg, FIVE[1:], chapter.FRICTION, drop)
        fit = fit_vibration_slip(vibration, SLIPS[1:], drop, stiffness, True)
        good = [f"{fit.goodness[part]:.2f}" for part in ("slip", "intercept", "slope")]
        rows.append((name, *good, f"{fit.law.a_mu:.2f}", f"{fit.law.b_mu:.3f}"))
    rows.append(("as printed", "", "0.98", "0.96", "6.609", "-0.156"))
    print("Planes of table V, fitted to 63 legs and soils\n")
    head = (
        "friction drops",
        "R2 of slip",
        "R2 intercept",
        "R2 slope",
        "a_mu 1/g",
        "b_mu 1/(g deg)",
    )
    print(format_table(head, rows), end="\n\n")


def slopes(chosen: dict[str, float]) -> None:
    """Print growth of vibration with slip by soil: the part that no mechanism has."""
    rows = []
    for name, vibration in (
        ("printed", printed_lines(FIVE[1:])),
        (f"drop over {100 * chosen['softening']:g} cm", simulated(chosen, FIVE[1:])),
    ):
        slope = np.polyfit(SLIPS[1:], vibration, 1)[0]
        rows.append((name, *(f"{s:.2f}" for s in slope), f"{slope.max() / slope.min():.1f}"))
    print("Growth of vibration by slip, g\n")
    print(format_table(("", *NAMES, "largest / smallest"), rows), end="\n\n")


def informed() -> None:
    """Print what linear files know of slip in the regime of the paper, by law of the recipe."""
    text = packaged_file("wheel_leg_paper", "datagen", "recipes").read_text()
    spring = 'law = "spring"\nstiffness = [6000.0, 8000.0]\ndrop = [0.2, 0.3]\nturning = 0.3'
    laws = {
        "the printed line": 'law = "line"',
        "spring, drop at once": spring,
        f"spring, drop over {100 * SOFTENING:g} cm": f"{spring}\nsoftening = {SOFTENING}",
    }
    rows = []
    with tempfile.TemporaryDirectory() as name:
        recipe, data = Path(name) / "recipe.toml", Path(name) / "data.parquet"
        for law, table in laws.items():
            recipe.write_text(text.replace('[stick_slip]\nlaw = "line"', f"[stick_slip]\n{table}"))
            generate(read_recipe(recipe).sized(ROWS, seed=1), data)
            found = [law]
            for sensor in ("torque", "vibration"):
                spec = read_spec(f"slip_{sensor}")
                score = train(spec, read_dataset(data, spec.features, spec.targets)).scores
                best = score["estimator"]
                found.append(f"{best.relative[0]:.2f}")
                found.append(f"{best.cover90[0]:.0%}")
            rows.append(tuple(found))
    print(f"Slip on unknown soil in the regime of the paper: linear files of {ROWS} rows, RMSE /\n"
          "prior std, and what the 90 % interval covers\n")  # fmt: skip
    print(format_table(("vibration by", "torque", "covers", "vibration", "covers"), rows))


def draw(chosen: dict[str, float]) -> None:
    """Printed lines, and both springs on each soil."""
    figure, axes = plt.subplots(1, 4, figsize=(13, 3.8), sharey=True, constrained_layout=True)
    figure.suptitle(
        "Vibration of the hub against slip at 0.3 rad/s: printed lines, and two springs"
    )
    slip = np.linspace(0.0, 0.5, 26)[:, None]
    sudden = {key: value for key, value in chosen.items() if key != "softening"}
    at_once, gradual = simulated(sudden, slip), simulated(chosen, slip)  # (slips, soils)
    for k, (name, colour) in enumerate(zip(NAMES, COLOURS, strict=True)):
        axes[k].plot(slip, printed_lines(slip)[:, k], "k--", lw=1, label="printed line")
        axes[k].plot(slip, at_once[:, k], "-", color="0.6", lw=1, label="friction drops at once")
        label = f"over {100 * chosen['softening']:g} cm of sliding"
        axes[k].plot(slip, gradual[:, k], ".-", color=colour, lw=1, label=label)
        axes[k].set(title=name, xlabel="slip", ylim=(0.0, 1.6))
        axes[k].legend(fontsize=7, loc="upper left")
    axes[0].set_ylabel("vibration of the hub, g")
    OUT.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT, dpi=110)
    print(f"\npicture: {OUT}")


def run() -> None:
    """Print and draw."""
    chosen = mechanisms()
    told = ", ".join(f"{key} {value:g}" for key, value in chosen.items())
    print(f"Best straight variant of a drop over {100 * SOFTENING:g} cm: {told}\n")
    planes()
    slopes(chosen)
    informed()
    draw(chosen)


if __name__ == "__main__":
    run()
