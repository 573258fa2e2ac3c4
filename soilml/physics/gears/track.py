"""The flexible track on two end wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

import numpy as np

from soilml.arrays import Array, Real, namespace, to_numpy
from soilml.errors import InputError
from soilml.numerics.quadrature import crowded_ends, crowded_start, gauss
from soilml.parameters import Parameter
from soilml.physics.contact import Contact
from soilml.physics.gears.rigid_wheel import NO_DEPTH
from soilml.physics.gears.track_geometry import (
    FRONT,
    MIDDLE,
    REAR,
    Belt,
    gone,
    held,
    raised,
    sprung,
    stretch,
    top,
)
from soilml.physics.operating_point import Operating
from soilml.physics.soils.soil import Soil

#: Nodes of the arc that enters the soil, of the middle arc, and of each short stretch; their
#: accuracy is tested against dense quadrature.
ENTRY_NODES, MIDDLE_NODES, SHORT_NODES = 16, 16, 8
#: Enough for a few per cent, to see whether the load was nearly reached.
ROUGH_NODES = 4


@final
@dataclass(frozen=True, kw_only=True)
class Track:
    r"""One track unit: a belt around two end wheels, an arc that bulges upwards between them.

    .. math::
        \theta_{12} = A_{12} \theta_{11}, \quad \theta_{21} = \theta_{12} + 2 \psi, \quad
        \theta_{22} = A_{22} \theta_{21}, \quad L \sin\psi = z_2 - z_1 = R_{1f} z_1

        R_t = \frac{L - 2 r \sin m}{2 \sin m}, \quad m = \theta_{12} + \psi, \qquad
        dj = [1 - (1 - i) \cos\alpha] ds

    with alpha the inclination of the belt. The soil is loaded along k z^n under the front wheel as
    far as z_1, springs back and is loaded again along k_u (`belt.sprung`), and follows k z^n again
    where the rear wheel presses it deeper. Where the belt rises so far that no pressure is left it
    does not touch, and there is no shear either (`belt.held`). Load and forces are those of one
    track. References: Wang, Yan and Du, J. Terramechanics 77, 2018, eqs. 1-9; Okello, Watany and
    Crolla, J. agric. Engng Res. 69, 1998. The trim angle comes from the balance of displacements,
    so that the centre of mass and the hitch are those which that trim needs; tensions at the joints
    are inner forces, and the middle arc's tension is the one that its pressure and radius ask for
    (`soilml.systems.tracked_robot.track_balance`). While it brakes, shear turns at places that the
    nodes do not know: forces are then good to some parts in a thousand, at worst in a hundred, and
    where shear is many times the load, sinkage need not rise from one load to the next. Not for
    belts stiff in bending, road wheels between the end wheels, or turning.
    """

    name: ClassVar[str] = "track"
    radius: Annotated[Real, Parameter("m", 0.005, 5.0, "r, radius of an end wheel with the belt")]
    width: Annotated[Real, Parameter("m", 0.002, 5.0, "b, width of the belt")]
    base: Annotated[Real, Parameter("m", 0.011, 20.0, "L, distance between the axles")]
    leaving: Annotated[
        Real, Parameter("1", 0.001, 0.5, "A_12, angle at which the belt leaves / entry angle")
    ] = 0.1
    rear_leaving: Annotated[
        Real, Parameter("1", 0.0, 1.0, "A_22, exit angle of the rear wheel / its entry angle")
    ] = 1.0
    settling: Annotated[
        Real, Parameter("1", 0.0, 0.5, "R_1f, further sinkage of the rear wheel / sinkage")
    ] = 0.2
    rebound: Annotated[
        Real, Parameter("1", 0.01, 1.0, "rho, share of sinkage sprung back; k_u = k z^(n-1) / rho")
    ] = 0.5

    def __post_init__(self) -> None:
        room = to_numpy(self.base) - 2.0 * to_numpy(self.radius)
        if np.any(room <= 0.0):
            raise InputError(
                f"base is {float(np.min(to_numpy(self.base))):g} m with wheels of radius "
                f"{float(np.max(to_numpy(self.radius))):g} m; it must be above twice the radius, "
                "or the wheels touch"
            )

    def deepest(self) -> Real:
        """The hub of the rear wheel stands at the free surface, m."""
        return self.radius / (1.0 + self.settling)

    def guess(self, soil: Soil, at: Operating) -> Array:
        r"""Sinkage of a belt that lies flat, or of a front wheel that carries half, m.

        .. math::
            z = \min\left\{\left[\frac{W}{k b L}\right]^{1/n},
            \left[\frac{3 W / 2}{(3 - n) k b \sqrt{2 r}}\right]^{2 / (2 n + 1)}\right\}

        References: Bekker 1969; the second is Wang et al. 2018, eq. 2.
        """
        xp = namespace(at.load)
        modulus = soil.kc + self.width * soil.kphi + 0.0 * at.load
        room = xp.maximum(3.0 - soil.n, xp.full_like(3.0 - soil.n, 0.5))
        flat = (at.load / (modulus * self.base)) ** (1.0 / soil.n)
        wheel = 1.5 * at.load / (room * modulus * xp.sqrt(2.0 * self.radius + 0.0 * at.load))
        return xp.minimum(flat, wheel ** (2.0 / (2.0 * soil.n + 1.0)))

    def shape(self, sinkage: Array, soil: Soil, at: Operating) -> Belt:
        """The line of the belt whose front wheel has sunk this deep (m)."""
        xp = namespace(sinkage)
        entry = 2.0 * xp.asin(xp.sqrt(sinkage / (2.0 * self.radius)))
        leave = self.leaving * entry
        trim = xp.asin(self.settling * sinkage / self.base)
        meet = leave + 2.0 * trim
        sin_mean = xp.sin(leave + trim)
        return Belt(
            entry=entry,
            leave=leave,
            meet=meet,
            exit=self.rear_leaving * meet,
            trim=trim,
            sinkage=sinkage,
            rear=sinkage * (1.0 + self.settling),
            arc_radius=0.5 * self.base / sin_mean - self.radius,
            radius=self.radius,
            width=self.width,
            rebound=self.rebound,
            n=soil.n,
        )

    def flaw(self, shape: Belt) -> Array:
        """0: a belt of possible dimensions has a line at any sinkage down to the hub."""
        xp = namespace(shape.entry)
        return xp.zeros_like(shape.entry, dtype=xp.int64)

    def contact(self, shape: Belt, at: Operating) -> Contact:
        """The points along the belt where it touches."""
        return _touching(shape, at, ENTRY_NODES, MIDDLE_NODES, SHORT_NODES)

    def rough(self, shape: Belt, at: Operating) -> Contact:
        """Few points."""
        return _touching(shape, at, ROUGH_NODES, ROUGH_NODES, ROUGH_NODES)

    def stations(self, shape: Belt, at: Operating, points: int) -> tuple[Array, Contact]:
        """Evenly spaced along the belt, from entry to exit, with their inclinations.

        They stand for no area; where the belt does not touch they have neither depth nor shear.
        """
        xp = namespace(shape.entry)
        share = xp.linspace(0.0, 1.0, points, dtype=shape.entry.dtype)[:, None]
        joints = [
            gone(shape, arc, a)[0] for arc, a in ((FRONT, -shape.leave), (MIDDLE, shape.meet))
        ]
        way = share * gone(shape, REAR, -shape.exit)[0]
        parts = (
            (FRONT, shape.entry - way / shape.radius),
            (MIDDLE, (way - joints[0]) / shape.arc_radius - shape.leave),
            (REAR, shape.meet - (way - joints[1]) / shape.radius),
        )

        def joined(front: Array, middle: Array, rear: Array) -> Array:
            return xp.where(way < joints[0], front, xp.where(way < joints[1], middle, rear))

        inclination = joined(*(a for _, a in parts))
        depth = shape.sinkage - joined(*(raised(shape, arc, a) for arc, a in parts))
        behind = (way >= joints[1]) & (inclination < 0.0)
        before = (way < joints[0]) & (inclination >= 0.0)
        deepest = xp.where(behind, shape.rear + 0.0 * way, shape.sinkage + 0.0 * way)
        virgin, risen = before | (depth > deepest), deepest - depth
        pressed = xp.where(virgin, depth, sprung(shape, deepest, risen))
        sheared = joined(*(a - (1.0 - at.slip) * b for a, b in (gone(shape, *p) for p in parts)))
        sheared = xp.where(virgin, sheared, sheared * held(shape, deepest, risen))
        none = xp.zeros_like(way)
        return inclination, Contact(
            depth=xp.maximum(pressed, none + NO_DEPTH),
            sheared=sheared,
            rolled=way,
            area=none,
            up=none,
            ahead=none,
            lever=shape.radius,
            width=shape.width,
        )


def _touching(belt: Belt, at: Operating, entry: int, middle: int, short: int) -> Contact:
    """Eight stretches that end where the soil is unloaded, loaded again, let go or met anew."""
    xp = namespace(belt.entry)
    zero = xp.zeros_like(belt.entry)
    first, second = belt.sinkage, belt.rear
    further = second - first
    # inclinations at which pressure vanishes, and at which soil is loaded as never before
    let_go = xp.minimum(_at_height(belt.rebound * first, belt.radius), belt.leave)
    lost = _at_height(top(belt) - belt.rebound * first, belt.arc_radius)
    off, on = xp.minimum(lost, belt.leave), xp.minimum(lost, belt.meet)
    anew = xp.maximum(xp.minimum(_at_height(top(belt), belt.arc_radius), belt.meet), on)
    met = xp.minimum(_at_height(further + belt.rebound * first, belt.radius), belt.meet)
    pressed = xp.minimum(_at_height(further, belt.radius), met)
    out = xp.minimum(_at_height(belt.rebound * second, belt.radius), belt.exit)
    stretches = (
        (FRONT, (belt.entry, zero), None, crowded_start(entry)),
        (FRONT, (zero, -let_go), first, gauss(short)),
        (MIDDLE, (-belt.leave, -off), first, crowded_ends(middle)),
        (MIDDLE, (on, anew), first, crowded_ends(middle)),
        (MIDDLE, (anew, belt.meet), None, gauss(short)),
        (REAR, (met, pressed), first, gauss(short)),
        (REAR, (pressed, zero), None, gauss(short)),
        (REAR, (zero, -out), second, gauss(short)),
    )
    parts = [stretch(belt, at, *each) for each in stretches]
    along = ("depth", "sheared", "rolled", "area", "up", "ahead")
    joined = {name: xp.concat([getattr(p, name) for p in parts], axis=0) for name in along}
    return Contact(**joined, lever=belt.radius, width=belt.width)


def _at_height(height: Array, radius: Real) -> Array:
    """Inclination (rad) of an arc where it is this far from its level point; 0 where it is not."""
    xp = namespace(height)
    square = xp.clip(height / (2.0 * radius), 1e-30, 0.99)
    return 2.0 * xp.asin(xp.sqrt(square))
