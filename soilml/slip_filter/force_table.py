"""Pull and torque of the wheels of a rover on many soils, tabulated over slip and load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import select_free
from soilml.fitting.mixtures import without_faults
from soilml.fitting.operating_points import wheel_gears, wheel_passes
from soilml.traction.draws import SoilDraws
from soilml.traction.soil_draws import mixed_prior_draws, prior_draws

#: Slips of the table: close where forces rise steeply.
SLIP = np.asarray([
    -0.6, -0.4, -0.25, -0.15, -0.09, -0.05, -0.025, -0.01, 0.0, 0.01, 0.025, 0.045, 0.07, 0.1, 0.14,
    0.19, 0.25, 0.32, 0.4, 0.5, 0.62, 0.76, 0.9,
])  # fmt: skip
SOILS, FLOORS = 4096, 256  # Draws of the prior's soils, and of hard floors
LOAD_RATIO = 1.5  # Most ratio of two loads beside each other
#: Hard floors: friction, slip at which 63 % of it acts, and rolling resistance over the load.
FLOOR = ((0.3, 0.9), (0.01, 0.04), (0.0, 0.04))
LEAST_CARRIED = 0.5  # Share of the prior's soils that must carry the wheels


@dataclass(frozen=True)
class ForceTable:
    r"""Forces of k wheels over n grounds: soils of the prior, then hard floors.

    A floor has friction, and no sinkage:

    .. math:: T = r W \mu (1 - e^{-|s| / s_0}) \operatorname{sign} s, \quad DP = T / r - f W
    """

    names: tuple[str, ...]  # Of the p soil parameters
    values: Floats  # Soils (q, p), SI units; floors, the n - q last grounds, have none
    slip: Floats  # (m,)
    load: Floats  # (l,), N, rising
    pull: Floats  # Over the load, (kinds, l, n, m)
    torque: Floats  # Over load and radius, (kinds, l, n, m)
    kind: NDArray[np.int64]  # Which of the kinds of wheels each wheel is, (k,)
    radius: Floats  # Of each wheel (k,), m
    wheels: tuple[str, ...]  # Their names

    @property
    def floor(self) -> NDArray[np.bool_]:
        """Which grounds are hard floors, (n,)."""
        return np.arange(self.pull.shape[2]) >= len(self.values)


def force_table(
    case: Case, loads: tuple[float, float], count: int = SOILS, soils: SoilDraws | None = None
) -> ForceTable:
    """Solve the equations of a case's rover for draws of its prior.

    case: With a rover. Effects of rig and sensors are left out.
    loads: Lightest and heaviest load of a wheel, N.
    count: Number of soils.
    soils: Draws in place of those of the prior.

    Raises `InputError` where there is no prior, or most of its soils do not carry the wheels.
    """
    rover = case.rover
    if rover is None:
        raise InputError("the model file has no [rover]; soilml drive slip needs mass and wheels")
    if case.explanations and soils is None:
        case, soils = mixed_prior_draws(case, count)
    draws = soils or prior_draws(select_free(case, None), count, case)
    steps = int(np.ceil(np.log(loads[1] / loads[0]) / np.log(LOAD_RATIO))) + 1
    load = np.geomspace(loads[0] * 0.999, loads[1] * 1.001, max(steps, 2))
    gears, passes = wheel_gears(case), wheel_passes(case)
    if "multipass" not in _effects(case):  # no other effect knows the pass
        passes = dict.fromkeys(passes, 1)
    kinds = list(dict.fromkeys((gears[name], passes[name]) for name in rover.wheels))
    found, radius = [], {}
    for gear, number in kinds:
        own = without_faults(case.of_gear(gear) if gear else case)
        radius[gear] = float(own.model.gear.radius)
        wide = np.broadcast_to(load[:, None], (len(load), len(draws.values)))
        force = draws.on_grid(own, wide, SLIP, gear, pass_number=float(number), slip_angle=0.0)
        found.append((force.drawbar_pull, force.torque / radius[gear]))
    pull, torque = (np.stack(each) / load[:, None, None] for each in zip(*found, strict=True))
    carried = np.isfinite(pull).all(axis=(0, 1, 3)) & np.isfinite(torque).all(axis=(0, 1, 3))
    if carried.mean() < LEAST_CARRIED:
        raise InputError(
            f"{1 - carried.mean():.0%} of the soils of [soil.prior] do not carry wheels of "
            f"{loads[0]:.3g} to {loads[1]:.3g} N; check [rover], kphi and n"
        )
    floor = _floors(pull[:, :, :1].shape)
    return ForceTable(
        draws.names,
        draws.values[carried],
        SLIP,
        load,
        np.concatenate([pull[:, :, carried], floor[0]], axis=2),
        np.concatenate([torque[:, :, carried], floor[1]], axis=2),
        np.asarray([kinds.index((gears[n], passes[n])) for n in rover.wheels]),
        np.asarray([radius[gears[n]] for n in rover.wheels]),
        tuple(rover.wheels),
    )


def _effects(case: Case) -> set[str]:
    models = (case.model, *case.gears.values())
    return {effect.name for model in models for effect in model.effects}


def _floors(shape: tuple[int, ...]) -> tuple[Floats, Floats]:
    """Pull and torque of hard floors, (kinds, l, FLOORS, m), with values drawn in `FLOOR`."""
    rng = np.random.default_rng(0)
    friction, slip, rolling = (rng.uniform(*ends, (FLOORS, 1)) for ends in FLOOR)
    torque = friction * -np.expm1(-np.abs(SLIP) / slip) * np.sign(SLIP)
    whole = (*shape[:2], FLOORS, len(SLIP))
    return np.broadcast_to(torque - rolling, whole), np.broadcast_to(torque, whole)
