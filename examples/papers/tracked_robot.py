"""A robot on tracks: plateaus, what grousers add, and soil from eight groups of pulls.

Run from the repository root: python examples/papers/tracked_robot.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import linregress

from soilml import Case, Model, identify, simulate, soil
from soilml.config.measurement_noise import Noise
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.papers.published import printed
from soilml.papers.wang2018 import LEVEL, implied_points, plateau
from soilml.systems.tracked_robot.robot import (
    BEYOND_PEAK,
    GROUSERS,
    WANG2018,
    DiscreteGrousers,
    grouser_pull,
)

GAINS = {"sand": 20.0, "clay": 150.0}  # Printed gains by grousers, N
#: Bounds at which the paper's groups end: 20 and 40 degrees, 0.05 m, 0.9 and 1.2 kPa; the others
#: are our choice.
PRIOR = {
    "n": Prior(0.5, 1.5),
    "friction_angle": Prior(np.deg2rad(20.0), np.deg2rad(40.0)),
    "kphi": Prior(5e5, 3e6, log=True),
    "shear_modulus": Prior(0.01, 0.05),
    "cohesion": Prior(900.0, 1200.0),
}
UNITS = {"kphi": 1e-3, "cohesion": 1e-3}
GROUPS = 8


def main() -> None:
    """Print the findings."""
    sensitivity_to_assumptions()
    grouser_gains()
    eight_groups()


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


def grouser_gains() -> None:
    """What grousers add with f_g = tan(phi), and the f_g that gives the printed gain."""
    print("\nGain by grousers in N: the effect track-grousers, discrete ones, and the f_g in need")
    print("soil  printed  effect  discrete, f_g = tan phi  f_g of the printed gain  tan phi")
    for ground, target in GAINS.items():
        known, bare = soil(f"wang2018/{ground}"), plateau(ground, grousers=False)
        tangent = float(np.tan(known.friction_angle))

        def gain(friction: float, known=known, ground=ground, bare=bare) -> float:
            lugs = DiscreteGrousers(
                pitch=0.05, tip=0.01, friction=friction, yielding=3.0 * float(known.shear_modulus)
            )
            pulls = [
                grouser_pull(WANG2018, known, float(s), lugs, BEYOND_PEAK[ground]).mean()
                for s in LEVEL
            ]
            return float(np.mean(pulls)) - bare

        own, more = gain(tangent), gain(tangent + 0.2)
        needed = tangent + 0.2 * (target - own) / (more - own)
        effect = plateau(ground, grousers=True) - bare
        print(
            f"{ground}  {target:7.0f}  {effect:6.0f}  {own:23.0f}  {needed:23.2f}  {tangent:7.2f}"
        )


def eight_groups() -> None:
    """Simulate eight groups of pulls on the paper's sand with measurement noise, and fit them."""
    noise = {"drawbar_pull_N": Noise(constant=10.0, share=0.05)}
    case = Case(Model(WANG2018.track), soil("wang2018/sand"), PRIOR, noise)
    slips = np.linspace(0.05, 0.85, 10)
    tables = [simulate(case, slips, WANG2018.load, seed=2018 + k) for k in range(GROUPS)]
    groups = [identify(case, table, method="nonlinear") for table in tables]
    names = ("slip", "load_N", "drawbar_pull_N")
    rows = {name: np.concatenate([table[name] for table in tables]) for name in names}
    pooled = identify(case, Table(rows), method="nonlinear")
    left = {
        name: float(np.mean([fit.remaining_fraction[name] for fit in groups])) for name in PRIOR
    }
    mean = np.mean([fit.values for fit in groups], axis=0)
    print("\nEight groups of ten pulls each, 5 % and 10 N noise, one load, five unknowns")
    print("parameter       true     mean  prior std  prior remaining, a group  all rows")
    for name, value in zip(groups[0].names, mean, strict=True):
        scale = UNITS.get(name, 1.0)
        true = float(getattr(case.soil, name))
        print(
            f"{name:14s} {scale * true:7.4g}  {scale * value:7.4g}  "
            f"{scale * PRIOR[name].std:9.2g}  {left[name]:22.0%}  "
            f"{pooled.remaining_fraction[name]:8.0%}"
        )
    weak = [name for name, share in left.items() if share > 0.5]
    print(f"hardly identified or not identified: {', '.join(weak)}")
    fresh = simulate(case, np.linspace(0.04, 0.9, 18), WANG2018.load, seed=7)
    average = case.with_values(dict(zip(groups[0].names, mean.tolist(), strict=True)))
    predicted = simulate(average, fresh["slip"], fresh["load_N"])["drawbar_pull_N"]
    regression_of_fresh_rows(predicted, fresh["drawbar_pull_N"])


def regression_of_fresh_rows(predicted: np.ndarray, measured: np.ndarray) -> None:
    """Regression of new measurements on the predictions of the groups' average."""
    line, count = linregress(predicted, measured), len(measured)
    r2 = line.rvalue**2
    book = printed("wang2018")
    n = implied_points(book["regression_r2"], book["regression_f"])
    print("\nMeasured against predicted, fresh rows      r2       F   slope  points")
    print(
        f"here                                    {r2:6.3f}  {r2 / (1 - r2) * (count - 2):6.1f}"
        f"  {line.slope:6.2f}  {count:6d}"
    )
    print(
        f"printed (points follow from r2 and F)   {book['regression_r2']:6.3f}  "
        f"{book['regression_f']:6.1f}  {book['regression_slope']:6.2f}  {n:6.1f}"
    )


if __name__ == "__main__":
    main()
