"""What a tracker answers to each row: the present estimate, and what became of the row."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from soilml.onboard.estimate import Estimate


class Event(IntEnum):
    """What a row was found to be. Numbers are never reused."""

    #: Agrees with the rows before, and is used.
    ACCEPTED = 0
    #: Disagrees with the rows before: a glitch, or the first row of another soil. Not used.
    SET_ASIDE = 1
    #: With this row there are enough of another soil; the rows before them are forgotten.
    SOIL_CHANGED = 2
    #: Recent rows together disagree with earlier ones, which are forgotten.
    DRIFT = 3
    #: A sensor repeats its reading while slip or load change. Not used.
    STUCK = 4
    #: All readings are those of the row before, which counts once. Not used.
    REPEATED = 5
    #: Not a number, impossible, or out of the range of the file. Not used.
    UNUSABLE = 6


@dataclass(frozen=True)
class TrackerState:
    """The soil after a row of a drive.

    Attributes
    ----------
    estimate : Estimate
        From the rows that are remembered; the prior where there are none.
    event : Event
        What the row was found to be.
    words : str
        The same as a sentence.
    rows_since_change : int
        Rows used since the start, or since the first row of the present soil.
    rows_remembered : int
        The last ones of them, on which the estimate rests.
    rows_in_question : int
        Rows set aside of late. They are glitches, or the first ones of another soil: the estimate
        may be that of the soil before while this is not zero.
    drifting : bool
        Whether a drift was found within as many rows as are remembered at most: the estimate may
        lag behind, and it is wrong if what drifts is a sensor.
    """

    estimate: Estimate
    event: Event
    words: str
    rows_since_change: int
    rows_remembered: int
    rows_in_question: int
    drifting: bool
