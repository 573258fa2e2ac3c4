"""The result of a gap analysis and its entries; `gap.json` has their attributes by name."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.fitted_readings import FittedReadings
from soilml.remarks import Remark
from soilml.report.numbers import format_residual
from soilml.results import EstimatedValue, Result

if TYPE_CHECKING:
    from soilml.report.report import Report

#: Metadata of a field that gap.json does not have: it stands in another file.
ELSEWHERE = {"json": False}


class BeforeAfter(NamedTuple):
    """A figure of the soil alone, and with what was added."""

    before: float
    after: float


@dataclass(frozen=True)
class NamedEffect:
    """An effect that was added to the model, with its parameters and its alternatives."""

    name: str
    parameters: dict[str, EstimatedValue]
    alternatives: tuple[str, ...]  # effects of the other explanations that the data do not reject
    probability: float  # that it is present
    log_odds: float  # natural logarithm


@dataclass(frozen=True)
class Suspect:
    """An explanation with its odds against all others."""

    effects: tuple[str, ...]
    log_odds: float  # natural logarithm, within the catalogue
    probability: float  # that these effects are present, causes outside the catalogue included


@dataclass(frozen=True)
class RemainingDiscrepancy:
    """Smooth discrepancy of a channel, root mean square over its readings, before and after."""

    unit: str
    before_value: float
    after_value: float
    before_sigma: float
    after_sigma: float
    description: str  # where the discrepancy after is largest, in words


#: Stages of a model in words, as the object of "looks like"; others are channels.
_STAGES = {
    "contact geometry": "a change of the contact geometry",
    "normal stress": "a change of the normal stress",
    "shear stress": "a change of the shear stress",
    "slip or load": "a slip or load other than the stated one",
}
#: Variables whose names differ from those of a report.
_VARIABLES = {"pass_number": "the pass", "slip_angle": "the slip angle", "progress": "time"}


@dataclass(frozen=True)
class RemainderCause:
    """A description of the cause of a remainder, not a name."""

    stage: str  # a key of `_STAGES`, or the one channel that has it: a force or a sensor
    depends_on: str  # the quantity of which it is a smooth function; empty where unknown
    #: That the remainder acts at this stage, all others, several causes together and unknown ones
    #: included: at most 0.95
    probability: float
    #: Log density of rows kept back, above that of a smooth remainder in each channel; mean
    predictive_gain: float
    beside: tuple[str, ...] = ()  # effects beside which the remainder is left

    def remark(self) -> Remark:
        """The description in a sentence.

        >>> print(RemainderCause("normal stress", "load", 0.96, 4.2).remark())
        The remainder beside the soil alone looks like a change of the normal stress that depends on
        load.
        """
        own, depends = self.stage.replace("_", " "), ""
        if self.depends_on:
            depends = f" that depends on {_VARIABLES.get(self.depends_on, self.depends_on)}"
        what = f"an error of the {own} alone, of a force or of its sensor{',' if depends else ''}"
        beside = " + ".join(self.beside) or "the soil alone"
        text = f"The remainder beside {beside} looks like {_STAGES.get(self.stage, what)}{depends}."
        return Remark("remainder-cause", text, (self.stage,), "note")


@dataclass(frozen=True)
class RegionScore:
    """A region of the data with its score against the soil alone and its family-wise p value."""

    channel: str
    slip: tuple[float, float]
    load_N: tuple[float, float]  # noqa: N815 - the name of the column
    z: float
    p: float


@dataclass(frozen=True)
class GapReduction:
    """Mean squared standardised residual before and after, in all and by channel; noise gives 1.

    The total of the fitted rows is of residuals that are whitened by noise and scatter, and is not
    the mean of its channels, whose residuals are divided by their standard deviations.
    """

    before: float
    after: float
    channels: dict[str, BeforeAfter]
    readings: int
    description: str

    @property
    def shrinks(self) -> bool:
        """Whether it is smaller after, at the digits that are shown."""
        shown = [format_residual(x) for x in (self.before, self.after)]
        return self.after < self.before and shown[0] != shown[1]


@dataclass(frozen=True)
class NextRun:
    """A proposed run or check, with the predictions of each explanation."""

    kind: str
    text: str
    discrimination: float  # expected, in sigma, between the remaining explanations
    #: operating points and predictions of each explanation
    rows: tuple[dict[str, float | str], ...] = field(metadata=ELSEWHERE)
    #: The explanations that it separates: the first one from each other one
    compared: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, repr=False)
class GapReport(Result):
    """The result of a gap analysis, made by `soilml.gap.gap`.

    Attributes
    ----------
    status : str
        A key of `soilml.gap.STATUSES`.
    sentence : str
        The verdict in at most 25 words, without names of runs.
    lines : tuple of Remark
        At most five below it: what was tried, what is left and where, what to drive next.
    model : Case
        The fitted model, with the effects that are claimed where they are the whole answer. Else it
        has `explanations` with their weights, and predicts by their mixture.
    effects : tuple of NamedEffect
        The effects that were added.
    cause_set : tuple of tuple of str
        The explanations that the data do not reject, as sets of effect names, the best first.
    probabilities, gap_probability, remainder_probability : dict of float, float, float
        Posterior probabilities: of each tested effect, of a gap, of a smooth discrepancy beside
        what is shown.
    outside_probability : float
        That there is a gap with a cause which no effect of the catalogue describes.
    suspects : tuple of Suspect
        Explanations with their odds, the likeliest first.
    discrepancy : dict of RemainingDiscrepancy
        Smooth discrepancy of each channel before and after, by column.
    remainder_cause : RemainderCause, optional
        Stage of the cause of the remainder, and what it depends on, where the readings tell.
    reasons : tuple of Remark
        Why no cause can be named, or why the data cannot be analysed.
    where : tuple of RegionScore
        Regions of the data, the largest disagreement first.
    gap : dict of GapReduction
        Figures of the fitted rows (`train`) and of held-out runs and regions, before and after
        adding what is named or first among the suspects. Both are without the smooth remainder.
        A part whose figure did not shrink is left out, with a note.
    soil_before, soil_after : dict of EstimatedValue
        Soil parameters without and with the added effects.
    next_runs : tuple of NextRun
        Proposed runs and checks, the most discriminating first.
    untestable : dict of Remark
        Why these runs cannot test an effect, by its name.
    notes, not_claimed : tuple of Remark
        What to know of the data and of the fit; what these runs cannot tell apart.
    variance_components : dict of float
        Estimated noise scales, run-to-run standard deviations and autocorrelation.
    misfit : float, optional
        Mean squared residual of the soil alone per degree of freedom under the declared noise.
    """

    status: str
    sentence: str
    model: Case = field(metadata=ELSEWHERE)
    effects: tuple[NamedEffect, ...] = ()
    cause_set: tuple[tuple[str, ...], ...] = ()
    probabilities: dict[str, float] = field(default_factory=dict)
    suspects: tuple[Suspect, ...] = ()
    discrepancy: dict[str, RemainingDiscrepancy] = field(default_factory=dict)
    remainder_cause: RemainderCause | None = None
    lines: tuple[Remark, ...] = ()
    reasons: tuple[Remark, ...] = ()
    where: tuple[RegionScore, ...] = ()
    gap: dict[str, GapReduction] = field(default_factory=dict)
    soil_before: dict[str, EstimatedValue] = field(default_factory=dict)
    soil_after: dict[str, EstimatedValue] = field(default_factory=dict)
    next_runs: tuple[NextRun, ...] = ()
    untestable: dict[str, Remark] = field(default_factory=dict)
    notes: tuple[Remark, ...] = ()
    not_claimed: tuple[Remark, ...] = ()
    variance_components: dict[str, float] = field(default_factory=dict)
    misfit: float | None = None
    gap_probability: float = 0.0
    remainder_probability: float = 0.0
    outside_probability: float = 0.0
    seed: int = 0
    curves: FittedReadings | None = field(default=None, metadata=ELSEWHERE)

    @property
    def first(self) -> tuple[str, ...]:
        """The effects whose figures are shown: those that are claimed, else first suspected."""
        if self.effects:
            return tuple(e.name for e in self.effects)
        return self.cause_set[0] if self.cause_set else ()

    def report(self) -> Report:
        """Verdict, soil and effects, readings beside the model, where it disagrees, and by what."""
        from soilml.gap.report import gap_report

        return gap_report(self)

    def __getitem__(self, name: str) -> EstimatedValue:
        """A parameter of the soil after, or of an effect by EFFECT.PARAMETER.

        Raises `InputError` for another name.
        """
        found = self._parameters()
        if name not in found:
            raise InputError(f"{name!r} is not identified; there are: {', '.join(found)}")
        return found[name]

    def _parameters(self) -> dict[str, EstimatedValue]:
        """Parameters of the soil after, and of the effects that were added."""
        added = {f"{e.name}.{k}": v for e in self.effects for k, v in e.parameters.items()}
        return {**(self.soil_after or self.soil_before), **added}

    def frame_columns(self) -> dict[str, Any]:
        """A row for each parameter, SI units; `_before` is that of the soil alone."""
        found, old = self._parameters(), self.soil_before
        ends = np.asarray([v.interval() for v in found.values()]).reshape(-1, 2).T
        return {
            "parameter": list(found),
            "mean": [v.value for v in found.values()],
            "std": [v.std for v in found.values()],
            "low": ends[0],
            "high": ends[1],
            "mean_before": [old[k].value if k in old else np.nan for k in found],
            "std_before": [old[k].std if k in old else np.nan for k in found],
            "unit": [v.unit for v in found.values()],
        }

    def as_json(self) -> dict[str, Any]:
        """The content of gap.json."""
        from soilml import __version__

        return {**as_json_entry(self), "soilml_version": __version__}


def as_json_entry(value: Any) -> Any:
    """A result as JSON takes it: dataclasses by the names of their fields, tuples as lists."""
    if isinstance(value, Remark):
        return value.as_json()
    if is_dataclass(value):
        shown = [f for f in fields(value) if f.metadata.get("json", True)]
        return {f.name: as_json_entry(getattr(value, f.name)) for f in shown}
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: as_json_entry(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [as_json_entry(entry) for entry in value]
    return value
