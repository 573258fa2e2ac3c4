"""Changes of the running gear that distinguish effects which depend on it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from soilml.config.case import Case
from soilml.parameters import declared
from soilml.physics.effects.base import Effect

#: Effects of lugs, which a smooth gear does not have.
LUG_EFFECTS = frozenset({"grousers", "track-grousers"})
#: Kind of a run on such a gear.
SMOOTH_GEAR = "smooth gear"
#: Another size of the gear: kind of run -> (parameter, factor, effects that this tells apart). Half
#: as wide or half as large again: other wheels of a small rig, whose effect exceeds the noise.
SIZES = {
    "narrower gear": ("width", 0.5, frozenset({"sidewall-shear", "wheel-flexibility"})),
    "larger wheel": ("radius", 1.5, frozenset({"small-wheel-stiffness", "stress-shift"})),
}


@dataclass(frozen=True)
class GearChange:
    """Another gear for a run: a smooth one, or one of another size (m)."""

    kind: str
    text: str
    parameter: str = ""
    size: float = 0.0

    def apply(self, case: Case) -> Case:
        """The case with this gear."""
        if self.parameter:
            return case.with_values({f"gear.{self.parameter}": self.size})
        effects = tuple(e for e in case.model.effects if e.name not in LUG_EFFECTS)
        return replace(case, model=replace(case.model, effects=effects))

    @property
    def removed(self) -> frozenset[str]:
        """Names of the effects that this gear does not have."""
        return frozenset() if self.parameter else LUG_EFFECTS

    def columns(self) -> dict[str, float]:
        """The change as columns of a table."""
        if self.parameter:
            return {f"wheel_{self.parameter}_m": self.size}
        return {"grouser_height_m": 0.0}


def gear_changes(case: Case, effects: Sequence[type[Effect]]) -> Iterator[GearChange]:
    """The changes of the gear that tell some of these effects apart from others.

    None where a case has several gears: it is those that are there to drive.
    """
    if case.gears:
        return
    names = {effect.name for effect in effects}
    if names & LUG_EFFECTS:
        yield GearChange(SMOOTH_GEAR, "lugs removed or covered")
    sizes = declared(type(case.model.gear))
    for kind, (parameter, factor, told_apart) in SIZES.items():
        if names & told_apart and parameter in sizes:
            size = float(f"{factor * float(getattr(case.model.gear, parameter)):.2g}")
            text = f"a {parameter} of {size:g} m"
            yield GearChange(kind, text, parameter, size)
