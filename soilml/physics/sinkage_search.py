"""Search for the smallest sinkage at which the soil carries the load, row by row of a batch.

Most rows are solved from an estimate on few points (`_solve_from_coarse`), the others by secant
steps in log sinkage inside a bracket (`_solve_by_secant`), where the load carried rises all the
way. It need not under a braking wheel or with effects: where a few coarse evaluations leave doubt,
or the secant steps fail, the row is scanned for its first crossing (`_solve_by_scan`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from soilml.arrays import Array, namespace
from soilml.numerics.root_finding import first_bracket, rising_root
from soilml.physics.contact import Force, vertical_load
from soilml.physics.forces import forces_at_sinkage, load_at_sinkage, stresses_at_sinkage
from soilml.physics.load_case import LoadCase, coarse, merge_rows, rows
from soilml.physics.sinkage_estimate import (
    INITIAL_MARGIN,
    SinkageEstimate,
    coarse_estimate,
    forces_near,
)
from soilml.row_status import Status

#: Stages of an effect that depend on the sinkage; the others act before or after the search.
STAGES_AT_SINKAGE = ("on_contact", "on_stress", "on_force")
#: A row is too heavy without a scan where the load still rises from this fraction of the largest
#: sinkage.
BELOW_LARGEST = 0.99
#: A row has converged where the soil carries the load to this relative accuracy.
LOAD_TOLERANCE = 1e-7
#: The search begins at this fraction of the largest sinkage: light wheels on firm soil sink little.
SMALLEST_FRACTION = 1e-14
#: Loads below this fraction of the one to be carried count as this fraction, so that the log of
#: their ratio stays finite where the soil carries nothing or pulls the gear down.
SMALLEST_RATIO = 1e-3

#: Shear that pulls the gear down by less than this fraction of the load cannot hide an earlier
#: equilibrium.
NEGLIGIBLE_DOWNWARD_SHEAR = 0.2
#: Where it pulls by more, the load is evaluated at this many smaller sinkages ...
CHECKED_SINKAGES = 12
#: ... up to this fraction of the one found: just below that, every row nearly carries the load.
LARGEST_CHECKED_FRACTION = 0.9
#: A row is scanned where one of them carries this fraction of the load: coarse integration, and
#: gaps between the points, may hide the rest.
NEARLY_CARRIED = 0.95
#: A row is scanned too where the load carried rises with less than this power of sinkage at the
#: equilibrium found: a peak may be close. A rigid wheel without shear has n + 1/2.
SMALLEST_POWER = 0.4

#: Sinkages of the scan, as cubes of an even grid from 0 to the largest sinkage: small sinkages are
#: resolved more finely.
SCAN_POINTS, SCAN_EXPONENT = 32, 3.0
#: Each refinement divides the two intervals about a peak into this many.
REFINEMENTS, REFINED_INTERVALS = 2, 16
#: Width in log sinkage of the bracket below the peak of a row that has no equilibrium.
PEAK_BRACKET = 1e-3

#: Forces of all rows, and which of them are solved.
Search = Callable[[LoadCase], tuple[Force, Array]]


def first_equilibrium(load_case: LoadCase) -> Force:
    """Forces at the smallest sinkage that carries the load; rows without one by their status."""
    searches = [_solve_from_coarse, _solve_by_secant, _solve_by_scan]
    if load_rises_with_sinkage(load_case):
        searches.insert(1, _too_heavy)
    return _solve_in_turn(load_case, searches)


def _solve_in_turn(load_case: LoadCase, searches: Sequence[Search]) -> Force:
    """The forces by the first search, and by the next ones in rows that it leaves unsolved."""
    xp = namespace(load_case.at.load)
    force, solved = searches[0](load_case)
    if len(searches) == 1 or bool(xp.all(solved)):
        return force
    unsolved = rows(load_case, xp.nonzero(~solved)[0])
    return merge_rows(force, solved, _solve_in_turn(unsolved, searches[1:]))


def equilibrium_near(load_case: LoadCase, estimate: SinkageEstimate) -> Force:
    """Forces at the equilibrium next to an estimate of the sinkage; arrays (batch,).

    They agree with those of the ordinary search to about 1e-7, to 1e-6 from an estimate that is
    `rough`, and to 1e-4 from one that is `nearest` alone. Rows that secant steps do not solve, or
    that may have an earlier equilibrium, are solved by that search; those of an estimate with
    `nearest` are marked by their status instead.
    """
    xp = namespace(estimate.slope)
    force, slope = forces_near(load_case, estimate)
    if estimate.nearest:
        return force
    solved = (force.status == 0) & ~earlier_equilibrium_possible(load_case, force, slope)
    unsolved = xp.nonzero(~solved)[0]
    if not unsolved.shape[0]:
        return force
    return merge_rows(force, solved, first_equilibrium(rows(load_case, unsolved)))


def load_rises_with_sinkage(load_case: LoadCase) -> bool:
    """Whether the load that the soil carries rises with sinkage, up to one peak, in all rows.

    The shear under a driving wheel lifts it everywhere in front of the axle. Under a braking wheel
    shear pulls down, and so it does behind the axle of a driving one, which an effect may bring
    into contact. A peak is possible close to the hub of a linear wheel only, where n is small and
    the maximum stress far forward.
    """
    xp, effects = namespace(load_case.at.slip), load_case.effects
    others = [effect for effect in effects if not effect.load_rises]
    if any(effect.overrides(stage) for effect in others for stage in STAGES_AT_SINKAGE):
        return False
    return not bool(xp.any(load_case.at.slip < 0))


def _too_heavy(load_case: LoadCase) -> tuple[Force, Array]:
    """Forces at the largest sinkage, and which rows are too heavy there and below."""
    xp = namespace(load_case.at.load)
    largest = xp.log(load_case.gear.largest_sinkage() + 0.0 * load_case.at.load)
    force = forces_at_sinkage(load_case, xp.exp(largest))  # to the bit as the scan has it
    below = load_at_sinkage(load_case, BELOW_LARGEST * xp.exp(largest))
    heavy = (below < force.load) & (force.load < load_case.at.load) & (force.status == 0)
    status = xp.where(heavy, 0 * force.status + int(Status.TOO_HEAVY), force.status)
    return replace(force, status=status), heavy


def _solve_from_coarse(load_case: LoadCase) -> tuple[Force, Array]:
    """Forces at the root next to that of a few points, and which rows need no further search."""
    force, slope = forces_near(load_case, coarse_estimate(load_case))
    solved = force.status == 0
    if not bool(namespace(slope).any(solved)):
        return force, solved
    return force, solved & ~earlier_equilibrium_possible(load_case, force, slope)


def _solve_by_secant(load_case: LoadCase) -> tuple[Force, Array]:
    """Forces at the root that secant steps reach, and which rows need no further search."""
    xp = namespace(load_case.at.load)
    soil, at, gear = load_case.soil, load_case.at, load_case.gear
    largest = xp.log(gear.largest_sinkage() + 0.0 * at.load)
    initial = xp.log(gear.initial_sinkage(soil, at))
    initial = xp.where(initial < largest - INITIAL_MARGIN, initial, largest - INITIAL_MARGIN)
    power = soil.n + 0.5 + 0.0 * at.load  # of a rigid wheel, load against sinkage
    smallest = largest + math.log(SMALLEST_FRACTION)
    force, balanced, slope = _root_between(load_case, smallest, largest, initial, power)
    if not bool(xp.any(balanced)):
        return force, balanced
    return force, balanced & ~earlier_equilibrium_possible(load_case, force, slope)


def earlier_equilibrium_possible(load_case: LoadCase, force: Force, slope: Array) -> Array:
    """Rows that may carry the load at a smaller sinkage already, judged by coarse evaluations.

    Without shear that pulls the gear down the load would be reached earlier, though hardly so where
    that pull is small.
    """
    xp = namespace(slope)
    if load_rises_with_sinkage(load_case):
        return xp.zeros_like(slope, dtype=xp.bool)
    few, sinkage = coarse(load_case), xp.astype(force.sinkage, xp.float32)
    in_doubt = _load_may_fall_with_sinkage(few, sinkage)
    index = xp.nonzero(in_doubt)[0]
    if index.shape[0] == 0:
        return slope < SMALLEST_POWER
    largest_load = _largest_load_below(few, sinkage, index)
    # back to all rows: row i in doubt is number (rows in doubt up to i) - 1 of `largest_load`;
    # a zero is appended for the case that nothing is in doubt
    number = xp.clip(xp.cumulative_sum(xp.astype(in_doubt, xp.int64)) - 1, 0, None)
    largest_load = xp.astype(largest_load, slope.dtype)
    padded = xp.concat([largest_load, xp.zeros_like(slope[:1])])
    nearly_carried = xp.take(padded, number) > NEARLY_CARRIED * load_case.at.load
    return (slope < SMALLEST_POWER) | (in_doubt & nearly_carried)


def _load_may_fall_with_sinkage(load_case: LoadCase, sinkage: Array) -> Array:
    """Rows of a coarse load case in which shear or an effect may make it fall with sinkage."""
    xp, effects = namespace(sinkage), load_case.effects
    if any(effect.overrides("on_stress") and not effect.load_rises for effect in effects):
        return xp.ones_like(sinkage, dtype=xp.bool)
    _, stresses = stresses_at_sinkage(load_case, sinkage)
    lift = stresses.shear * stresses.contact.frontal_area
    downward_shear = xp.sum(xp.maximum(-lift, xp.zeros_like(lift)), axis=0)
    in_doubt = downward_shear > NEGLIGIBLE_DOWNWARD_SHEAR * load_case.at.load
    if any(effect.overrides("on_force") for effect in effects):
        load = forces_at_sinkage(load_case, sinkage).load
        in_doubt = in_doubt | (load != vertical_load(stresses))
    return in_doubt


def _largest_load_below(load_case: LoadCase, sinkage: Array, index: Array) -> Array:
    """Largest load that the rows `index` of a coarse load case carry at smaller sinkages."""
    xp = namespace(sinkage)
    fractions = [
        LARGEST_CHECKED_FRACTION * ((i + 1) / CHECKED_SINKAGES) ** 2
        for i in range(CHECKED_SINKAGES)
    ]
    smaller = xp.concat([sinkage[index] * fraction for fraction in fractions], axis=0)
    repeated = rows(load_case, xp.concat([index] * CHECKED_SINKAGES, axis=0))
    load = load_at_sinkage(repeated, smaller)
    return xp.max(xp.reshape(load, (CHECKED_SINKAGES, index.shape[0])), axis=0)


def _solve_by_scan(load_case: LoadCase) -> tuple[Force, Array]:
    """Rows that secant steps do not solve, or where they may miss the first equilibrium.

    The load carried may rise to a peak and fall again: the gear comes to rest where it first
    reaches the load. The scan finds the first interval in which it does so, and refines twice about
    the peak that may hide an earlier one between two points.
    """
    xp = namespace(load_case.at.load)
    largest = xp.log(load_case.gear.largest_sinkage() + 0.0 * load_case.at.load)
    log_ratio = _log_load_ratio(load_case)
    steps = [SCAN_EXPONENT * math.log((i + 1) / SCAN_POINTS) for i in range(SCAN_POINTS)]
    grid = xp.stack([largest + step for step in [math.log(SMALLEST_FRACTION), *steps]], axis=0)
    low, high, exists, peak = first_bracket(log_ratio, grid)
    for _ in range(REFINEMENTS):
        grid = _refined_about(grid, peak)
        low_near, high_near, near, peak = first_bracket(log_ratio, grid)
        earlier = near & (~exists | (low_near < high))
        low, high = xp.where(earlier, low_near, low), xp.where(earlier, high_near, high)
        exists = exists | near
    top = xp.take_along_axis(grid, peak[None, :], axis=0)[0, :]
    low, high = xp.where(exists, low, top - PEAK_BRACKET), xp.where(exists, high, top)
    force, balanced, _ = _root_between(load_case, low, high, 0.5 * (low + high), 1.0 / (high - low))
    return _with_reasons(load_case, force, exists, balanced, top), balanced


def _refined_about(grid: Array, peak: Array) -> Array:
    """A finer grid between the neighbours of the point with index `peak` of each row."""
    xp = namespace(grid)
    last = grid.shape[0] - 1
    left = xp.take_along_axis(grid, xp.clip(peak - 1, 0, last)[None, :], axis=0)[0, :]
    right = xp.take_along_axis(grid, xp.clip(peak + 1, 0, last)[None, :], axis=0)[0, :]
    points = range(REFINED_INTERVALS + 1)
    return xp.stack([left + (right - left) * i / REFINED_INTERVALS for i in points], axis=0)


def _with_reasons(
    load_case: LoadCase, force: Force, exists: Array, balanced: Array, top: Array
) -> Force:
    """The forces with the status of every row, and the load at the peak where it is too heavy."""
    xp = namespace(force.load)
    largest_load = forces_at_sinkage(load_case, xp.exp(top)).load
    ok = 0 * force.status
    unsolved = xp.where(exists, int(Status.NOT_CONVERGED) + ok, int(Status.TOO_HEAVY) + ok)
    status = xp.where(force.status != 0, force.status, xp.where(balanced, ok, unsolved))
    return replace(force, status=status, load=xp.where(exists | balanced, force.load, largest_load))


def _root_between(
    load_case: LoadCase, low: Array, high: Array, initial: Array, slope: Array
) -> tuple[Force, Array, Array]:
    """Forces at the root between two logs of sinkage, which rows balance, and the slope there."""
    xp = namespace(initial)
    root = rising_root(_log_load_ratio(load_case), low, high, initial, slope)
    force = forces_at_sinkage(load_case, xp.exp(root.x))
    balanced = xp.abs(force.load / load_case.at.load - 1.0) < LOAD_TOLERANCE
    return force, root.converged & balanced & (root.slope > 0), root.slope


def _log_load_ratio(load_case: LoadCase) -> Callable[[Array], Array]:
    """Log of load carried over load, by log of sinkage: nearly straight, and zero at the root."""
    xp = namespace(load_case.at.load)

    def log_ratio(log_sinkage: Array) -> Array:
        ratio = load_at_sinkage(load_case, xp.exp(log_sinkage)) / load_case.at.load
        return xp.log(xp.maximum(ratio, xp.full_like(ratio, SMALLEST_RATIO)))

    return log_ratio
