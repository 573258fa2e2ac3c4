"""The result of a gap analysis."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from soilml.config.case import Case
from soilml.gap.report_parts import (
    CandidateSummary,
    Discrepancy,
    EstimatedValue,
    GapReduction,
    NamedEffect,
    NextRun,
    ReadingsAndPredictions,
    RemainingDiscrepancy,
    Suspect,
)
from soilml.gap.soil_test_agreement import SoilTestAgreement, soil_test_agreement

#: Status of a report, and its meaning.
STATUSES = {
    "no-gap": "model and measurements agree within the noise",
    "named": "exactly one explanation of the catalogue accounts for the gap",
    "partly-named": "the evidence supports these effects; a smooth remainder is left unexplained",
    "class": "several explanations account for the gap; these runs cannot distinguish them",
    "form-open": "one effect accounts for the gap, with a law that differs from the catalogue's",
    "suspected": "ranked suspects: no cause can be named",
    "unknown": "there is a gap, and no effect of the catalogue explains it",
    "undecided": "measurements disagree with each other more than their noise allows",
    "not-testable": "there is a gap, but these runs cannot identify its cause",
    "bad-data": "the data cannot be analysed",
}


@dataclass(frozen=True)
class GapReport:
    """The result of a gap analysis, made by `soilml.gap.gap`.

    Attributes
    ----------
    status : str
        One of `STATUSES`.
    sentence : str
        The verdict in one sentence.
    model : Case
        The fitted model; it contains an effect only where one is claimed.
    effects : tuple of NamedEffect
        The effects that were added.
    cause_set : tuple of tuple of str
        The explanations that the data do not reject, as sets of effect names, the best first.
    probabilities : dict of float
        Posterior probability of each tested effect.
    suspects : tuple of Suspect
        Explanations with their odds, the likeliest first, wherever there is a gap.
    discrepancy : dict of RemainingDiscrepancy
        Smooth discrepancy of each channel before and after, by column.
    best_unclaimed : tuple of str
        The explanation that is likeliest where no cause is claimed; it is not in `model`.
    suspected_model : Case, optional
        The model with the likeliest suspect, where the status is `suspected`.
    reasons : tuple of str
        Why no cause can be named, or why the data cannot be analysed.
    where : tuple of Discrepancy
        Regions of the data, the largest disagreement first.
    gap : dict of GapReduction
        Figures of the fitted rows (`train`) and of held-out runs and regions, before and after
        adding what is named or first among the suspects.
    soil_before, soil_after : dict of EstimatedValue
        Soil parameters without and with the added effects.
    mimic_radius : float
        Largest cosine between the signature of an added effect and that of another one.
    next_runs : tuple of NextRun
        Proposed runs and checks, the most discriminating first.
    candidates : tuple of CandidateSummary
        All fitted candidates, the best first.
    untestable : dict of str
        Effects that these runs cannot test, with the reason.
    not_claimed : tuple of str
        Conclusions that the report does not support.
    variance_components : dict of float
        Estimated noise scales, run-to-run standard deviations and autocorrelation.
    residual_trend : dict of float
        Unexplained smooth trend by channel, in sigma.
    p_gap, p_residual : float
        Family-wise p values of the soil alone and of the best candidate.
    """

    status: str
    sentence: str
    model: Case
    effects: tuple[NamedEffect, ...] = ()
    cause_set: tuple[tuple[str, ...], ...] = ()
    probabilities: dict[str, float] = field(default_factory=dict)
    suspects: tuple[Suspect, ...] = ()
    discrepancy: dict[str, RemainingDiscrepancy] = field(default_factory=dict)
    best_unclaimed: tuple[str, ...] = ()
    suspected_model: Case | None = None
    reasons: tuple[str, ...] = ()
    where: tuple[Discrepancy, ...] = ()
    gap: dict[str, GapReduction] = field(default_factory=dict)
    soil_before: dict[str, EstimatedValue] = field(default_factory=dict)
    soil_after: dict[str, EstimatedValue] = field(default_factory=dict)
    mimic_radius: float = 0.0
    next_runs: tuple[NextRun, ...] = ()
    candidates: tuple[CandidateSummary, ...] = ()
    untestable: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    not_claimed: tuple[str, ...] = ()
    variance_components: dict[str, float] = field(default_factory=dict)
    residual_trend: dict[str, float] = field(default_factory=dict)
    p_gap: float = 1.0
    p_residual: float = 1.0
    seed: int = 0
    curves: ReadingsAndPredictions | None = None

    def plot(self, ax: Any = None, part: str = "train") -> Any:
        """Draw the mean squared residuals of all readings and of each channel, before and after.

        Parameters
        ----------
        ax
            Axes of matplotlib; a new figure where None.
        part
            A key of `gap`: the fitted rows (`train`), or a held-out part.

        Returns
        -------
        Axes

        Raises
        ------
        InputError
            For a part that the report does not have, or several axes.
        """
        from soilml.gap.gap_figure import plot_gap

        return plot_gap(self.gap, ax, part)

    @property
    def soil_tests(self) -> list[SoilTestAgreement]:
        """The tests of the model's soil, beside the soil before and after."""
        return soil_test_agreement(self.model, self.soil_before, self.soil_after)

    def as_json(self) -> dict[str, Any]:
        """The content of gap.json."""
        from soilml import __version__

        return {
            "status": self.status,
            "sentence": self.sentence,
            "effects": [e.as_json() for e in self.effects],
            "cause_set": [list(names) for names in self.cause_set],
            "fits_best_but_not_claimed": list(self.best_unclaimed),
            "reasons": list(self.reasons),
            "probabilities": self.probabilities,
            "suspects": [s.as_json() for s in self.suspects],
            "discrepancy": {name: d.as_json() for name, d in self.discrepancy.items()},
            "where": [w.as_json() for w in self.where],
            "gap": {name: figures.as_json() for name, figures in self.gap.items()},
            "p_gap": self.p_gap,
            "p_left": self.p_residual,
            "soil": {
                "before": {k: v.as_json() for k, v in self.soil_before.items()},
                "after": {k: v.as_json() for k, v in self.soil_after.items()},
            },
            "soil_tests": [test.as_json() for test in self.soil_tests],
            "mimic_radius": self.mimic_radius,
            "candidates": [t.as_json() for t in self.candidates],
            "next_runs": [
                {"kind": n.kind, "text": n.text, "separates_sigma": n.discrimination}
                | ({} if n.cost is None else {"cost": n.cost})
                for n in self.next_runs
            ],
            "unnamed_remainder": self.residual_trend,
            "not_testable": self.untestable,
            "scatter": self.variance_components,
            "notes": list(self.notes),
            "not_claimed": list(self.not_claimed),
            "seed": self.seed,
            "soilml_version": __version__,
        }
