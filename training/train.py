"""Training: fit, recalibrate, fuse and measure the regressors of a spec."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from datagen.recipe import parse_recipe
from soilml.arrays import Floats
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.held_out_errors import HeldOutErrors
from training.calibration.recalibration import measure_held_out
from training.calibration.training_domain import TrainingDomain
from training.cross_fit import CrossFit, cross_fit
from training.dataset import Dataset
from training.set_posterior.families.recipe_family import RecipeFamily
from training.set_posterior.families.wheel_family import WheelFamily
from training.set_posterior.graph import SetPosteriorGraph
from training.set_posterior.response_surface import ResponseSettings, fit_response
from training.set_posterior.row_inputs import FileNoise
from training.set_posterior.validation import (
    NO_LIMITS,
    SetFigures,
    validate_posterior,
    with_misfit_limits,
)
from training.spec import Spec

Progress = Callable[[str, int, int], None]

#: Called with the name of a stage, the steps done and the total number of steps.
#: A set posterior and its metrics by number of rows.
TrainedSetPosterior = tuple[SetPosteriorGraph, dict[int, SetFigures]]


@dataclass(frozen=True)
class TrainedModel(CrossFit):
    """A trained model, what its file needs, and its metrics on rows left out."""

    spec: Spec  # what it was trained from
    domain: TrainingDomain  # where estimates are in range
    prior: PriorSummary  # prior of the targets
    data: Dataset
    errors: HeldOutErrors | None = None  # on rows left out, for targets that differ between rows
    #: posterior of several rows, where the spec asks for it
    set_posterior: SetPosteriorGraph | None = None
    #: its metrics by number of rows
    set_figures: dict[int, SetFigures] = field(default_factory=dict)

    def predict(self, features: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Mean, standard deviation (n, q) and in-range flag (n,), as in the exported file.

        Out of range, mean and standard deviation are those of the prior.
        """
        mean, std = self.estimator.predict(features)
        inside = self.domain.contains(features)
        clipped = np.clip(mean, self.prior.lower, self.prior.upper)
        return (
            np.where(inside[:, None], clipped, self.prior.mean),
            np.where(inside[:, None], std, self.prior.std),
            inside,
        )


def train(
    spec: Spec, data: Dataset, progress: Progress = lambda text, done, total: None
) -> TrainedModel:
    """Fit and recalibrate every regressor of a spec, fuse them, and measure the result.

    Every row is learned from. Every row also calibrates: the errors that standard deviations,
    fusion and metrics rest on are those of fits that have not seen the row's run
    (`training.cross_fit`).

    Parameters
    ----------
    spec : Spec
        From `read_spec`; its regressors are fitted in place.
    data : Dataset
        From `read_dataset`, with the features and targets of the spec.
    progress : callable
        Called with the name of a stage, the steps done and the total number of steps.

    Returns
    -------
    TrainedModel

    Raises
    ------
    InputError
        Where a regressor does not converge.

    Examples
    --------
    >>> from training.dataset import read_dataset
    >>> from training.spec import read_spec
    >>> spec = read_spec("linear")
    >>> data = read_dataset("data.parquet", spec.features, spec.targets)  # doctest: +SKIP
    >>> train(spec, data).scores["estimator"].relative  # doctest: +SKIP
    array([0.943, 0.881, 0.688])
    """
    prior = PriorSummary(
        data.targets.mean(axis=0), data.targets.std(axis=0), data.lower, data.upper
    )
    # first, because it refuses loads that the soils do not carry
    set_posterior: SetPosteriorGraph | None = None
    set_figures: dict[int, SetFigures] = {}
    if spec.set_posterior is not None:
        family = RecipeFamily.of(parse_recipe(data.recipe, "recipe of the data"), spec.targets)
        noise = family.declared_noise()
        set_posterior, set_figures = train_sets(family, spec.set_posterior, noise, progress)
    found = cross_fit(spec, data, prior, progress)
    left, errors = found.left_out, None
    if spec.per_row:
        mean = np.clip(left.mean, prior.lower, prior.upper)
        # with few runs, all rows are kept
        rows = replace(data, run=np.arange(len(data))) if left.few else data
        errors = measure_held_out(mean, left.std, rows)
    return TrainedModel(
        **vars(found),
        spec=spec,
        domain=TrainingDomain.of(data.features, spec.features, spec.seed, left.few),
        prior=prior,
        data=data,
        errors=errors,
        set_posterior=set_posterior,
        set_figures=set_figures,
    )


def train_sets(
    family: WheelFamily, settings: ResponseSettings, noise: FileNoise, progress: Progress
) -> TrainedSetPosterior:
    """The set posterior of a family, and its metrics on fresh sets; `noise` is the file's own."""
    posterior = SetPosteriorGraph(
        family, fit_response(family, settings, progress), NO_LIMITS, noise, settings.small,
        settings.scales, settings.sensor_errors,
    )  # fmt: skip
    posterior = with_misfit_limits(posterior, progress)
    return posterior, validate_posterior(posterior, progress)
