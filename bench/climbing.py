"""Coverage of bands of climbing ability over simulated rovers whose soil is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from runner import Bench, Row, Sample, rms, table

from soilml.numerics.quantiles import QUANTILES
from soilml.quantities import SHEAR
from soilml.systems.rim_stress import (
    Rover,
    SimulatedRover,
    StressBySlip,
    climbing_ability,
    identify_ground,
)
from soilml.systems.rim_stress.simulation import StressArc

#: Slip at which the pull is compared; slope (rad) that a random rover must at least climb.
SLIP, MIN_STEEPEST = 0.4, 0.2
#: Seeds of rovers that were not used to tune the method; slopes, and what is known.
SEEDS = range(1000, 1060)
LINES = (
    ("0, 4", ("cohesion", "friction_angle")),
    ("0, 4, 8, 10", ("cohesion",)),
)
SYMBOLS = {"cohesion": "c", "friction_angle": "phi", "shear_modulus": "k_x"}
ABOUT = (
    f"{len(SEEDS)} simulated rovers per line on known ground, each slope driven four times: "
    "coverage of the 90 % band, and rms of error over reported standard deviation (1 is "
    "calibrated). Pull at slip 0.4."
)


def cases(sample: Sample) -> list[Row]:
    """Each rover of each line."""
    return [
        {"slopes": slopes, "fixed": fixed, "seed": seed}
        | {"estimated": ", ".join(short for n, short in SYMBOLS.items() if n not in fixed)}
        for slopes, fixed in LINES
        for seed in sample.of(SEEDS, 2)
    ]


def one_rover(case: Row) -> list[Row]:
    """Errors of the prediction for a random rover, beside what it reports."""
    slopes = np.deg2rad([float(s) for s in case["slopes"].split(",")]).tolist()
    return predicted(case["seed"], slopes, case["fixed"])


def predicted(seed: int, slopes: Sequence[float], fixed: Sequence[str]) -> list[Row]:
    """Simulate a random rover on `slopes` (rad), predict, and compare with its truth.

    fixed: Parameters of the soil that are known.

    A row for each parameter that is not fixed, for `pull` (N, at slip 0.4 on level ground) and
    `steepest` (rad): error, reported standard deviation, share of samples below the truth.
    """
    rng = np.random.default_rng(seed)
    true = random_rover(rng)
    climbs = true.simulate_climbs(rng, slopes)
    front, rear = true.simulate_artificial_slip(rng)
    shear = dict(zip(SHEAR, true.shear, strict=True))
    ground = identify_ground(
        true.rover,
        climbs,
        fixed={name: shear[name] for name in fixed},
        noise=true.noise,
        seed=seed,
    )
    ability = climbing_ability(
        ground,
        StressBySlip.fit([*(c.front for c in climbs), *front]),
        StressBySlip.fit([*(c.rear for c in climbs), *rear]),
        seed=seed,
    )
    slips, pulls, steeps = true.curve
    i = int(np.argmin(np.abs(ability.slip - SLIP)))
    compared = {
        name: (ground.samples[:, SHEAR.index(name)], shear[name]) for name in ground.fit.names
    }
    compared["pull"] = ability.pull[:, i], float(np.interp(ability.slip[i], slips, pulls))
    compared["steepest"] = ability.steepest, float(steeps[slips <= ability.slip[-1]].max())
    return [
        {
            "of": name,
            "error": float(samples.mean() - truth),
            "std": float(samples.std()),
            "below": float(np.mean(samples < truth)),
        }
        for name, (samples, truth) in compared.items()
    ]


def inside(rows: Sequence[Row]) -> float:
    """Fraction of rovers whose true value lies in the 90 % interval."""
    return float(np.mean([QUANTILES[0] < row["below"] < QUANTILES[-1] for row in rows]))


def score(rows: Sequence[Row]) -> float:
    """Root mean square of error over std: 1 if the std is calibrated."""
    return float(rms([row["error"] / row["std"] for row in rows]))


def random_rover(rng: np.random.Generator) -> SimulatedRover:
    """A rover with random soil, stresses and centre of mass that climbs 11 degrees or more."""

    def arc(entry: float) -> StressArc:
        return StressArc(
            entry=entry + rng.uniform(-0.02, 0.02),
            shift=rng.uniform(0.20, 0.34),
            shift_exponent=rng.uniform(1.2, 2.2),
            width=rng.uniform(0.48, 0.56),
            rear_exponent=rng.uniform(1.1, 1.7),
            front_exponent=rng.uniform(0.8, 1.1),
        )

    while True:
        rover = Rover(
            mass=12.0,
            radius=0.055,
            width=0.064,
            front_share=rng.uniform(0.42, 0.58),
            height_ratio=rng.uniform(0.2, 0.5),
        )
        shear = 0.0, float(rng.uniform(0.6, 0.73)), float(rng.uniform(0.005, 0.010))
        candidate = SimulatedRover(rover=rover, shear=shear, arcs=(arc(0.33), arc(0.31)))
        if candidate.steepest > MIN_STEEPEST:
            return candidate


def tables(rows: list[Row]) -> str:
    """A line for each choice of slopes and unknowns."""

    def cell(name: str):  # type: ignore[no-untyped-def]
        def text(own: list[Row]) -> str:
            part = [row for row in own if row["of"] == name]
            return f"{100 * inside(part):.0f} %, {score(part):.2f}" if part else ""

        return text

    of = {"phi": "friction_angle", "k_x": "shear_modulus", "pull": "pull", "steepest": "steepest"}
    columns = {title: cell(name) for title, name in of.items()}
    columns["steepest, rms error, deg"] = lambda own: (
        f"{np.degrees(rms([r['error'] for r in own if r['of'] == 'steepest'])):.2f}"
    )
    by = {"slopes, deg": "slopes", "estimated": "estimated"}
    return table(rows, by, columns)


CLIMBING = Bench("climbing", "Bands of climbing ability", ABOUT, cases, one_rover, tables)
