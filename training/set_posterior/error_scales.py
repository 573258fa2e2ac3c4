"""Scales of the model's errors that a set posterior is averaged over, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.onboard.set_contract import LAW_ERROR_COLUMNS, MODEL_ERROR_COLUMNS

#: Place of the first error that one channel has alone.
OF_CHANNELS = MODEL_ERROR_COLUMNS.index("sinkage")
#: Number of columns of each kind, in the order of `MODEL_ERROR_COLUMNS`.
GROUPS = (
    OF_CHANNELS,
    len(MODEL_ERROR_COLUMNS) - OF_CHANNELS - len(LAW_ERROR_COLUMNS),
    len(LAW_ERROR_COLUMNS),
)
MOST_SCALES = 8  # Each takes time on board
TOLERANCE = 1e-6  # Of the sum of probabilities
#: What a card says of the scales.
ON_CARD = (
    "The file's own answer is averaged over sizes of the errors of its model, as multiples of the "
    "usual ones, each weighted by how well it explains the set:"
)


class ErrorScale(NamedTuple):
    """A size of the model's errors, over the usual ones, and its prior probability, above 0."""

    probability: float
    bearing: float  # multiple of the usual errors of bearing and contact
    channels: float  # of those of single channels
    laws: float  # of those of the laws of the soil

    @property
    def of_columns(self) -> Floats:
        """By column, in the order of `MODEL_ERROR_COLUMNS`."""
        return np.repeat(self[1:], GROUPS)


@dataclass(frozen=True)
class ErrorScales:
    """Scales of the model's errors; their probabilities have the sum 1.

    Raises `InputError` for other probabilities, negative sizes, and no or too many scales.
    """

    scales: tuple[ErrorScale, ...]

    def __post_init__(self) -> None:
        if not 0 < len(self.scales) <= MOST_SCALES:
            raise InputError(f"{len(self.scales)} scales of errors; needed are 1 to {MOST_SCALES}")
        sizes, probabilities = self.sizes, self.probabilities
        if not (np.isfinite(sizes).all() and (sizes >= 0.0).all()):
            raise InputError("a scale of errors is negative or not finite")
        if not ((probabilities > 0.0).all() and abs(probabilities.sum() - 1.0) < TOLERANCE):
            raise InputError("probabilities of scales of errors must be above 0, with the sum 1")

    @property
    def sizes(self) -> Floats:
        """Multiples of the usual errors, (scales, 3)."""
        return np.asarray(self.scales, np.float64)[:, 1:]

    @property
    def probabilities(self) -> Floats:
        """Prior probabilities (scales,)."""
        return np.asarray(self.scales, np.float64)[:, 0]

    def judged_first(self) -> tuple[Floats, Floats]:
        """Multiples by column (scales, errors), and probabilities (scales,).

        First is the scale whose misfit tells whether readings are consistent, the usual one: what
        usual errors do not explain is flagged, though the largest ones may.
        """
        order = np.argsort(np.abs(self.sizes[:, 0] - 1.0), kind="stable")
        order = np.append(order[:1], np.sort(order[1:]))
        return np.repeat(self.sizes[order], GROUPS, axis=1), self.probabilities[order]

    def as_list(self) -> list[dict[str, float]]:
        """As in a spec, and in the metadata of a file."""
        return [scale._asdict() for scale in self.scales]

    def for_card(self) -> list[str]:
        """Sizes and probabilities as a table with a sentence, lines of Markdown."""
        rows = [
            f"| {s.bearing:g} | {s.channels:g} | {s.laws:g} | {s.probability:.2f} |"
            for s in self.scales
        ]
        head = "| bearing and contact | single channels | laws of the soil | probability |"
        return [ON_CARD, "", head, "|---:|---:|---:|---:|", *rows]

    @staticmethod
    def of_list(entries: list[dict[str, Any]]) -> ErrorScales:
        """From `as_list`."""
        return ErrorScales(tuple(ErrorScale(**entry) for entry in entries))


#: Scales of a model that nothing but the set itself tells of: it is right in one of two cases, and
#: wrong as nobody listed in one of eight. A model that is right still has small errors of single
#: channels, and of its laws half the usual ones, as `identify` takes them: rows tell nothing of
#: these. Of eleven choices on seed 91 (`python bench/run.py model-errors --seeds 91`, 40 sets a
#: world), four have the least score with all channels in the listed worlds, 1.9, and 2.5 to 2.6
#: in the unlisted ones; it is 2.0 and 2.8 where a right model has no error. Larger errors cover one
#: to four points more in unlisted worlds, and widen clean sets by up to 40 %. With these, the error
#: on clean sets is 1.0 to 1.2 times that of an exact model, on seed 1 1.1 to 1.35 times.
USUAL_SCALES = ErrorScales(
    (
        ErrorScale(0.5, bearing=0.0, channels=0.3, laws=0.5),
        ErrorScale(0.38, bearing=1.0, channels=1.5, laws=1.0),
        ErrorScale(0.12, bearing=3.0, channels=4.0, laws=2.0),
    )
)
