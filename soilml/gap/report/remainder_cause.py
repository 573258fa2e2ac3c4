"""What is told of the cause of a remainder: its stage, and what it depends on."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.quantities import CHANNELS
from soilml.remarks import Remark

#: Stages in words, as the object of "looks like".
_IN_WORDS = {
    "contact geometry": "a change of the contact geometry",
    "normal stress": "a change of the normal stress",
    "shear stress": "a change of the shear stress",
    "slip or load": "a slip or load other than the stated one",
}
#: Variables whose names differ from those of a report.
_VARIABLES = {"pass_number": "the pass", "slip_angle": "the slip angle", "progress": "time"}


@dataclass(frozen=True)
class RemainderCause:
    """A description of the cause of a remainder, not a name.

    Attributes
    ----------
    stage
        `contact geometry`, `normal stress`, `shear stress`, `slip or load`, or the one channel
        that has it: a force or a sensor.
    depends_on
        The quantity of which it is a smooth function; empty where the readings do not tell.
    channels
        Channels whose readings it changes by more than half of their noise.
    probability
        That the remainder acts at this stage, all others, several causes together and unknown ones
        included: at most 0.95.
    predictive_gain
        Log density of rows kept back, above that of a smooth remainder in each channel; mean over
        the parts.
    beside
        Effects beside which the remainder is left; empty for that of the soil alone.
    """

    stage: str
    depends_on: str
    channels: tuple[str, ...]
    probability: float
    predictive_gain: float
    beside: tuple[str, ...] = ()

    def remark(self) -> Remark:
        """The description in one or two sentences.

        >>> found = RemainderCause("normal stress", "load", ("torque", "sinkage"), 0.96, 4.2)
        >>> print(found.remark())
        The remainder beside the soil alone looks like a change of the normal stress that depends on
        load. Torque and sinkage share it.
        """
        alone = self.stage in CHANNELS
        what = _IN_WORDS.get(self.stage, "")
        if alone:
            what = f"an error of the {_name(self.stage)} alone, of a force or of its sensor,"
        depends = ""
        if self.depends_on:
            depends = f" that depends on {_VARIABLES.get(self.depends_on, self.depends_on)}"
        elif alone:
            what = what.rstrip(",")
        shared = ""
        if not alone and len(self.channels) > 1:
            *first, last = map(_name, self.channels)
            names = f"{', '.join(first)} and {last}"
            shared = f" {names[:1].upper()}{names[1:]} share it."
        beside = " + ".join(self.beside) or "the soil alone"
        text = f"The remainder beside {beside} looks like {what}{depends}.{shared}"
        return Remark("remainder-cause", text, (self.stage,), "note")


def _name(channel: str) -> str:
    return channel.replace("_", " ")
