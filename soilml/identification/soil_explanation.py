"""One way in which sensors and model may differ from the model file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SoilExplanation:
    """One way in which sensors and model may differ from the model file.

    Attributes
    ----------
    effects
        Names of effects of the catalogue that the model lacks; none for the soil alone.
    discrepancy
        Whether there is a smooth error of the model beside them.
    probability
        Its share in the averaged answer.
    """

    effects: tuple[str, ...]
    discrepancy: bool
    probability: float

    @property
    def exact(self) -> bool:
        """Whether it takes the model, but for its sensors, to be as in the file."""
        return not self.effects and not self.discrepancy

    def __str__(self) -> str:
        """What it says, in words."""
        if self.exact:
            return "typical errors of the sensors alone"
        errors = ("a smooth error of the model",) if self.discrepancy else ()
        return " and ".join((*self.effects, *errors))

    def as_json(self) -> dict[str, Any]:
        """Its content in a report."""
        return {
            "effects": list(self.effects),
            "discrepancy": self.discrepancy,
            "probability": self.probability,
            "text": str(self),
        }
