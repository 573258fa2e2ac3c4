"""What each status of a gap analysis means, says and advises: one table."""

from __future__ import annotations

from dataclasses import dataclass

_NEXT = "Make the first run under Next runs"


@dataclass(frozen=True)
class Verdict:
    """What a status says, in words.

    headline: Template of the verdict, of the figures that `soilml.gap.sentences` has.
    """

    meaning: str
    headline: str
    advice: str
    tone: str = "warn"


STATUSES = {
    "no-gap": Verdict(
        "model and measurements agree within the noise",
        "Model and measurements agree within the {noise}: mean squared residual {residual}, "
        "probability of a gap {gap}.",
        "Use the model as it is, within the measured range of slip and load.",
        "good",
    ),
    "named": Verdict(
        "exactly one explanation of the catalogue accounts for the gap",
        "Missing effect: {names}{sure}{shrinks}.",
        f"model.toml contains the effect. {_NEXT} to confirm it.",
        "plain",
    ),
    "partly-named": Verdict(
        "the evidence supports these effects; a smooth remainder is left unexplained",
        "Missing effect, among others: {names}{sure}{shrinks}.",
        "model.toml contains the effect and, under [discrepancy], the size of what is left, which "
        f"widens every interval computed from it. {_NEXT}.",
        "plain",
    ),
    "class": Verdict(
        "several explanations account for the gap; these runs cannot distinguish them",
        "Missing effect: one of {count} explanations, likeliest {names}{sure}{shrinks}.",
        f"{_NEXT}: it discriminates best between the explanations.",
    ),
    "form-open": Verdict(
        "one effect accounts for the gap, with a law that differs from the catalogue's",
        "Missing effect: {names}, by another law than the catalogue's{sure}{shrinks}.",
        "model.toml contains the effect with a law fitted to these data. Use it within the "
        "measured range of slip and load.",
    ),
    "suspected": Verdict(
        "ranked suspects: no cause can be named",
        "Cause not certain: first suspect is {names}{sure}{shrinks}.",
        f"{_NEXT}. model.toml mixes the explanations that hold 95 % together, each with its "
        "weight.",
    ),
    "unknown": Verdict(
        "there is a gap that no effect explains better than a smooth error",
        "There is a gap that no effect explains better than a smooth error ({size}; probability "
        "{gap}).",
        "See where the model disagrees, then check the sensors and the rig, or define an effect of "
        "your own.",
    ),
    "undecided": Verdict(
        "measurements disagree with each other more than their noise allows",
        "No smooth gap was found, but {why}.",
        "Find out why the measurements disagree: correct the noise in the model file or the runs, "
        "and analyse again.",
    ),
    "not-testable": Verdict(
        "there is a gap, but these runs cannot identify its cause",
        "There is a gap, but these runs cannot identify its cause: {why}.",
        "Add the runs that the verdict asks for, and analyse again.",
    ),
    "bad-data": Verdict(
        "the data cannot be analysed",
        "{faults}",
        "Correct the runs or the model file as listed below, and analyse again.",
        "bad",
    ),
}
