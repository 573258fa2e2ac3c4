"""A model file for the board from a recipe: rows, training, ONNX with its card, and C."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import onnx

from datagen.generate import generate
from datagen.recipe import Recipe, read_recipe
from soilml.io.atomic_files import atomic_outputs, save_text
from soilml.processes import limited_workers, process_map
from soilml.quantities import SHEAR
from training.adaptation.steps import ResumableSteps
from training.adaptation.supported_errors import USUAL_ERRORS, SupportedErrors
from training.dataset import read_dataset
from training.export.model_card import model_card
from training.export.model_file import export_model
from training.export_c.c_file import write_c
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.response_surface import check_equilibria
from training.spec import Spec, read_spec
from training.train import train

Progress = Callable[[str, int, int], None]

SPEC = "fused"  # The packaged spec of a file: that of the released file for one wheel
C_ROWS = 32  # Most rows of one step of the C code


@dataclass(frozen=True)
class FileNames:
    """The files of one model file, which begin with its name."""

    name: str

    @property
    def recipe(self) -> str:
        """Recipe of its rows."""
        return f"{self.name}_recipe.toml"

    @property
    def rows(self) -> str:
        """Its synthetic rows."""
        return f"{self.name}_rows.parquet"

    @property
    def model(self) -> tuple[str, str]:
        """The model file and its card."""
        return f"{self.name}.onnx", f"{self.name}.md"

    @property
    def code(self) -> tuple[str, str]:
        """C code and its header."""
        return f"{self.name}.c", f"{self.name}.h"


def make_file(
    steps: ResumableSteps,
    names: FileNames,
    recipe: str,
    *,
    seed: int,
    errors: SupportedErrors = USUAL_ERRORS,
    workers: int | None = None,
    as_c: bool = False,
    progress: Progress = lambda text, done, total: None,
) -> Path:
    """Generate the rows of a recipe, train a set posterior on them and export it; resumes.

    recipe: Text of the recipe; see `training.adaptation.campaign.recipe_text`.
    seed: Of the training.
    errors: Sizes of the errors of its model and sensors.
    workers: Processes; one for each core by default.
    as_c: Whether C code is written as well.

    Returns: The path of the model file.
    Raises `InputError` for a recipe that a set posterior cannot have, or whose rows have no
    equilibrium.
    """
    folder = steps.folder
    save_text(folder / names.recipe, recipe)
    found = read_recipe(folder / names.recipe)
    spec = _spec(found, seed, errors)
    # both raise before rows are simulated and the training begins
    check_equilibria(RecipeFamily.of(found, spec.targets), seed)
    rows, model = folder / names.rows, folder / names.model[0]
    stage = f"{names.name}: simulating"
    steps.run(
        f"{names.name}: rows",
        [recipe],
        [names.rows],
        lambda: generate(
            found,
            rows,
            lambda done: progress(stage, done, found.rows),
            partial(process_map, workers=workers),
        ),
    )

    def learn() -> None:
        with limited_workers(workers):
            _train(spec, folder, names, progress)

    steps.run(f"{names.name}: file", [spec.text, rows], names.model, learn)
    if as_c:
        steps.run(f"{names.name}: C", [model], names.code, lambda: _write_c(folder, names))
    return model


def _spec(recipe: Recipe, seed: int, errors: SupportedErrors) -> Spec:
    """The packaged spec for those of its targets that vary, with this seed and these errors."""
    spec = read_spec(SPEC)
    assert spec.set_posterior is not None
    targets = tuple(name for name in SHEAR if name in recipe.case.prior)
    content = json.loads(spec.text) | {"targets": list(targets), "seed": seed}
    if errors != USUAL_ERRORS:
        stated = {"model_errors": errors.scales.as_list(), "sensor_errors": errors.sensors}
        content["set_posterior"] |= stated
    return replace(
        spec,
        seed=seed,
        targets=targets,
        set_posterior=replace(
            spec.set_posterior, seed=seed, scales=errors.scales, sensor_errors=errors.sensors
        ),
        text=json.dumps(content, sort_keys=True),
    )


def _train(spec: Spec, folder: Path, names: FileNames, progress: Progress) -> None:
    data = read_dataset(folder / names.rows, spec.features, spec.targets)
    trained = train(
        spec, data, lambda text, done, total: progress(f"{names.name}: {text}", done, total)
    )
    with atomic_outputs([folder / name for name in names.model]) as (model, card):
        metadata = export_model(trained, model, folder / names.rows)
        card.write_text(model_card(trained, metadata, names.name), encoding="utf-8")


def _write_c(folder: Path, names: FileNames) -> None:
    from soilml.onboard.estimator import Estimator

    file = folder / names.model[0]
    metadata = Estimator.load(file).metadata
    written = write_c(onnx.load(str(file)), metadata, names.name, file.name, C_ROWS)
    with atomic_outputs([folder / name for name in names.code]) as (source, header):
        source.write_text(written.source, encoding="utf-8")
        header.write_text(written.header, encoding="utf-8")
