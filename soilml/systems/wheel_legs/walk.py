"""Walking wheel-legs, many cases at once, by implicit steps; metrics of a turn, and their table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import product

import numpy as np

from soilml.arrays import Array, Real
from soilml.errors import InputError
from soilml.report.column_figure import column_picture
from soilml.report.report import Picture
from soilml.systems.wheel_legs.resistive_force import (
    LinearGround,
    WalkingLegs,
    WheelLeg,
    wheel_leg,
)

GRAVITY = 9.81
TOLERANCE = 1e-6  # A step has converged when the forces balance to this fraction of the weight
MAX_NEWTON_STEPS = 25
#: Largest change of velocity by a Newton update, as a fraction of the speed of the leg's end: the
#: force is a function of the direction of motion and nearly singular at rest.
MAX_UPDATE = 0.3
#: How often a step that does not converge is halved, and a step with an abrupt change of velocity.
MAX_BISECTIONS, MAX_ABRUPT_BISECTIONS = 16, 5
#: Change of the vertical velocity that counts as abrupt (a fall or an impact), as a fraction of the
#: speed of the leg's end.
ABRUPT_CHANGE = 0.2
HALVINGS = 40  # Bisection steps for the height of the hub at the start


class WalkStatus(IntEnum):
    """Status of a case of a batch."""

    OK = 0
    NO_CONTACT = 1
    SUNK = 2
    NOT_CONVERGED = 3

    @property
    def reason(self) -> str:
        """Description of the status."""
        return (
            "ok",
            "no walk: no leg ever reaches the ground; they are shorter than the body's clearance",
            "stopped: the ground is too soft, the hub reaches its surface",
            "stopped: no motion of the hub satisfies the force balance",
        )[self]


@dataclass(frozen=True)
class Walk:
    """Motion of the hub: arrays (instants, cases), SI; NaN after a case has stopped."""

    time: Array  # s
    angle: Array  # rad, rotation since the start, (instants,)
    x: Array  # m
    z: Array  # m, height of the hub above the free surface
    vx: Array  # m/s
    vz: Array  # m/s
    torque: Array  # N m
    status: Array  # codes of WalkStatus, (cases,)
    length: Array  # m, of the leg, (cases,)
    legs: Array  # (cases,)
    speed: Array  # rad/s, (cases,)

    @property
    def attack(self) -> Array:
        """beta_W, rad: attack angle of the leg closest to vertical (eq. 9)."""
        return nearest_attack(self.angle[:, None], self.legs)

    @property
    def sinkage(self) -> Array:
        """z_W, m: depth of that leg's end (eq. 10); 0 above the ground."""
        return np.maximum(self.length * np.sin(self.attack) - self.z, 0.0)

    @property
    def slip(self) -> Array:
        r"""i_W: slip of the hub relative to rolling over a fixed foot.

        .. math:: i_W = 1 - v_x / (\omega \, l_L \sin\beta_W)

        Reference: eq. 11, in which the cosine must be a sine (at midstance the cosine is zero) and
        the time step is missing. Without contact there is no propulsion, and the slip is 1.
        """
        rolling = self.speed * self.length * np.sin(self.attack)
        in_contact = (self.sinkage > 0.0) & (rolling > 0.0)
        slip = 1.0 - self.vx / np.where(in_contact, rolling, 1.0)
        return np.where(in_contact | np.isnan(self.vx), slip, 1.0)

    def at_midstance(self, values: Array) -> Array:
        """Mean over the midstances of values at every instant, (instants, cases) -> (cases,)."""
        step = self.angle[1] - self.angle[0]
        midstance = np.abs(self.attack - 0.5 * np.pi) <= 0.5001 * step
        return np.sum(np.where(midstance, values, 0.0), axis=0) / np.sum(midstance, axis=0)

    def after(self, angle: float) -> Walk:
        """The part of the walk after the wheel has turned by `angle`, rad."""
        late = self.angle >= angle - 1e-9
        parts = ("time", "angle", "x", "z", "vx", "vz", "torque")
        return replace(self, **{name: getattr(self, name)[late] for name in parts})


