"""The result of a gap analysis and its entries; `gap.json` has their attributes by name."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.fitted_readings import FittedReadings
from soilml.gap.report.remainder_cause import RemainderCause
from soilml.gap.report.soil_test_agreement import SoilTestAgreement, soil_test_agreement
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
    #: sigma that distinguish the effect, at its size, from the soil and its nearest rival
    separating_snr: float
    nearest_rival: str
    #: posterior probability that the effect is present, and the natural logarithm of its odds
    probability: float
    log_odds: float


@dataclass(frozen=True)
class Suspect:
    """An explanation with its odds against all others, under the conditions of the report."""

    effects: tuple[str, ...]
    log_odds: float  # natural logarithm, within the catalogue
    probability: float  # that these effects are present, causes outside the catalogue included
    #: Logarithm of the density of rows kept back, above that of the soil alone, both beside a
    #: smooth remainder; None where no row was kept back for it
    predictive_gain: float | None = None
    #: Its standard error, by which folds of them differ by chance; None where no part has two
    predictive_gain_error: float | None = None
    #: Sizes of its effects that are implausibly large, in usual ones, by name
    times_usual: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RemainingDiscrepancy:
    """Smooth discrepancy of a channel, root mean square over its readings, before and after."""

    unit: str
    before_value: float
    after_value: float
    before_sigma: float
    after_sigma: float
    description: str  # where the discrepancy after is largest, in words


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
class CandidateSummary:
    """A candidate: predicted and achieved decrease of -2 ln p, and its verdict."""

    effects: tuple[str, ...]
    predicted_gain: float
    achieved_gain: float
    excess: float  # -2 ln p above that of the best candidate
    verdict: Remark


@dataclass(frozen=True)
class NextRun:
    """A proposed run or check, with the predictions of each explanation."""

    kind: str
    text: str
    discrimination: float  # expected, in sigma, between the remaining explanations
    #: operating points and predictions of each explanation
    rows: tuple[dict[str, float | str], ...] = field(metadata=ELSEWHERE)
    cost: float | None = None  # where costs are given, in their unit
    #: The explanations that it separates: the first one from each other one
    compared: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class NoiseAgreement:
    """Mean squared residuals of the soil alone, per degree of freedom, in variances of the noise.

    Both are of the readings that were not excluded as outliers. `declared` is that under the
    declared noise, as `identify` states it where none was excluded; `exceeds_noise` whether noise
    alone would exceed it with a probability below 0.001. `granted` is that under noise, and scatter
    of the soil from run to run by these standard deviations.
    """

    declared: float
    exceeds_noise: bool
    granted: float
    friction_angle_std: float  # rad
    bearing_std: float  # relative
    with_discrepancy: bool = False  # Whether a declared discrepancy is part of the noise

    @property
    def grants_scatter(self) -> bool:
        """Whether the soil may differ from run to run."""
        return self.friction_angle_std > 0.0 or self.bearing_std > 0.0


@dataclass(frozen=True)
class SoilTrend:
    """A trend of the soil along the order of the runs, or of the rows of each run.

    `z` is its score in standard deviations, positive where the soil becomes stronger, `p` its
    family-wise p value among all scores of the soil alone, `change` that of the parameter from the
    first run, or row, to the last: rad, or relative.
    """

    order: str  # runs or rows
    parameter: str
    z: float
    p: float
    change: float


#: Status of a report, and its meaning.
STATUSES = {
    "no-gap": "model and measurements agree within the noise",
    "named": "exactly one explanation of the catalogue accounts for the gap",
    "partly-named": "the evidence supports these effects; a smooth remainder is left unexplained",
    "class": "several explanations account for the gap; these runs cannot distinguish them",
    "form-open": "one effect accounts for the gap, with a law that differs from the catalogue's",
    "suspected": "ranked suspects: no cause can be named",
    "unknown": "there is a gap that no effect explains better than a smooth error",
    "undecided": "measurements disagree with each other more than their noise allows",
    "not-testable": "there is a gap, but these runs cannot identify its cause",
    "bad-data": "the data cannot be analysed",
}


@dataclass(frozen=True, repr=False)
class GapReport(Result):
    """The result of a gap analysis, made by `soilml.gap.gap`.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
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
    probabilities : dict of float
        Posterior probability of each tested effect.
    suspects : tuple of Suspect
        Explanations with their odds wherever there is a gap: the likeliest first, or the likeliest
        of usual size where that has a probability of at least 0.005.
    conditions : tuple of Remark
        Conditions under which these odds are valid.
    discrepancy : dict of RemainingDiscrepancy
        Smooth discrepancy of each channel before and after, by column.
    remainder_cause : RemainderCause, optional
        Stage of the cause of the remainder, and what it depends on, where the readings tell.
    best_unclaimed : tuple of str
        The explanation that is likeliest where no cause is claimed.
    reasons : tuple of Remark
        Why no cause can be named, or why the data cannot be analysed.
    where : tuple of RegionScore
        Regions of the data, the largest disagreement first.
    gap : dict of GapReduction
        Figures of the fitted rows (`train`) and of held-out runs and regions, before and after
        adding what is named or first among the suspects. Both are without the smooth remainder.
        A part whose figure did not shrink is left out, with a note.
    gap_beside_remainder : dict of GapReduction
        The same of held-out runs and regions, both beside a smooth remainder.
    soil_before, soil_after : dict of EstimatedValue
        Soil parameters without and with the added effects.
    mimic_radius : float
        Largest cosine between the signature of an added effect and that of another one.
    next_runs : tuple of NextRun
        Proposed runs and checks, the most discriminating first.
    candidates : tuple of CandidateSummary
        All fitted candidates, the best first.
    untestable : dict of Remark
        Why these runs cannot test an effect, by its name.
    notes : tuple of Remark
        What a reader should know of the data and of the fit.
    not_claimed : tuple of Remark
        Conclusions that the report does not support.
    variance_components : dict of float
        Estimated noise scales, run-to-run standard deviations and autocorrelation.
    misfit : NoiseAgreement, optional
        Residuals of the soil alone under the declared noise, and with scatter.
    trends : tuple of SoilTrend
        Trends of the soil with the order of runs and rows, the most significant first.
    gap_probability : float
        Posterior probability that noise and scatter alone do not explain what the soil leaves.
    remainder_probability : float
        Posterior probability of a smooth discrepancy beside what is shown.
    """

    status: str
    sentence: str
    model: Case = field(metadata=ELSEWHERE)
    effects: tuple[NamedEffect, ...] = ()
    cause_set: tuple[tuple[str, ...], ...] = ()
    probabilities: dict[str, float] = field(default_factory=dict)
    suspects: tuple[Suspect, ...] = ()
    conditions: tuple[Remark, ...] = ()
    discrepancy: dict[str, RemainingDiscrepancy] = field(default_factory=dict)
    remainder_cause: RemainderCause | None = None
    best_unclaimed: tuple[str, ...] = ()
    lines: tuple[Remark, ...] = ()
    reasons: tuple[Remark, ...] = ()
    where: tuple[RegionScore, ...] = ()
    gap: dict[str, GapReduction] = field(default_factory=dict)
    gap_beside_remainder: dict[str, GapReduction] = field(default_factory=dict)
    soil_before: dict[str, EstimatedValue] = field(default_factory=dict)
    soil_after: dict[str, EstimatedValue] = field(default_factory=dict)
    mimic_radius: float = 0.0
    next_runs: tuple[NextRun, ...] = ()
    candidates: tuple[CandidateSummary, ...] = ()
    untestable: dict[str, Remark] = field(default_factory=dict)
    notes: tuple[Remark, ...] = ()
    not_claimed: tuple[Remark, ...] = ()
    variance_components: dict[str, float] = field(default_factory=dict)
    misfit: NoiseAgreement | None = None
    trends: tuple[SoilTrend, ...] = ()
    gap_probability: float = 0.0
    remainder_probability: float = 0.0
    seed: int = 0
    curves: FittedReadings | None = field(default=None, metadata=ELSEWHERE)

    def report(self) -> Report:
        """Verdict, soil and effects, readings beside the model, where it disagrees, and by what."""
        from soilml.gap.report.report import gap_report

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

    @property
    def soil_tests(self) -> list[SoilTestAgreement]:
        """The tests of the model's soil, beside the soil before and after."""
        return soil_test_agreement(self.model, self.soil_before, self.soil_after)

    def as_json(self) -> dict[str, Any]:
        """The content of gap.json."""
        from soilml import __version__

        content: dict[str, Any] = as_json_entry(self)
        return content | {
            "soil_tests": as_json_entry(self.soil_tests),
            "soilml_version": __version__,
        }


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
