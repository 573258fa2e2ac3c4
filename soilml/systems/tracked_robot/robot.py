"""A robot on two tracks: drawbar pull, and the equilibrium of each track."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.operating_points import operating_points
from soilml.io.table import Table
from soilml.physics.contact import stress
from soilml.physics.effects import Effect, ShearSoftening, TrackGrousers
from soilml.physics.gears import Track
from soilml.physics.gears.track_belt import belt_arcs
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import Soil

GRAVITY = 9.81
PHASES = 16  # Places of the first grouser over which discrete ones are averaged


@dataclass(frozen=True)
class TrackedRobot:
    """Two equal track units that carry a mass (kg) together."""

    track: Track
    mass: float

    @property
    def load(self) -> float:
        """Load on one track, N."""
        return 0.5 * self.mass * GRAVITY

    def pull(self, soil: Soil, slip: ArrayLike, effects: tuple[Effect, ...] = ()) -> Floats:
        """Drawbar pull (N) of both tracks at slips; NaN where the soil does not carry the load."""
        at = Operating(slip=np.asarray(slip, dtype=np.float64), load=self.load)
        return np.asarray(2.0 * Model(self.track, effects)(soil, at).drawbar_pull)


#: The robot of Wang, Yan and Du 2018: mass as printed. The dimensions of its tracks and the
#: unloading of belt and soil are not printed; assumed are round numbers that fit into 0.820 m x
#: 0.589 m: end wheels of 0.1 m radius 0.6 m apart, belts 0.08 m wide, and the defaults of `Track`.
WANG2018 = TrackedRobot(Track(radius=0.1, width=0.08, base=0.6), mass=130.0)
#: Its grousers: 12 mm high as printed, tips on a fifth of the pitch as assumed.
GROUSERS = TrackGrousers(spacing=0.8, height=0.012)
#: Shear of the paper's soils beyond the peak: eq. 6 has its peak at the printed modulus; loose
#: sand has no peak, firm clay drops to the usual residual. The ratio is not printed.
BEYOND_PEAK: dict[str, tuple[Effect, ...]] = {
    "sand": (),
    "clay": (ShearSoftening(share=1.0, residual=0.7, peak=1.0),),
}


@dataclass(frozen=True, kw_only=True)
class DiscreteGrousers:
    """Grousers of a track one by one, as eqs. 10 to 14 of Wang et al. 2018 have them.

    pitch, tip: Distance from one to the next, l_l, and length of its top, l_w, m.
    friction: f_g, coefficient of friction of soil that has yielded.
    yielding: j_k, displacement at which it yields, m; it differs by soil.
    power: d, exponent of the compression F = a j^d, which meets the friction at j_k.
    """

    pitch: float
    tip: float
    friction: float
    yielding: float
    power: float = 0.5

    def __post_init__(self) -> None:
        sizes = (self.pitch, self.tip, self.friction, self.yielding, self.power)
        if not all(0.0 < size < np.inf for size in sizes) or self.tip >= self.pitch:
            raise InputError(
                f"grousers {sizes}; needed are sizes above 0, with a tip below a pitch"
            )


def grouser_pull(
    robot: TrackedRobot,
    soil: Soil,
    slip: float,
    grousers: DiscreteGrousers,
    effects: tuple[Effect, ...] = (),
    points: int = 801,
) -> Floats:
    r"""Pull (N) of both tracks with discrete grousers, at `PHASES` places of the first one.

    .. math::
        DP = \sum_n (F_{xn} \cos\theta - F_{ztn} \sin\theta) + \frac{l_w}{l_l} DP_0, \quad
        F_{ztn} = b (l_l - l_w) \sigma, \quad
        F_{xn} = F_{ztn} f_g \min(1, j_n / j_k)^d

    with DP_0 the pull without grousers. References: Wang et al. 2018, eqs. 10 to 14; friction acts
    along the belt, where the paper multiplies it by another cosine. Soil between grousers has no
    cohesion here, unlike in the effect `track-grousers`, which is the mean over all places with
    f_g = tan(phi).
    """
    at = Operating(slip=np.asarray([slip]), load=np.asarray([robot.load]))
    model, track = Model(robot.track, effects), robot.track
    belt = track.contact_geometry(np.asarray(model(soil, at).sinkage), soil, at)
    inclination, contact = track.profile_contact(belt, at, points)
    angle, travel, moved = (
        np.asarray(v)[:, 0]
        for v in (inclination, contact.surface_travel, contact.shear_displacement)
    )
    normal = np.asarray(stress(contact, soil, at).normal)[:, 0]
    count = int(travel[-1] / grousers.pitch) + 1
    place = grousers.pitch * (np.arange(count) + np.arange(PHASES)[:, None] / PHASES)
    angle, moved, normal = (np.interp(place, travel, v) for v in (angle, moved, normal))
    pressed = np.where(place <= travel[-1], track.width * (grousers.pitch - grousers.tip), 0.0)
    pressed = pressed * normal
    mobilised = np.clip(moved / grousers.yielding, 0.0, 1.0) ** grousers.power
    each = pressed * (grousers.friction * mobilised * np.cos(angle) - np.sin(angle))
    bare = float(robot.pull(soil, slip, effects))
    return np.asarray(2.0 * each.sum(axis=1) + grousers.tip / grousers.pitch * bare)


def track_balance(model: Model, soil: Soil, at: Operating, points: int = 2001) -> dict[str, Floats]:
    r"""How a track stands in the soil, by names of columns, at operating points (...).

    .. math::
        T = b R_t \bar\sigma, \quad x = \frac{1}{W} \int (X - x) \, dW

    A belt without bending stiffness on a circular arc has the tension b R_t sigma at every point;
    since the pressure varies along the arc, the mean tension is returned. The trim angle follows
    from the displacements of both wheels.

    Parameters
    ----------
    model
        A model with a track.
    soil, at
        Soil parameters, and slip and load of one track.
    points
        Points along the belt for the integrals.

    Returns
    -------
    dict
        Shares of the load under front wheel, belt and rear wheel; the trim, tail down (rad); the
        sinkage of the rear wheel (m); the tension of the belt (N); the centre of pressure behind
        the middle of the base (m). NaN without equilibrium.

    Raises
    ------
    InputError
        If the model has no track, and as the model itself.

    References
    ----------
    Wang et al. 2018, eqs. 3, 8 and 9, in which the tensions at the joints cancel.
    """
    track = track_of(model)
    belt = track.contact_geometry(model(soil, at).sinkage, soil, at)
    profile = model.profile(soil, at, points)
    _, middle, last = belt_arcs(belt)
    step = last.distance(-belt.exit)[0] / (points - 1)
    way = step * np.arange(points).reshape(-1, *[1] * np.ndim(step))
    front, rear = way < middle.along, way > last.along
    weight = np.full_like(way, 1.0) * step
    weight[[0, -1]] *= 0.5
    lift = profile.normal * np.cos(profile.angle) + profile.shear * np.sin(profile.angle)
    carried = lift * weight
    load = np.sum(carried, axis=0)
    level = np.cos(profile.angle) * step
    ahead = np.cumsum(level, axis=0) - 0.5 * (level + level[:1])  # behind the entry
    below_front = track.radius * np.sin(belt.entry)
    centre = np.sum(ahead * carried, axis=0) / load - below_front
    length = belt.arc_radius * (belt.leave + belt.meet)
    pressure = np.sum(profile.normal * weight * ~(front | rear), axis=0) / length
    return {
        "front_share": np.sum(carried * front, axis=0) / load,
        "belt_share": np.sum(carried * ~(front | rear), axis=0) / load,
        "rear_share": np.sum(carried * rear, axis=0) / load,
        "trim_rad": belt.trim,
        "rear_sinkage_m": belt.rear,
        "belt_tension_N": track.width * belt.arc_radius * pressure,
        "pressure_centre_m": centre - 0.5 * track.base * np.cos(belt.trim),
    }


def balanced_rows(case: Case, table: Table) -> Table:
    """Simulated rows with what `track_balance` says of each."""
    columns = table.columns | track_balance(case.model, case.soil, operating_points(table))
    columns["status"] = columns.pop("status")  # the last, as in every table
    return replace(table, columns=columns)


def track_of(model: Model) -> Track:
    """The model's track; raises `InputError` for another gear."""
    if not isinstance(model.gear, Track):
        raise InputError(f"the gear is a {model.gear.name}; this needs a track")
    return model.gear
