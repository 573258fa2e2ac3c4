"""One way in which sensors and model may differ from the model file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SoilExplanation:
    """One way in which sensors and model may differ from the model file.

    Attributes
    ----------
    effect
        Name of an effect of the catalogue that the model lacks; "" for none.
    error_scale
        Size of all errors of sensors and model over the typical ones; 0 for those declared alone.
    probability
        Its share in the averaged answer.
    """

    effect: str
    error_scale: float
    probability: float

    @property
    def exact(self) -> bool:
        """Whether it takes model and sensors to be exactly as in the file."""
        return not self.effect and self.error_scale == 0.0

    def __str__(self) -> str:
        """What it says, in words."""
        if self.exact:
            return "the model as in its file"
        errors = f"typical errors x {self.error_scale:g}"
        if not self.effect:
            return errors
        return f"{self.effect} and {errors}" if self.error_scale else self.effect

    def as_json(self) -> dict[str, Any]:
        """Its content in a report; `effect` is null for none."""
        return {
            "effect": self.effect or None,
            "error_scale": self.error_scale,
            "probability": self.probability,
            "text": str(self),
        }
