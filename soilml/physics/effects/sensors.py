"""Faults of the sensors: gains and offsets of torque, drawbar pull, sinkage, load and slip.

Channels are changed at the stage `on_reading`, slip and load at `on_operating`, where the true
ones follow from those reported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, TypeVar, dataclass_transform

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.physics.effects.base import Effect, effect
from soilml.physics.load_case import LoadCase
from soilml.physics.operating_point import MOST_SLIP, Operating

E = TypeVar("E", bound=Effect)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def _linear_error(
    name: str, size: float, calibration: float, signs: dict[str, int], isolate: str
) -> Callable[[type[E]], type[E]]:
    """Declare a gain or an offset of a sensor: an error of first order."""
    of, form = name.split("-")
    sensor = "load cell" if of == "load" else f"{of} sensor"
    return effect(
        name,
        text=f"the {sensor}'s {'scale' if form == 'gain' else 'zero'} is off",
        source="linear sensor error",
        kind="sensor",
        reference={form: size},
        signs=signs,
        isolate=isolate,
        calibration=calibration,
    )


def signed_by_travel(value: Real, load_case: LoadCase) -> Array:
    """`value` (...), with its sign turned around in rows whose travel speed is below zero.

    Torque and drawbar pull are counted positive along the travel. A sensor that is bolted to the
    rig does not turn around with it: in reverse its reading changes sign before it is tabled, and
    so does all that the sensor itself adds to it.
    """
    speed = load_case.at.speed
    if speed is None:
        return value
    value = value + 0.0 * speed
    return namespace(value).where(speed < 0, -value, value)


@dataclass(frozen=True, kw_only=True)
class _ChannelGain(Effect):
    """A channel y is read as (1 + e) y: sensor error of first order."""

    channel: ClassVar[str]
    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        return replace(force, **{self.channel: getattr(force, self.channel) * (1.0 + self.gain)})


@dataclass(frozen=True, kw_only=True)
class _ChannelOffset(Effect):
    """A channel y is read as y + d y_0: sensor error of first order.

    d = -1 where the sensor is bolted to the rig and the travel speed is given and below zero, else
    1 (`signed_by_travel`).
    """

    channel: ClassVar[str]
    offset: Real = 0.0

    def on_reading(self, force: Force, load_case: LoadCase) -> Force:
        own = self.channel == "sinkage"
        added = self.offset if own else signed_by_travel(self.offset, load_case)
        return replace(force, **{self.channel: getattr(force, self.channel) + added})


@_linear_error(
    "torque-offset", 0.1, 0.05, {"torque": +1}, "the wheel lifted; runs driven both ways"
)
class TorqueOffset(_ChannelOffset):
    r"""The torque sensor does not read zero when nothing turns it.

    .. math:: T' = T + d T_0

    Constant over a campaign; a zero that drifts with temperature is not of this form. References:
    sensor error of first order.
    """

    channel = "torque"
    offset: Annotated[Real, Parameter("N m", -100.0, 100.0, "T0, reading at no torque")] = 0.0


@_linear_error("torque-gain", 0.03, 0.03, {"torque": +1}, "a dead weight on a known lever")
class TorqueGain(_ChannelGain):
    r"""The torque sensor reads a share too much, or too little.

    .. math:: T' = (1 + e) T

    A torque computed from motor current with a wrong torque constant is of this form too; friction
    of the gears is not. References: sensor error of first order.
    """

    channel = "torque"


@_linear_error("drawbar-offset", 0.5, 0.5, {"drawbar_pull": +1}, "the wheel lifted; runs both ways")
class DrawbarOffset(_ChannelOffset):
    r"""The drawbar sensor does not read zero when nothing pulls.

    .. math:: DP' = DP + d F_0

    Friction of the carriage, which opposes the travel in both directions, is not of this form.
    References: sensor error of first order.
    """

    channel = "drawbar_pull"
    offset: Annotated[Real, Parameter("N", -200.0, 200.0, "F0, reading at no pull")] = 0.0


@_linear_error("drawbar-gain", 0.03, 0.03, {}, "a dead weight on the drawbar over a pulley")
class DrawbarGain(_ChannelGain):
    r"""The drawbar sensor reads a share too much, or too little.

    .. math:: DP' = (1 + e) DP

    It says nothing of a sensor that also feels the load. References: sensor error of first order.
    """

    channel = "drawbar_pull"


@_linear_error(
    "sinkage-offset", 0.001, 0.0005, {"sinkage": +1}, "the wheel on a plate at soil level"
)
class SinkageOffset(_ChannelOffset):
    r"""The sinkage is measured from a level that is not that of the soil.

    .. math:: z' = z + z_0

    The surface is taken as level; one that was raked unevenly is noise, not this. References:
    sensor error of first order.
    """

    channel = "sinkage"
    offset: Annotated[Real, Parameter("m", -0.1, 0.1, "z0, reading at no sinkage")] = 0.0


@_linear_error("sinkage-gain", 0.03, 0.03, {"sinkage": +1}, "blocks of known height")
class SinkageGain(_ChannelGain):
    r"""The sinkage sensor reads a share too much, or too little.

    .. math:: z' = (1 + e) z

    Such as an arm whose length is not what was written down; for angles so small that its height is
    proportional to its angle. References: sensor error of first order.
    """

    channel = "sinkage"


@_linear_error(
    "load-gain", 0.03, 0.03, {"torque": -1, "sinkage": -1}, "weighing the wheel on its stand"
)
class LoadGain(Effect):
    r"""The load cell reads a share too much: the wheel feels less than is reported.

    .. math:: W' = (1 + e) W

    with W' as reported and W what the soil carries. References: sensor error of first order. A
    zero that is off is `offset` of load-transfer.
    """

    gain: Annotated[Real, Parameter("1", -0.5, 0.5, "e, share read too much")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        return replace(at, load=at.load / (1.0 + self.gain))


@effect(
    "load-hysteresis",
    source="ISO 376, reversibility error",
    kind="sensor",
    reference={"error": 0.03},
    signs={"torque": +1, "sinkage": +1},
    isolate="weighing the wheel on its stand after a lighter and after a heavier load",
    uses=("load_direction",),
    calibration=0.01,
)
class LoadHysteresis(Effect):
    r"""The load cell lags behind loads that rise and fall.

    .. math:: W' = (1 - e d) W

    with W' as reported and d = 1 where the load last rose, -1 where it last fell, in the order of
    the rows; d = 0 where that order is not known. References: ISO 376, reversibility error of a
    force transducer, 2 e. Loads that only rise make it a wrong scale (`load-gain`); how far a load
    has to fall until the cell reads the other branch is left out.
    """

    error: Annotated[Real, Parameter("1", -0.3, 0.3, "e, half the reversibility error")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        if at.load_direction is None:
            return at
        return replace(at, load=at.load / (1.0 - self.error * at.load_direction))


@effect(
    "slip-offset",
    source="linear sensor error",
    kind="sensor",
    reference={"offset": 0.015},
    signs={"torque": -1, "drawbar_pull": -1},
    isolate="rolling the wheel unpowered on hard ground: its slip there is nil",
    calibration=0.01,
)
class SlipOffset(Effect):
    r"""The reported slip is off by a constant.

    .. math:: s = s' - s_0

    with s' as reported. An estimate of slip from images or from motor current can have such an
    error. A wrong travel speed or wheel radius has the form of `slip-scale` instead: it equals an
    offset of -e at small slip and vanishes towards full slip. References: sensor error of first
    order.
    """

    offset: Annotated[Real, Parameter("1", -0.2, 0.2, "s0, reported slip at no slip")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        return _with_slip(at, at.slip - self.offset)


@effect(
    "slip-scale",
    source="definition of slip",
    kind="sensor",
    reference={"error": 0.015},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="rolling the wheel unpowered on hard ground: its slip there is nil",
    calibration=0.01,
)
class SlipScale(Effect):
    r"""Travel speed or wheel radius is off, and slip with it.

    .. math::
        1 - s' = (1 - s) (1 + e) \text{ driving}, \quad
        1 + s = (1 + s') (1 + e) \text{ braking}

    with s' as reported: in both the reported v / (r omega) is 1 + e times the true one, by the two
    definitions of slip; a row may pass from one to the other. References: definitions of slip,
    Wong, Theory of Ground Vehicles, chapter 2; Nagatani et al., online climbing ability, where 1.5
    per cent of speed is a large part of a small slip.
    """

    error: Annotated[Real, Parameter("1", -0.2, 0.2, "e, of v / (r omega) as reported")] = 0.0

    def on_operating(self, at: Operating, load_case: LoadCase) -> Operating:
        slip = at.slip
        xp = namespace(slip)
        driving = slip + (1.0 - slip) * (self.error / (1.0 + self.error))
        true = xp.where(slip < 0, slip + (1.0 + slip) * self.error, driving)
        # where the sign of slip changes, the other definition of slip applies
        true = xp.where((slip < 0) == (true < 0), true, true / (1.0 + xp.abs(true)))
        return _with_slip(at, true)


def _with_slip(at: Operating, slip: Array) -> Operating:
    most = namespace(slip).full_like(slip, MOST_SLIP)
    return replace(at, slip=namespace(slip).minimum(namespace(slip).maximum(slip, -most), most))
