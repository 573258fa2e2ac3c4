"""Lugs of wheels and of tracks."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, slip_sign
from soilml.physics.effects.base import SlipLoadScaling, effect
from soilml.physics.gears.rigid_wheel import RigidWheel, WheelArc
from soilml.physics.gears.track import Track
from soilml.physics.load_case import LoadCase


@effect(
    "grousers",
    source="Ding et al. 2011, J. Terramechanics 48(1)",
    kind="wheel",
    reference={"height": 0.01},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="the same runs with a wheel without lugs; a dead-weight check of the torque sensor",
)
class Grousers(SlipLoadScaling):
    r"""Lugs carry the soil around: it shears further out than the rim.

    .. math::
        r_s = r + \lambda h, \quad
        j = r_s [(\theta_1 - \theta) - (1 - s) \rho (\sin\theta_1 - \sin\theta)], \quad
        \rho = 1 - q \lambda h / r_s

    in the shear displacement j, and r_s in the lever arm of the torque. With q = 0, as the source
    prints it, j is that of a cylinder of radius r_s, and the slip must be that of the shearing
    radius, 1 - v / (r_s omega). With q = 1, the slip is reckoned with the rim's radius, as a rig
    does: the soil between the lugs then shears even at zero slip, because it is carried around
    faster than the wheel travels. For r = 0.15 m, h = 10 mm in dry sand under 60 N at s = 0.1 of
    the rim, T = 1.30 N m with q = 0 and 1.58 with q = 1. References: Ding, Gao, Deng, Nagatani and
    Yoshida, J. Terramechanics 48(1), 2011, shearing radius, lambda 0.5 to 1; j is the integral of
    r_s omega - v cos(theta) over time (Wong and Reece, J. Terramechanics 4(1), 1967).

    For lugs so close that the soil between them moves with the wheel. The passive thrust of single
    lugs (Wong, Theory of Ground Vehicles, chapter 2) is the other limit, for lugs far apart. The
    two must not be added. With all lugs at full passive failure that limit gives several times the
    measured drawbar pull of small lugged wheels.
    """

    gear_types: ClassVar[tuple[type, ...]] = (RigidWheel,)
    height: Annotated[Real, Parameter("m", 0.0, 0.2, "h, height of a lug above the rim")] = 0.0
    shearing: Annotated[Real, Parameter("1", 0.0, 1.0, "lambda, share of h added to r")] = 0.75
    rim_slip: Annotated[
        Real, Parameter("1", 0.0, 1.0, "q, 1: slip of the rim; 0: of the shear radius")
    ] = 0.0

    def on_contact(self, rim: WheelArc, load_case: LoadCase) -> WheelArc:
        out = self.shearing * self.scaled(self.height, load_case)
        shear_radius = rim.shear_radius + out
        return replace(
            rim,
            shear_radius=shear_radius,
            lever=rim.lever + out,
            travel=rim.travel * (1.0 - self.rim_slip * out / shear_radius),
        )


@effect(
    "track-grousers",
    source="Wang et al. 2018, J. Terramechanics 77, eqs. 10-14",
    kind="wheel",
    reference={"spacing": 0.8},
    signs={"torque": +1, "drawbar_pull": +1},
    isolate="the same runs with a track without grousers",
)
class TrackGrousers(SlipLoadScaling):
    r"""Grousers of a track shear soil on soil, and cohesion beside the track.

    .. math::
        \tau \leftarrow (1 - g) \tau + g \left[c \left(1 + \frac{2 h}{b}\right)
        + \sigma \tan\varphi\right] \min\left(1, \frac{|j|}{j_k}\right)^d, \qquad
        g = 1 - \frac{l_w}{l_l}

    with g the share of the pitch between two tips. References: Wang et al. 2018, eqs. 10-14, after
    Grecenko 2007: the tips count as a bare track, (l_w / l_l) DP; the rest is compressed by F_x = a
    j^d up to j_k and then rubs, F_x = F_zt f_g. Their sum over the grousers is taken in the mean
    over where the grousers happen to stand, an integral along the track. Not printed there, and our
    own: f_g = tan(phi); cohesion on the face sheared off below the tips and on both sides of it,
    because the block between two grousers comes off as a whole. The factor a makes the two branches
    meet. The exponent d is ours too, and so is j_k in shear moduli: two soils differ by c, phi and
    K alone. The paper's further cosine of the inclination in the friction is left out: it rubs
    along the belt. Not for grousers so far apart that soil between them fails in wedges of its own,
    and without friction on the block's sides. Before `shear-softening` in a model, where both
    soften.
    """

    gear_types: ClassVar[tuple[type, ...]] = (Track,)
    spacing: Annotated[Real, Parameter("1", 0.0, 1.0, "g, share of the pitch between tips")] = 0.0
    height: Annotated[Real, Parameter("m", 0.0, 0.2, "h, height of a grouser")] = 0.012
    yielding: Annotated[Real, Parameter("1", 0.1, 10.0, "j_k / K, where compression ends")] = 3.0
    power: Annotated[Real, Parameter("1", 0.2, 2.0, "d, exponent of compression")] = 0.5

    def on_stress(self, stress: Stress, load_case: LoadCase) -> Stress:
        contact, soil = stress.contact, load_case.soil
        xp = namespace(contact.shear_displacement)
        share = xp.abs(contact.shear_displacement) / (self.yielding * soil.shear_modulus)
        share = xp.clip(share, 1e-30, 1.0)  # the root of nothing has no derivative
        sides = 1.0 + 2.0 * self.height / contact.width
        strength = soil.cohesion * sides + stress.normal * xp.tan(soil.friction_angle)
        between = slip_sign(load_case.at) * strength * xp.exp(self.power * xp.log(share))
        weight = self.scaled(self.spacing, load_case)
        return replace(stress, shear=(1.0 - weight) * stress.shear + weight * between)
