"""Effects whose size may change with slip and load."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass
from typing import Annotated, final

from soilml.arrays import Real, namespace
from soilml.parameters import Parameter
from soilml.physics.load_case import LoadCase

#: Where the size of an effect is as written: at this slip ratio and load (N).
AT_SLIP, AT_LOAD = 0.3, 100.0


@dataclass(frozen=True, kw_only=True)
class SlipLoadScaling(ABC):  # noqa: B024 - there is nothing to answer, only fields to share
    r"""What is known of a cause and not of its law: how its size runs with slip and load.

    .. math:: a(s, W) = a \, e^{b_s (|s| - 0.3)} (W / 100 N)^{b_W}

    Both exponents are zero unless somebody found them from data.
    """

    by_slip: Annotated[Real, Parameter("1", -20.0, 20.0, "growth of the size with slip")] = 0.0
    by_load: Annotated[Real, Parameter("1", -5.0, 5.0, "power of load that the size has")] = 0.0

    @final
    def grown(self, size: Real, scene: LoadCase) -> Real:
        """The size at the slip and load of a scene; unchanged, to the last bit, by default."""
        xp = namespace(scene.at.slip)
        power = self.by_slip * (xp.abs(scene.at.slip) - AT_SLIP)
        power = power + self.by_load * xp.log(scene.at.load / AT_LOAD)
        return size * xp.exp(power)
