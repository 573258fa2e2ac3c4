"""The whole adaptation: a gap, the hybrid model, a file trained on it, and its judgement."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import onnx

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml.config.case import Case, read_case
from soilml.config.explanations import likeliest_with_effects
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.gap import GapReport, gap
from soilml.gap.held_out import RUNS_PER_HELD_OUT
from soilml.gap.report import gap_files
from soilml.identification.model_error_inputs import with_exact_model
from soilml.identification.trained_estimator import estimators_for_case, with_sensors_of
from soilml.io.atomic_files import atomic_outputs, create_folder, save_text, write_files
from soilml.io.read_table import Rows, as_table
from soilml.io.text_tables import csv_text
from soilml.onboard.estimator import Estimator
from soilml.onboard.table_estimates import sensor_errors_shown
from soilml.physics.operating_point import COVARIATES
from soilml.processes import limited_workers, process_map
from soilml.quantities import SHEAR
from soilml.remarks import Remark
from soilml.report.page import Provenance, json_text, page, report_entry
from training.adaptation.campaign import (
    DrivenRange,
    board_unknowns,
    recipe_text,
    split_runs,
    with_noise_of_log,
    within_carried_loads,
)
from training.adaptation.judgement import BoardCandidate, Judgement, check_lengths, judge
from training.adaptation.result import AdaptReport
from training.adaptation.supported_errors import USUAL_ERRORS, SupportedErrors, supported_errors
from training.dataset import read_dataset
from training.export.model_card import model_card
from training.export.model_file import export_model
from training.export_c.c_file import write_c
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.response_surface import check_equilibria
from training.spec import read_spec
from training.train import train

#: Statuses of a gap report with effects that the evidence supports.
CLAIMED = ("named", "partly-named", "class", "form-open")
SPEC = "fused"  # The packaged spec of a file: that of the released file for one wheel
ROWS = 40_000  # Synthetic rows of each file, by default
SPLIT_FILES = ("campaign.csv", "kept_back.csv")
GAP_FILES = tuple(
    f"gap/{name}" for name in ("report.html", "gap.json", "model.toml", "next_runs.csv")
)
ADAPTED_FILES = (
    *("adapted.onnx", "adapted.md", "adapted.c", "adapted.h", "adapted.toml"),
    *("adapted_recipe.toml", "adapted_rows.parquet"),
)
BEFORE_FILES = ("before.onnx", "before.md", "before_recipe.toml", "before_rows.parquet")

Progress = Callable[[str, int, int], None]


def adapt(
    case: Case,
    table: Rows,
    folder: str | os.PathLike[str],
    *,
    suspected: bool = False,
    against: str | os.PathLike[str] | None = None,
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
    earlier = None
    if against is not None:
        given = [Estimator.load(against)]
        earlier = estimators_for_case(given, case, model_name, pooled=True)[0][0]
    target, remarks = Path(folder), list[Remark]()
    judgement: Judgement | None = None
    with create_folder(target), create_folder(target / "gap"):
        parts = [one for one in (split.campaign, split.kept_back) if one is not None]
        split_files = SPLIT_FILES[: len(parts)]
        texts = (csv_text(one.columns) for one in parts)
        write_files({target / n: text for n, text in zip(split_files, texts, strict=True)})
        stage = "analysing the gap"
        progress(stage, 0, 100)
        found = gap(
            case,
            split.campaign,
            seed=seed,
            progress=lambda share: progress(stage, round(100 * share), 100),
        )
        files = gap_files(found, model_name, SPLIT_FILES[0], origin)
        write_files({target / "gap" / name: text for name, text in files.items()})
        model = target / "gap/model.toml"
        learned = likeliest_with_effects(read_case(model, with_bias=True, with_explanations=True))
        known = {effect.name for effect in case.model.effects}
        effects = tuple(e.name for e in learned.model.effects if e.name not in known)
        made: tuple[str, ...] = ()
        if (refusal := _refusal(found, learned, effects, suspected)) is not None:
            status, effects, remarks = "not-supported", (), [refusal]
        else:
            status, made = "not-judged", ADAPTED_FILES
            if split.kept_back is not None:
                check_lengths(split.kept_back)
            new, remarks = board_unknowns(with_noise_of_log(learned, table))
            for one in [new] if split.kept_back is None or against else [new, old]:
                driven, narrowed = within_carried_loads(driven, one, seed)
                remarks = [*remarks, *narrowed]
            head = [f"With {' + '.join(effects)}. {found.sentence}"]
            write_files({target / "adapted.toml": case_as_toml(learned, head)})
            make = partial(make_file, target, seed=seed, workers=workers, progress=progress)
            recipe, errors = recipe_text(new, driven, rows, seed), USUAL_ERRORS
            if split.kept_back is not None:
                errors = supported_errors(new, split.kept_back, table)
                remarks.append(_errors_remark(errors))
            file = make("adapted", recipe, errors=errors, as_c=True)
            if split.kept_back is None:
                remarks.append(_unjudged(np.unique(table["run"]).size))
            else:
                if earlier is None:
                    made = (*made, *BEFORE_FILES)
                    before = make("before", recipe_text(old, driven, rows, seed))
                    earlier = with_sensors_of(Estimator.load(before), old)
                progress("judging", 0, 1)
                fitted = {n: v.value for n, v in found.soil_before.items() if n in old.parameters()}
                own = old.with_values(fitted)
                after = BoardCandidate(with_sensors_of(Estimator.load(file), new), new)
                exact = with_exact_model(earlier)  # the old file is judged by its better answer
                judgements = [
                    judge(split.kept_back, BoardCandidate(answer, own), after, seed=seed)
                    for answer in ([earlier] if exact is earlier else [earlier, exact])
                ]
                judgement = max(judgements, key=lambda one: one.ratio)
                if judgement is not judgements[0]:
                    remarks.append(OLD_MODEL_RIGHT)
                progress("judging", 1, 1)
                status = "adapted" if judgement.ratio < 1.0 else "not-better"
            remarks += _sensor_remark(learned)
        report = AdaptReport(
            status, found.status, found.sentence, effects, split.runs,
            judgement, (*made, *split_files, *GAP_FILES), tuple(remarks), rows, seed,
        )  # fmt: skip
        origin = origin or Provenance.of(["adapt"], [])
        shown = report.report()
        content = report.as_json() | {"report": report_entry(shown, origin)}
        stale = {*ADAPTED_FILES, *BEFORE_FILES, *SPLIT_FILES} - set(report.files)
        write_files(
            {
                target / "report.html": page(shown, origin),
                target / "adapt.json": json_text(content),
            },
            remove=[target / name for name in sorted(stale)],
        )
    return report


def make_file(
    folder: Path,
    name: str,
    recipe: str,
    *,
    seed: int,
    errors: SupportedErrors = USUAL_ERRORS,
    workers: int | None = None,
    as_c: bool = False,
    progress: Progress = lambda text, done, total: None,
) -> Path:
    """Generate the rows of a recipe, train a set posterior on them and export it, with its card.

    name: Beginning of the names of its files in the folder.
    recipe: Text of the recipe; see `training.adaptation.campaign.recipe_text`.
    seed: Of the training.
    errors: Sizes of the errors of its model and sensors.
    as_c: Whether C code is written as well.

    Returns: The path of the model file.
    Raises `InputError` for a recipe that a set posterior cannot have, or whose rows have no
    equilibrium.
    """
    save_text(folder / f"{name}_recipe.toml", recipe)
    found, spec = read_recipe(folder / f"{name}_recipe.toml"), read_spec(SPEC)
    targets = tuple(target for target in SHEAR if target in found.case.prior)
    content = json.loads(spec.text) | {"targets": list(targets), "seed": seed}
    if errors is not USUAL_ERRORS:
        stated = {"model_errors": errors.scales.as_list(), "sensor_errors": errors.sensors}
        content["set_posterior"] |= stated
    assert spec.set_posterior is not None
    own = replace(spec.set_posterior, seed=seed, scales=errors.scales, sensor_errors=errors.sensors)
    text = json.dumps(content, sort_keys=True)
    spec = replace(spec, seed=seed, targets=targets, set_posterior=own, text=text)
    # raises before rows are simulated and the training begins
    check_equilibria(RecipeFamily.of(found, spec.targets), seed)
    rows = folder / f"{name}_rows.parquet"
    engine = partial(process_map, workers=workers)
    generate(found, rows, lambda done: progress(f"{name}: simulating", done, found.rows), engine)
    names = (f"{name}.onnx", f"{name}.md", f"{name}.c", f"{name}.h")
    with limited_workers(workers):
        data = read_dataset(rows, spec.features, spec.targets)
        trained = train(spec, data, lambda text, *steps: progress(f"{name}: {text}", *steps))
        with atomic_outputs([folder / one for one in names[: 4 if as_c else 2]]) as outputs:
            metadata = export_model(trained, outputs[0], rows)
            outputs[1].write_text(model_card(trained, metadata, name), encoding="utf-8")
            if as_c:
                written = write_c(onnx.load(str(outputs[0])), metadata, name, names[0])
                outputs[2].write_text(written.source, encoding="utf-8")
                outputs[3].write_text(written.header, encoding="utf-8")
    return folder / names[0]


def _refusal(
    found: GapReport, learned: Case, effects: tuple[str, ...], suspected: bool
) -> Remark | None:
    """Why the gap analysis supports no model that a file can be trained on; None where it does."""
    status = found.status
    if not (status in CLAIMED or (status == "suspected" and suspected)) or not effects:
        text = f"the gap analysis ends with {status}, which supports no change of the model"
        return Remark(f"gap-{status}", text, severity="note")
    if any(one.code in ("prior-opened", "soil-outside-priors") for one in found.reasons):
        text = (
            "only soils outside of [soil.prior] explain the gap; give priors in which the "
            "soils to come lie, and in which gap/report.html finds that of the campaign"
        )
        return Remark("prior-opened", text)
    needed = {e.name: e.about.needs for e in learned.model.effects if e.about.needs}
    if needed:
        parts = [f"{n} needs {', '.join(COVARIATES[f] for f in own)}" for n, own in needed.items()]
        text = f"{'; '.join(parts)}, which a file for the board is not given: none can be trained"
        return Remark("effect-not-trainable", text, tuple(needed))
    return None


def _sensor_remark(case: Case) -> list[Remark]:
    """A remark where what was added is an error of a sensor or of the rig."""
    names = tuple(e.name for e in case.model.effects if e.about.kind in ("sensor", "rig"))
    text = (
        f"{', '.join(names)}: an error of a sensor or of the rig; the adapted file is for readings "
        "of the same one alone"
    )
    return [Remark("sensor-error-trained", text, names)] if names else []


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


OLD_MODEL_RIGHT = Remark(
    "old-model-right",
    "the old file is judged assuming a perfect model (model_error 0), with which it predicts the "
    "runs kept back better than with its own errors of the model",
    severity="note",
)


def _unjudged(runs: int) -> Remark:
    """A remark on a campaign of which no run was kept back."""
    text = (
        f"{runs} run{'s' * (runs != 1)}: of {RUNS_PER_HELD_OUT} or more, a quarter is kept back "
        "and judges both files; here gap/report.html alone says how well rows are predicted, and "
        "the file has the usual errors of a model"
    )
    return Remark("few-runs", text)
