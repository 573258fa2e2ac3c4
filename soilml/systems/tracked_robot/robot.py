"""A robot on two tracks: its drawbar pull, also with discrete grousers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.physics.contact import stress
from soilml.physics.effects import Effect, ShearSoftening, TrackGrousers
from soilml.physics.gears import Track
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


def track_of(model: Model) -> Track:
    """The model's track; raises `InputError` for another gear."""
    if not isinstance(model.gear, Track):
        raise InputError(f"the gear is a {model.gear.name}; this needs a track")
    return model.gear