def nearest_attack(angle: Array | float, legs: Array) -> Array:
    """Attack angle, rad, of the leg closest to vertical; pi/2 where it points straight down.

    `angle`: rotation of the wheel since a leg pointed straight down, rad.
    """
    pitch = 2.0 * np.pi / legs
    return 0.5 * np.pi + angle - pitch * np.round(angle / pitch)


def walk(
    wheel_legs: Sequence[WheelLeg] | WheelLeg,
    grounds: Sequence[LinearGround] | LinearGround,
    *,
    slip: Real | None = None,
    turns: float = 2.0,
    steps: int = 1000,
) -> Walk:
    r"""Simulate the walk of every case from rest, with a leg pointing straight down (eqs. 7, 8).

    .. math:: M \dot v = F(v, z, \omega t) - M g

    solved for the hub's velocity at the end of each step (implicit): the ground reaction depends on
    the direction of motion and not on its speed, so that the equation is stiff.

    Parameters
    ----------
    wheel_legs, grounds
        One, or one for each case; one is used for all cases.
    slip
        Commanded slip, a number or one for each case; NaN or None where the wheel rolls freely.
    turns
        Duration in turns of the wheel.
    steps
        Steps per turn, such as 1000.

    Returns
    -------
    Walk
        Cases that fail have a `status` other than `WalkStatus.OK`; the others are not affected.

    Raises
    ------
    InputError
        For numbers of cases that do not match, and slips beyond 1.

    References
    ----------
    Comin and Saaj 2017, eqs. 7 and 8.

    Examples
    --------
    >>> from soilml.systems.wheel_legs import LinearGround, gait_metrics, wheel_leg
    >>> ground = LinearGround(stiffness=0.7e6)
    >>> result = walk(wheel_leg("LTF"), ground, slip=0.25, turns=1.0, steps=200)
    >>> metrics = gait_metrics(result)
    >>> [round(float(metrics[name][0]), 2) for name in ("slip_mean", "sinkage_mean_m")]
    [0.25, 0.06]
    """
    wheels = [wheel_legs] if isinstance(wheel_legs, WheelLeg) else list(wheel_legs)
    under = [grounds] if isinstance(grounds, LinearGround) else list(grounds)
    slips = np.atleast_1d(np.asarray(np.nan if slip is None else slip, float))
    cases = max(len(wheels), len(under), slips.size)
    if {len(wheels), len(under), slips.size} - {1, cases} or np.any(np.abs(slips) > 1.0):
        raise InputError(
            f"{len(wheels)} wheel-legs, {len(under)} grounds and {slips.size} slips for {cases} "
            "cases: give one, or one for each case, with slips from -1 to 1"
        )
    wheels, under = wheels * (cases // len(wheels)), under * (cases // len(under))
    legs = WalkingLegs.of(wheels, under, np.broadcast_to(slips, (cases,)))
    count = round(turns * steps) + 1
    status, (x, z, vx, vz, torque) = _simulated(legs, count, 2.0 * np.pi / steps)
    angle = 2.0 * np.pi / steps * np.arange(count)
    length = np.array([w.leg.length for w in wheels])
    time = angle[:, None] / legs.speed
    return Walk(time, angle, x, z, vx, vz, torque, status, length, legs.legs, legs.speed)


def _simulated(legs: WalkingLegs, count: int, step: float) -> tuple[Array, Array]:
    """Status, (cases,), and x, z, vx, vz, torque at `count` instants, (5, instants, cases).

    The values of a case that stops are NaN from then on.
    """
    cases = legs.mass.size
    status, touched = np.full(cases, int(WalkStatus.OK)), np.zeros(cases, bool)
    history = np.full((5, count, cases), np.nan)
    active, hub = np.arange(cases), _start(legs)
    history[:, 0] = *hub, 0.0 * hub[0]
    for i in range(1, count):
        hub, forces, balanced = implicit_step(legs, hub, (i - 1) * step, i * step)
        if not np.all(touched[active]):
            low = (legs.at(i * step)[1] + hub[1] < 0.0) & (legs.area > 0.0)
            touched[active] |= np.any(low & (legs.turns > 0.0), axis=0)
        status[active[~balanced]] = WalkStatus.NOT_CONVERGED
        status[active[balanced & (hub[1] <= 0.0)]] = WalkStatus.SUNK
        kept = balanced & (hub[1] > 0.0)
        history[:, i, active[kept]] = np.vstack([hub, forces[2:]])[:, kept]
        if not np.all(kept):
            active, legs, hub = active[kept], legs.select(kept), hub[:, kept]
            if not active.size:
                break
    status[(status == WalkStatus.OK) & ~touched] = WalkStatus.NO_CONTACT
    return status, history


def _start(legs: WalkingLegs) -> Array:
    """Hubs (x, z, vx, vz), (4, cases), at rest where the ground carries them pushed down."""
    pose, still = legs.at(0.0), np.zeros(legs.mass.size)
    high = np.where(legs.area > 0.0, -pose[1], -np.inf).max(axis=0)
    low, pressed = still, replace(legs, speed=still)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        carries = pressed.reaction(pose, middle, still, still - 1.0)[0][1] > legs.mass * GRAVITY
        low, high = np.where(carries, middle, low), np.where(carries, high, middle)
    return np.stack([still, low, still, still])


def implicit_step(
    legs: WalkingLegs, hub: Array, start: float, stop: float, depth: int = 0
) -> tuple[Array, Array, Array]:
    r"""Advance hubs (x, z, vx, vz) from one wheel angle to another by an implicit Euler step.

    .. math:: M (v' - v) / dt = F(v', z + v'_z dt) - M g

    is solved by a damped Newton method in both velocities. Cases that do not converge, or whose
    velocity changes abruptly, take the step in two halves, recursively (`depth`). A case with a
    commanded slip has its horizontal velocity prescribed.

    Returns hubs (4, cases), forces (3, cases) at the end, and whether they balance there, (cases,).
    """
    end, forces, converged = _newton(legs, hub, start, stop)
    abrupt = np.abs(end[3] - hub[3]) > ABRUPT_CHANGE * legs.tip_speed
    repeated = np.flatnonzero(~converged | (abrupt & (depth < MAX_ABRUPT_BISECTIONS)))
    if repeated.size and depth < MAX_BISECTIONS:
        middle, some = 0.5 * (start + stop), legs.select(repeated)
        halfway, _, first = implicit_step(some, hub[:, repeated], start, middle, depth + 1)
        converged[repeated] = False
        later = repeated[first]
        if later.size:
            kept = np.flatnonzero(first)
            end[:, later], forces[:, later], converged[later] = implicit_step(
                some.select(kept), halfway[:, kept], middle, stop, depth + 1
            )
    return end, forces, converged


def _newton(legs: WalkingLegs, hub: Array, start: float, stop: float) -> tuple[Array, Array, Array]:
    """Newton's method for the velocities at the end of one step."""
    pose, dt = legs.at(stop), (stop - start) / legs.speed
    commanded = ~np.isnan(legs.slip)
    weight, inertia = legs.mass * GRAVITY, legs.mass / dt

    def imbalance(v: Array) -> tuple[Array, Array, Array, Array]:
        """Residual forces (x, z), N, their norm over the weight, forces and rates."""
        forces, rates = legs.reaction(pose, hub[1] + v[1] * dt, v[0], v[1])
        residual = inertia * (v - hub[2:]) - forces[:2]
        residual[0] = np.where(commanded, 0.0, residual[0])
        residual[1] += weight
        return residual, np.hypot(*residual) / weight, forces, rates

    # eq. 11: horizontal velocity at the commanded slip
    target = (1.0 - legs.slip) * legs.tip_speed * np.sin(nearest_attack(stop, legs.legs))
    v = np.stack([np.where(commanded, target, hub[2]), hub[3]])
    residual, norm, forces, rates = imbalance(v)
    for _ in range(MAX_NEWTON_STEPS):
        if np.all(norm < TOLERANCE):
            break
        # the Jacobian of the residual, with the rate by height in the column of vz
        xx, xz = inertia - rates[0, 0], -rates[0, 1] - rates[0, 2] * dt
        zx, zz = -rates[1, 0], inertia - rates[1, 1] - rates[1, 2] * dt
        xx, xz, zx = (np.where(commanded, a, b) for a, b in ((1, xx), (0, xz), (0, zx)))
        rx, rz = residual
        update = np.stack([xz * rz - zz * rx, zx * rx - xx * rz]) / (xx * zz - xz * zx)
        length = np.maximum(np.hypot(*update), 1e-300)
        share = np.minimum(1.0, MAX_UPDATE * legs.tip_speed / length)
        share = np.where(norm < TOLERANCE, 0.0, share)
        v = v + share * update
        residual, norm, forces, rates = imbalance(v)
    return np.concatenate([hub[:2] + v * dt, v]), forces, norm < TOLERANCE


TURN = 2.0 * np.pi
MOST = 400  # Walks at once
SWEPT = 3  # Values of a quantity from which on a picture has it along its axis
#: Columns that a picture may have along its axis, and those of each of its panels.
ALONG = ("stiffness_N_m3", "legs", "slip_commanded")
PANELS = (("slip_mean", "slip_rms"), ("sinkage_mean_m", "sinkage_largest_m"), ("torque_mean_Nm",))


def gait_metrics(walked: Walk) -> dict[str, Array]:
    """Metrics of the last full turn of every case by column, (cases,); NaN where one has stopped.

    Mean, root mean square and largest values of slip and sinkage (m), the mean of the motor torque
    (N m), and the sinkage at midstance. Raises `InputError` for a walk shorter than a turn.
    """
    if walked.angle[-1] < TURN - 1e-9:
        raise InputError(
            f"a walk of {walked.angle[-1] / TURN:.2g} turns; one full turn or more is needed"
        )
    last = walked.after(float(walked.angle[-1]) - TURN)
    sinkage, slip = last.sinkage, last.slip
    return {
        "slip_mean": slip.mean(axis=0),
        "slip_rms": np.sqrt(np.mean(slip**2, axis=0)),
        "sinkage_mean_m": sinkage.mean(axis=0),
        "sinkage_rms_m": np.sqrt(np.mean(sinkage**2, axis=0)),
        "sinkage_largest_m": sinkage.max(axis=0),
        "sinkage_midstance_m": last.at_midstance(sinkage),
        "torque_mean_Nm": last.torque.mean(axis=0),
    }


def walk_table(
    feet: Sequence[str],
    legs: Sequence[int],
    grounds: Mapping[str, LinearGround],
    slips: Sequence[float],
    turns: float = 2.0,
) -> dict[str, Array]:
    """Walk with every combination of foot, legs, ground and commanded slip (NaN: free).

    `grounds` are by name; one that is named by its stiffness has no other name. Returns columns
    with a row for each walk: what was asked for, `gait_metrics`, and its status. Raises
    `InputError` for an unknown foot, an invalid wheel-leg, and too many walks.
    """
    cases = list(product(feet, legs, grounds, slips))
    if len(cases) > MOST:
        raise InputError(f"{len(cases)} walks; at most {MOST} are possible at once")
    foot, count, under, slip = (np.asarray(part) for part in zip(*cases, strict=True))
    stiffness = np.asarray([grounds[name].stiffness for name in under])
    walked = walk(
        [wheel_leg(foot, legs=count) for foot, count, _, _ in cases],
        [grounds[name] for name in under],
        slip=slip.astype(float),
        turns=turns,
    )
    named = under != np.asarray([f"{value:g}" for value in stiffness])
    return {
        "foot": foot,
        "legs": count,
        "ground": np.where(named, under, ""),
        "stiffness_N_m3": stiffness,
        "slip_commanded": slip.astype(float),
        **gait_metrics(walked),
        "status": np.asarray([WalkStatus(int(code)).reason for code in walked.status]),
    }


def walk_picture(columns: Mapping[str, Array]) -> Picture:
    """Metrics of walks against the first of stiffness, legs and slip that has three values or more.

    Raises `InputError` where none has.
    """
    soil = "ground" if np.any(columns["ground"] != "") else "stiffness_N_m3"
    sizes = {
        name: np.unique(columns[name]).size for name in ("foot", "legs", soil, "slip_commanded")
    }
    swept = [name for name in ALONG if sizes.get(name, 0) >= SWEPT]
    if not swept:
        raise InputError(
            f"{len(columns['foot'])} walks; a picture needs three or more values of legs, "
            "stiffness or slip"
        )
    lines = tuple(name for name, size in sizes.items() if size > 1 and name != swept[0])
    return column_picture(columns, swept[0], PANELS, lines)
