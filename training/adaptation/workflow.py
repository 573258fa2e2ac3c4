"""The whole adaptation: a gap, the hybrid model, a file trained on it, and its judgement."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from soilml.config.case import Case, read_case
from soilml.config.explanations import likeliest_with_effects
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.gap import gap
from soilml.gap.disagreements import OUTSIDE_PRIORS
from soilml.gap.held_out import RUNS_PER_HELD_OUT
from soilml.gap.report import gap_files
from soilml.identification.model_error_inputs import with_exact_model
from soilml.identification.trained_estimator import estimators_for_case, with_sensors_of
from soilml.io.atomic_files import create_folder, write_files
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.io.text_tables import csv_text
from soilml.onboard.estimator import Estimator
from soilml.onboard.table_estimates import sensor_errors_shown
from soilml.remarks import Remark
from soilml.report.page import Provenance, json_text, page, report_entry
from training.adaptation.board_file import FileNames, make_file
from training.adaptation.campaign import (
    DrivenRange,
    board_unknowns,
    recipe_text,
    sensor_effects,
    split_runs,
    untrainable_effects,
    with_fitted_soil,
    with_noise_of_log,
    within_carried_loads,
)
from training.adaptation.judgement import BoardCandidate, Judgement, check_lengths, judge
from training.adaptation.result import AdaptReport
from training.adaptation.steps import ResumableSteps
from training.adaptation.supported_errors import SupportedErrors, supported_errors

#: Statuses of a gap report with effects that the evidence supports.
CLAIMED = ("named", "partly-named", "class", "form-open")
#: Files of the folder, beside those of the two model files.
RESULT_FILES = ("report.html", "adapt.json")
ADAPTED, BEFORE = FileNames("adapted"), FileNames("before")
ADAPTED_MODEL = "adapted.toml"
SPLIT_FILES = ("campaign.csv", "kept_back.csv")
GAP_FILES = tuple(
    f"gap/{name}" for name in ("report.html", "gap.json", "model.toml", "next_runs.csv")
)
ROWS = 40_000  # Synthetic rows of each file, by default

Progress = Callable[[str, int, int], None]


def adapt(
    case: Case,
    table: Rows,
    folder: str | os.PathLike[str],
    *,
    suspected: bool = False,
    against: str | os.PathLike[str] | None = None,
    truth: Mapping[str, float] | None = None,
    rows: int = ROWS,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress = lambda text, done, total: None,
    model_name: str = "the model",
    origin: Provenance | None = None,
) -> AdaptReport:
    """Find what a model lacks, train a file for the board with it, and judge it on runs kept back.

    A quarter of the runs is kept back. The gap analysis of the others decides whether the model
    changes. Where it does, two files are trained alike, on the model as it was and as it is now,
    over soils of the priors and the slips and loads of the log. From the torque of the first rows
    of a run that was kept back, each estimates the soil, and its model predicts torque, drawbar
    pull and sinkage of the later rows. What a file does not estimate has the value of the fit to
    the campaign, in both models. The adapted file has errors of its model and sensors of sizes
    that the campaign supports (`supported_errors`); the old file is judged by the better of two
    answers, its own and that of the model taken as right.

    Of fewer than four runs none is kept back: a file is then trained and not judged, and what the
    gap analysis says of rows that it kept back itself is all that speaks for it.

    A call that was interrupted, or is repeated, keeps the steps whose inputs are the same.

    Parameters
    ----------
    case : Case
        Model of one gear, with priors and, where the table has none, noise.
    table : Table, data frame or mapping of columns
        Rows of four runs or more, as for `gap`.
    folder : path
        Where all files are written; it is created.
    suspected : bool
        Whether the first suspect counts where the evidence names no effect, and `gap` predicts rows
        kept back better with it.
    against : path, optional
        A model file for this wheel, or a released one by name, in the place of one trained on the
        model as it was.
    truth : mapping, optional
        True soil parameters by name, SI, where they are known; estimates are compared with them.
        Columns of the table such as `cohesion_Pa` count as well.
    rows : int
        Synthetic rows that each file is trained on.
    seed : int
        Of the runs that are kept back, the rows and the training.
    workers : int, optional
        Processes; one for each core by default.
    progress : callable, optional
        Called with the name of a stage, the steps done and the total number of steps.
    model_name, origin
        Name of the model file, and the command, for the reports.

    Returns
    -------
    AdaptReport
        Its status is `not-supported` where the analysis supports no change.

    Raises
    ------
    InputError
        For several gears, no row with slip above 0, noise of torque that is
        not known, no prior of cohesion, friction angle and shear modulus, or a recipe whose rows
        have no equilibrium.
    TableError
        For columns that contradict the case.

    Examples
    --------
    >>> from soilml import adapt, read_case, read_table
    >>> report = adapt(
    ...     read_case("model.toml"), read_table("runs.csv"), "adapted"
    ... )  # doctest: +SKIP
    >>> print(report.sentence)  # doctest: +SKIP
    The adapted file predicts kept-back runs with 0.31 of the error of the old one.
    """
    table = as_table(table)
    if case.gears:
        raise InputError(
            f"the model has several gears ({', '.join(case.gears)}), and a file for the board is "
            "for one: give a model with [gear], and the rows of that gear"
        )
    table = table.rows(table.answered)
    split, driven = split_runs(table, seed), DrivenRange.of(table, case)
    old = board_unknowns(with_noise_of_log(case, table))[0]
    earlier = _check_earlier(against, case, model_name)
    target = Path(folder)
    with create_folder(target), create_folder(target / "gap"):
        tables = [one for one in (split.campaign, split.kept_back) if one is not None]
        texts = [csv_text(one.columns) for one in tables]
        write_files({target / name: text for name, text in zip(SPLIT_FILES, texts, strict=False)})
        steps = ResumableSteps(target)
        steps.run(
            "gap",
            [case_as_toml(case), texts[0], str(seed)],
            GAP_FILES,
            lambda: _analyse(case, split.campaign, target, seed, progress, model_name, origin),
        )
        found = _read_gap(target / "gap", case, suspected)
        if found.refusal is not None:
            report = found.report(split.runs, None, (), rows, seed)
            return _finish(report, target, origin)
        if split.kept_back is not None:
            check_lengths(split.kept_back)
        new, remarks = board_unknowns(with_noise_of_log(found.case, table))
        for one in [new] if split.kept_back is None or against else [new, old]:
            driven, narrowed = within_carried_loads(driven, one, seed)
            remarks = [*remarks, *narrowed]
        head = [f"With {' + '.join(found.effects)}. {found.sentence}"]
        write_files({target / ADAPTED_MODEL: case_as_toml(found.case, head)})
        make = partial(make_file, steps, seed=seed, workers=workers, progress=progress)
        make_adapted = partial(make, ADAPTED, recipe_text(new, driven, rows, seed), as_c=True)
        if split.kept_back is None:
            make_adapted()
            report = found.report((), None, [*remarks, _unjudged(table)], rows, seed)
            return _finish(report, target, origin)
        errors = supported_errors(new, split.kept_back, table)
        remarks = [*remarks, _errors_remark(errors)]
        file = make_adapted(errors=errors)
        if earlier is None:
            before = make(BEFORE, recipe_text(old, driven, rows, seed))
            earlier = with_sensors_of(Estimator.load(before), old)
        progress("judging", 0, 1)
        own = with_fitted_soil(old, found.soil_before)
        after = BoardCandidate(with_sensors_of(Estimator.load(file), new), new)
        answers = [earlier, with_exact_model(earlier)]  # the old file is judged by the better one
        judgements = [
            judge(split.kept_back, BoardCandidate(answer, own), after, truth, seed=seed)
            for answer in answers[: 1 + (answers[1] is not earlier)]
        ]
        judgement = max(judgements, key=lambda one: one.ratio)
        if judgement is not judgements[0]:
            remarks.append(_exact_remark())
        progress("judging", 1, 1)
        report = found.report(split.runs, judgement, remarks, rows, seed)
        return _finish(report, target, origin, with_before=against is None)


@dataclass(frozen=True)
class AnalysedCampaign:
    """What the gap analysis of a campaign found, as its files state it.

    `case` is the model to train on; `refusal` says why there is none. `soil_before` has the soil of
    the fit without effects.
    """

    status: str
    sentence: str
    effects: tuple[str, ...]
    case: Case
    soil_before: dict[str, float]
    refusal: Remark | None

    def report(
        self,
        kept_back: tuple[str, ...],
        judgement: Judgement | None,
        remarks: tuple[Remark, ...] | list[Remark],
        rows: int,
        seed: int,
    ) -> AdaptReport:
        """The result of the adaptation, whose files are not written yet."""
        notes = list(remarks) + ([self.refusal] if self.refusal else [])
        effects: tuple[str, ...] = ()
        status = "not-supported"
        if self.refusal is None:
            effects, status = self.effects, "not-judged"
            notes += _sensor_remark(self.case)
        if judgement is not None:
            status = "adapted" if judgement.ratio < 1.0 else "not-better"
        return AdaptReport(
            status, self.status, self.sentence, effects, kept_back,
            judgement, (), tuple(notes), rows, seed,
        )  # fmt: skip


def _check_earlier(
    against: str | os.PathLike[str] | None, case: Case, model_name: str
) -> Estimator | None:
    """The file to compare with, for the case; `InputError` where it is of another wheel."""
    if against is None:
        return None
    given, _ = estimators_for_case([Estimator.load(against)], case, model_name, pooled=True)
    return given[0]


def _analyse(
    case: Case,
    campaign: Table,
    folder: Path,
    seed: int,
    progress: Progress,
    model_name: str,
    origin: Provenance | None,
) -> None:
    """Analyse the campaign and write the files of the gap."""
    stage = "analysing the gap"
    progress(stage, 0, 100)
    report = gap(
        case, campaign, seed=seed, progress=lambda share: progress(stage, round(100 * share), 100)
    )
    progress(stage, 100, 100)
    texts = gap_files(report, model_name, SPLIT_FILES[0], origin)
    write_files({folder / "gap" / name: text for name, text in texts.items()})


def _read_gap(folder: Path, case: Case, suspected: bool) -> AnalysedCampaign:
    """The gap of a campaign from its files, and whether it supports a change."""
    content = json.loads((folder / "gap.json").read_text(encoding="utf-8"))
    status = content["status"]
    found = likeliest_with_effects(
        read_case(folder / "model.toml", with_bias=True, with_explanations=True)
    )
    known = {effect.name for effect in case.model.effects}
    effects = tuple(e.name for e in found.model.effects if e.name not in known)
    refusal = None
    if not (status in CLAIMED or (status == "suspected" and suspected)) or not effects:
        text = f"the gap analysis ends with {status}, which supports no change of the model"
        refusal = Remark(f"gap-{status}", text, severity="note")
    elif any(one["code"] in ("prior-opened", OUTSIDE_PRIORS) for one in content["reasons"]):
        text = (
            "only soils outside of [soil.prior] explain the gap; give priors in which the "
            "soils to come lie, and in which gap/report.html finds that of the campaign"
        )
        refusal = Remark("prior-opened", text)
    elif needed := untrainable_effects(found):
        parts = [f"{effect} needs {', '.join(columns)}" for effect, columns in needed.items()]
        text = f"{'; '.join(parts)}, which a file for the board is not given: none can be trained"
        refusal = Remark("effect-not-trainable", text, tuple(needed))
    soil = {name: float(entry["value"]) for name, entry in content["soil_before"].items()}
    return AnalysedCampaign(status, content["sentence"], effects, found, soil, refusal)


def _sensor_remark(case: Case) -> list[Remark]:
    """A remark where what was added is an error of a sensor or of the rig."""
    names = tuple(effect.name for effect in sensor_effects(case))
    if not names:
        return []
    text = (
        f"{', '.join(names)}: an error of a sensor or of the rig; the adapted file is for readings "
        "of the same one alone"
    )
    return [Remark("sensor-error-trained", text, names)]


def _errors_remark(errors: SupportedErrors) -> Remark:
    """A note on the errors that the adapted file takes its model and sensors to have."""
    checked = errors.scales.scales[0]
    text = (
        f"the adapted file has errors of its model: {checked.bearing:g} of the usual ones with a "
        f"probability of {checked.probability:.2f}, as the campaign supports, else larger ones"
    )
    if errors.sensors:
        text += "; errors of its sensors have standard deviations of "
        text += sensor_errors_shown(errors.sensors)
    return Remark("model-errors", text, severity="note")


def _exact_remark() -> Remark:
    """A note on the answer by which the old file is judged."""
    text = (
        "the old file is judged assuming a perfect model (model_error 0), with which it "
        "predicts the runs kept back better than with its own errors of the model"
    )
    return Remark("old-model-right", text, severity="note")


def _unjudged(table: Table) -> Remark:
    """A remark on a campaign of which no run was kept back."""
    count = np.unique(table["run"]).size
    text = (
        f"{count} run{'s' * (count != 1)}: of {RUNS_PER_HELD_OUT} or more, a quarter is kept back "
        "and judges both files; here gap/report.html alone says how well rows are predicted, and "
        "the file has the usual errors of a model"
    )
    return Remark("few-runs", text)


def _finish(
    report: AdaptReport, folder: Path, origin: Provenance | None, with_before: bool = False
) -> AdaptReport:
    """Write page and JSON; files that an earlier call left, and this result lacks, are removed."""
    made: tuple[str, ...] = ()
    adapted = (*ADAPTED.model, *ADAPTED.code, ADAPTED_MODEL, ADAPTED.recipe, ADAPTED.rows)
    before = (*BEFORE.model, BEFORE.recipe, BEFORE.rows)
    if report.status != "not-supported":
        made = (*adapted, *(before if with_before else ()))
    parts = SPLIT_FILES if report.kept_back else SPLIT_FILES[:1]
    report = replace(report, files=(*made, *parts, *GAP_FILES[:4]))
    if origin is None:
        origin = Provenance.of(["adapt"], [])
    shown = report.report()
    content = report.as_json() | {"report": report_entry(shown, origin)}
    stale = [n for n in (*adapted, *before, *SPLIT_FILES) if n not in (*made, *parts)]
    write_files(
        {
            folder / RESULT_FILES[0]: page(shown, origin),
            folder / RESULT_FILES[1]: json_text(content),
        },
        remove=[folder / name for name in stale],
    )
    return report
