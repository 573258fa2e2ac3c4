"""Grousers of a track."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.contact import Stress, slip_sign
from soilml.physics.effects.base import EffectCard, SlipLoadScaling
from soilml.physics.gears.track import Track
from soilml.physics.load_case import LoadCase


@final
@dataclass(frozen=True, kw_only=True)
class TrackGrousers(SlipLoadScaling):
    r"""Between the tips of its grousers a track shears soil on soil, and soil beside the track.

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

    name: ClassVar[str] = "track-grousers"
    about: ClassVar[EffectCard] = EffectCard(
        text="grousers of a track shear soil on soil, and cohesion beside the track",
        source="Wang et al. 2018, J. Terramechanics 77, eqs. 10-14",
        kind="wheel",
        reference={"spacing": 0.8},
        signs={"torque": +1, "drawbar_pull": +1},
        isolate="the same runs with a track without grousers",
    )
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
