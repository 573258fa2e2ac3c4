"""Effects whose size may change with slip and load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, final

from soilml.arrays import Array, Real, namespace
from soilml.parameters import Parameter
from soilml.physics.effects.base import Effect
from soilml.physics.load_case import LoadCase

#: Slip ratio and load (N) at which the size of an effect is its parameter's value.
REFERENCE_SLIP, REFERENCE_LOAD = 0.3, 100.0
#: Slip ratio added where a size is a power of slip, so that it stays finite at zero slip.
SLIP_OFFSET = 0.03


def log_relative_slip(slip: Array) -> Array:
    """Natural logarithm of the slip ratio's magnitude, relative to the reference; finite at 0."""
    xp = namespace(slip)
    return xp.log((xp.abs(slip) + SLIP_OFFSET) / (REFERENCE_SLIP + SLIP_OFFSET))


@dataclass(frozen=True, kw_only=True)
class SlipLoadScaling(Effect):
    r"""An effect whose cause is known and whose law is not: its size may vary with slip and load.

    .. math::
        a(s, W) = a \left( \frac{|s| + 0.03}{0.33} \right)^{p_s} (W / 100 N)^{b_W}
        e^{b_s (|s| - 0.3)}

    All three exponents are zero unless they were fitted to data. The power describes effects that
    need slip (exponent near 1), the exponential those that saturate or grow steeply at high slip.
    `law_terms` are the exponents that may be fitted: the deflection of a wheel, for one, does not
    depend on slip.
    """

    law_terms: ClassVar[tuple[str, ...]] = ("slip_power", "by_slip", "by_load")
    by_slip: Annotated[Real, Parameter("1", -20.0, 20.0, "growth of the size with slip")] = 0.0
    slip_power: Annotated[Real, Parameter("1", -5.0, 5.0, "power of slip that the size has")] = 0.0
    by_load: Annotated[Real, Parameter("1", -5.0, 5.0, "power of load that the size has")] = 0.0

    @final
    def scaled(self, size: Real, load_case: LoadCase) -> Array:
        """The size at the slip and load of a load case; unchanged, to the last bit, by default."""
        xp = namespace(load_case.at.slip)
        slip = xp.abs(load_case.at.slip)
        power = self.by_slip * (slip - REFERENCE_SLIP)
        power = power + self.slip_power * log_relative_slip(slip)
        power = power + self.by_load * xp.log(load_case.at.load / REFERENCE_LOAD)
        return size * xp.exp(power)
