"""Explanations of rows as they are stated in words, whatever the size of errors beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from soilml.identification.fit import SoilExplanation


@dataclass(frozen=True)
class StatedExplanation:
    """Explanations that differ in the size of errors alone, which are one statement.

    Attributes
    ----------
    effect
        Name of the effect of the catalogue that the model lacks; "" for none.
    error_scales
        Sizes of all errors of sensors and model over the typical ones, rising.
    probability
        The sum of their shares in the averaged answer.
    """

    effect: str
    error_scales: tuple[float, ...]
    probability: float

    @property
    def exact(self) -> bool:
        """Whether it takes model and sensors to be exactly as in the file."""
        return not self.effect and self.error_scales == (0.0,)

    def __str__(self) -> str:
        """What it says, in words."""
        low, high = self.error_scales[0], self.error_scales[-1]
        if low == high:
            return str(SoilExplanation(self.effect, low, self.probability))
        errors = f"typical errors x {low:g} to {high:g}"
        return f"{self.effect} and {errors}" if self.effect else errors


def stated_explanations(explanations: Sequence[SoilExplanation]) -> list[StatedExplanation]:
    """The explanations with their shares summed over the sizes of errors, the likeliest first."""
    together: dict[tuple[str, bool], list[SoilExplanation]] = {}
    for one in explanations:
        together.setdefault((one.effect, one.exact), []).append(one)
    stated = [
        StatedExplanation(
            effect,
            tuple(sorted(one.error_scale for one in own)),
            sum(one.probability for one in own),
        )
        for (effect, _), own in together.items()
    ]
    return sorted(stated, key=lambda one: -one.probability)
