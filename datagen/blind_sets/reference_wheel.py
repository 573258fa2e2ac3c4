"""A rigid wheel in soil, with mechanisms acting on it: the reference model of blind sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar, final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
State = TypeVar("State")

NODES = 40
#: Depths among which the first that carries the load is searched, and bisections between two.
SEARCH_DEPTHS, HALVINGS = 40, 46


@dataclass(frozen=True, kw_only=True)
class WheelState:
    """Wheel, soil and operating point of a batch; every field is an array (n,), in SI."""

    slip: Floats
    load: Floats  # N
    radius: Floats  # m
    width: Floats  # m
    cohesion: Floats  # Pa
    friction_angle: Floats  # rad
    shear_modulus: Floats  # m
    kc: Floats  # N/m^(n+1)
    kphi: Floats  # N/m^(n+2)
    n: Floats
    a0: Floats
    a1: Floats
    unit_weight: Floats  # N/m^3
    speed: Floats  # m/s
    pass_number: Floats
    slip_angle: Floats  # rad
    #: share of the campaign that is over, 0 at its first run and 1 at its last
    elapsed: Floats = field(default_factory=lambda: np.zeros(1))

    @staticmethod
    def on_soil(
        soil: Mapping[str, float], slip: Floats, load: Floats, radius: float, width: float
    ) -> WheelState:
        """One wheel on one soil at these slips and loads (N), first pass, straight ahead."""
        fixed = {"radius": radius, "width": width, "speed": 0.05, "pass_number": 1.0}
        values = dict(soil) | fixed | {"slip_angle": 0.0}
        rows = {name: np.full(slip.shape, value) for name, value in values.items()}
        return WheelState(slip=slip, load=load, **rows)

    @property
    def travel_ratio(self) -> Floats:
        """Distance travelled over distance rolled, v / (r omega), (n,).

        Slip is s = 1 - v / (r omega) when driving and s = r omega / v - 1 when braking.
        """
        with np.errstate(divide="ignore"):
            return np.where(self.slip < 0.0, 1.0 / (1.0 + self.slip), 1.0 - self.slip)


@dataclass(frozen=True)
class ContactArc:
    """The part of the rim that touches the soil; arrays (n,), angles from straight down, rad."""

    entry: Floats
    exit: Floats
    peak: Floats
    sinkage: Floats  # m
    radius: Floats  # m, of the circle in contact with the soil
    shear_radius: Floats  # m
    lever: Floats  # m


@dataclass(frozen=True)
class ContactPoints:
    """Stresses (Pa) at points of the arc; arrays (points, n)."""

    theta: Floats  # rad
    travel: Floats  # m, that the shearing rim has turned through since the entry
    depth: Floats  # m, that sets the pressure
    shear_displacement: Floats  # m, shear displacement
    normal: Floats
    strength: Floats  # c + sigma tan(phi)
    shear: Floats


@dataclass(frozen=True)
class SoilReaction:
    """Load carried and drawbar pull (N), torque (N m), sinkage (m), entry angle (rad); (n,) each.

    NaN where the soil does not carry the load at any sinkage down to the hub.
    """

    load: Floats
    pull: Floats
    torque: Floats
    sinkage: Floats
    entry: Floats


@final
@dataclass(frozen=True)
class Mechanism:
    """A mechanism: its name, its size with a reference value and unit, and what it does.

    acts: Function by stage, in the order in which they run. Each takes the value of its stage, the
        states that the value belongs to, and last the size. `driven`: from reported to true slip
        and load. `soil`: the soil under this wheel. `arc`: the rim in the soil. `shape`: normal
        stress, the way from either end of the contact (0) to its largest stress (1), and that
        largest stress; (points, n) but the last, (n,). `pressure`: normal stress and its depth,
        (points, n). `shear`: the points of the contact. `force`: within the search for
        equilibrium. `reading`: from the forces at equilibrium to the readings, for the true slip
        and load.
    form: Names a law that differs from that of the analyst's effect of the same name.
    needs: The covariate, a field of `WheelState`, that must vary for it to have an effect.
    """

    name: str
    size: str
    reference: float
    unit: str
    acts: dict[str, Callable[..., Any]]
    form: str = ""
    needs: str = ""

    @property
    def key(self) -> str:
        """Name and form: slip-sinkage, slip-sinkage/lyasko."""
        return f"{self.name}/{self.form}" if self.form else self.name


#: Tier -> mechanism by its key. A: textbook form, soil, wheel and rig; B: alternative form; C: in
#: no catalogue of the analyst; S: sensors; L: another law of the soil; T: a soil that changes.
MECHANISMS: dict[str, dict[str, Mechanism]] = {tier: {} for tier in "ABCSLT"}
Act = TypeVar("Act", bound=Callable[..., Any])


def mechanism(
    tier: str, name: str, size: str, reference: float, unit: str, stage: str, **more: str
) -> Callable[[Act], Act]:
    """Declare what a mechanism of a tier does at one stage; `more` are its form and its needs."""

    def declared(act: Act) -> Act:
        own = Mechanism(name, size, reference, unit, {}, **more)
        MECHANISMS[tier].setdefault(own.key, own).acts[stage] = act
        return act

    return declared


#: Mechanisms that act together, each with its size.
ActiveMechanisms = tuple[tuple[Mechanism, float], ...]


#: Gauss-Legendre nodes and weights on 0 to 1 in t, with x = t^2: dense where stress begins.
_X, _W = np.polynomial.legendre.leggauss(NODES)
_T = 0.5 * (_X + 1.0)
NODE, WEIGHT = (_T * _T)[:, None], (_W * _T)[:, None]
#: Of the points of both halves of a contact, the way from its end to the largest stress.
WAY = np.concatenate([NODE, NODE])


def solve_equilibrium(rows: WheelState, active: ActiveMechanisms = ()) -> SoilReaction:
    """Noise-free readings of a wheel in vertical equilibrium; arrays (n,), SI.

    The equilibrium is the smallest sinkage at which the soil carries the load, searched from the
    surface to the hub and refined by bisection. NaN where there is none. Source: Wong and Reece,
    J. Terramechanics 4(1), 1967, for the wheel; mechanisms have their own.
    """
    rows = _changed(rows, "driven", active)
    rows = _changed(rows, "soil", active)
    return _changed(_equilibrium(rows, active), "reading", active, rows)


def _changed(value: State, stage: str, active: ActiveMechanisms, *of: Any) -> State:
    """The value of a stage after all mechanisms that act there; `of` are the states it is of."""
    for mechanism, size in active:
        if act := mechanism.acts.get(stage):
            value = act(value, *of, size)
    return value


def ground_reaction(
    depth_angle: Floats, rows: WheelState, active: ActiveMechanisms = ()
) -> SoilReaction:
    r"""Forces at a fixed sinkage, for any load; arrays (n,).

    .. math::
        z = r (1 - \cos x), \quad
        \sigma = (k_c / b + k_\varphi) \delta^n, \quad
        \tau = \pm (c + \sigma \tan\varphi) (1 - e^{-|j| / K}), \quad
        j = r [\theta_1 - \theta - u (\sin\theta_1 - \sin\theta)]

    x is `depth_angle`, the entry angle (rad) of a rim that does not deform; the depth delta is
    mirrored behind the angle of maximum stress; u is the travel ratio, 1 - s when driving and
    1 / (1 + s) when braking; tau has the sign of j, so that all forces are continuous in slip.
    Source: Wong and Reece 1967, parts 1 and 2.
    """
    arc = ContactArc(
        entry=depth_angle,
        exit=np.zeros_like(depth_angle),
        peak=(rows.a0 + rows.a1 * rows.slip) * depth_angle,
        sinkage=2.0 * rows.radius * np.sin(0.5 * depth_angle) ** 2,
        radius=rows.radius,
        shear_radius=rows.radius,
        lever=rows.radius,
    )
    arc = _changed(arc, "arc", active, rows)
    front, rear = arc.entry - arc.peak, arc.peak - arc.exit
    swept_angle = np.concatenate([NODE * front, front + (1.0 - NODE) * rear])
    mapped = np.concatenate([NODE * front, NODE * front])
    span = np.concatenate([WEIGHT * front, WEIGHT * rear])
    theta = arc.entry - swept_angle
    points = _points(theta, swept_angle, mapped, arc, rows, active)
    area = arc.radius * rows.width * span
    sin, cos = np.sin(theta), np.cos(theta)
    reaction = SoilReaction(
        load=np.sum((points.normal * cos + points.shear * sin) * area, axis=0),
        pull=np.sum((points.shear * cos - points.normal * sin) * area, axis=0),
        torque=np.sum(points.shear * arc.lever * area, axis=0),
        sinkage=arc.sinkage,
        entry=arc.entry,
    )
    reaction = _changed(reaction, "force", active, rows)
    inside = (arc.exit < arc.peak) & (arc.peak < arc.entry)
    return replace(reaction, load=np.where(inside, reaction.load, np.nan))


def _points(
    theta: Floats,
    swept_angle: Floats,
    mapped: Floats,
    arc: ContactArc,
    rows: WheelState,
    active: ActiveMechanisms,
) -> ContactPoints:
    depth = _cosine_difference(arc.entry - mapped, mapped, arc.entry) * arc.radius
    modulus = rows.kc / rows.width + rows.kphi
    normal = modulus * depth**rows.n
    for mechanism, size in active:
        if shape := mechanism.acts.get("shape"):
            front = arc.entry - arc.peak
            deepest = _cosine_difference(arc.peak, front, arc.entry) * arc.radius
            normal = shape(normal, WAY, modulus * deepest**rows.n, rows, size)
        if pressure := mechanism.acts.get("pressure"):
            normal = pressure(normal, depth, rows, size)
    strength = rows.cohesion + normal * np.tan(rows.friction_angle)
    sine_difference = 2.0 * np.cos(0.5 * (arc.entry + theta)) * np.sin(0.5 * swept_angle)
    shear_displacement = arc.shear_radius * (swept_angle - rows.travel_ratio * sine_difference)
    mobilised = -np.expm1(-np.abs(shear_displacement) / rows.shear_modulus)
    shear = strength * np.copysign(mobilised, shear_displacement)
    travel = arc.shear_radius * swept_angle
    points = ContactPoints(theta, travel, depth, shear_displacement, normal, strength, shear)
    for mechanism, size in active:
        if sheared := mechanism.acts.get("shear"):
            points = replace(points, shear=sheared(points, rows, size))
    return points


def _cosine_difference(theta: Floats, angle_from_entry: Floats, entry: Floats) -> Floats:
    """cos(theta) - cos(theta_1), as a product that keeps its digits."""
    return np.asarray(2.0 * np.sin(0.5 * (entry + theta)) * np.sin(0.5 * angle_from_entry))


def _equilibrium(rows: WheelState, active: ActiveMechanisms) -> SoilReaction:
    """Forces at the smallest sinkage at which the soil carries the load."""
    with np.errstate(all="ignore"):
        depths = 0.5 * np.pi * (np.arange(1, SEARCH_DEPTHS + 1) / SEARCH_DEPTHS) ** 1.5
        loads = [ground_reaction(np.full_like(rows.load, x), rows, active).load for x in depths]
        carries_load = np.stack(loads) >= rows.load
        first = np.argmax(carries_load, axis=0)
        high = depths[first]
        low = np.where(first > 0, depths[np.maximum(first - 1, 0)], 0.0)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            enough = ground_reaction(middle, rows, active).load >= rows.load
            low, high = np.where(enough, low, middle), np.where(enough, middle, high)
        reaction = ground_reaction(0.5 * (low + high), rows, active)
    ok = carries_load.any(axis=0) & (np.abs(reaction.load / rows.load - 1.0) < 1e-8)
    return SoilReaction(**{name: np.where(ok, v, np.nan) for name, v in vars(reaction).items()})
