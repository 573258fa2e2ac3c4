"""Equally weighted draws of soil parameters: of the prior, of rows, of a model file's estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.compatibility import (
    check_wheel_size,
    effect_differences,
    gear_differences,
    recipe_case,
    value_differences,
)
from soilml.config.explanations import one_of
from soilml.errors import FitError, InputError
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.covariance import Whitening
from soilml.fitting.misfit import excess_residuals_remark
from soilml.fitting.mixtures import with_all_effects
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.fit import ignored_soil_tests
from soilml.identification.model_error_inputs import (
    model_error_remarks,
    readings_with_model_error,
    with_stated_model_error,
)
from soilml.identification.posterior import (
    PosteriorSamples,
    check_declared,
    posterior_samples,
    prior_fractions,
)
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.io.table import Table
from soilml.numerics.importance_sampling import importance_sample
from soilml.numerics.maximum_entropy import moment_matched_weights
from soilml.numerics.prior import Prior
from soilml.numerics.quantiles import systematic_resampling
from soilml.onboard.estimator import Estimator
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.traction.draws import SoilDraws
from soilml.traction.model_errors import LeftByDraws, drawn_errors, learned, stated_size
from soilml.traction.posterior_draws import posterior_draws_of

#: Where the soil of rows is drawn without a remainder that was learned from them.
DRAWN_WITHOUT = Remark(
    "same-rows",
    "[remainder] was learned from rows of this table, which would count twice: it is left out, and "
    "drawn anew from the rows",
    severity="note",
)
#: Number of draws: the probability below a 5 % quantile of as many has a standard error of 1.1 %.
DRAWS = 400


def posterior_draws(
    case: Case, readings: Readings, free: Sequence[Coordinate], count: int = DRAWS, seed: int = 0
) -> tuple[SoilDraws, PosteriorSamples]:
    """Draws of the posterior of the rows, and the weighted samples that they come from.

    Raises `FitError` as the posterior method does.
    """
    found = posterior_samples(case, readings.thinned(), free)
    return _soil_draws(free, found.sample.u[found.equally_weighted(count, seed)]), found


def prior_draws(
    free: Sequence[Coordinate], count: int = DRAWS, case: Case | None = None
) -> SoilDraws:
    """Draws of the priors by Latin hypercube; tests of the case's soil take part."""
    return _soil_draws(free, prior_fractions(free, count, np.random.default_rng(0), case))


def mixed_prior_draws(case: Case, count: int) -> tuple[Case, SoilDraws]:
    """Draws of the priors of all explanations by their weights, and the case that has them all."""
    each = [case.of_explanation(one) for one in case.explanations]
    weights = np.asarray([one.weight for one in case.explanations])
    place = systematic_resampling(weights / weights.sum(), count, 0.5)
    whole = with_all_effects(case, each)
    paths = list(dict.fromkeys(path for own in each for path in own.numbers))
    paths = [path for path in paths if not path.startswith(("gear.", "gears."))]
    values = np.tile([float(whole.numbers[path]) for path in paths], (count, 1))
    for i, own in enumerate(each):
        rows = np.flatnonzero(place == i)
        known = {
            path: np.asarray(float(own.numbers[path])) for path in paths if path in own.numbers
        }
        if len(rows) and own.prior:
            drawn = prior_draws(select_free(own, None), len(rows), own)
            known |= {path: drawn.values[:, k] for k, path in enumerate(drawn.names)}
        for path, value in known.items():
            values[rows, paths.index(path)] = value
    return whole, SoilDraws(tuple(paths), values)


def _soil_draws(free: Sequence[Coordinate], u: Floats) -> SoilDraws:
    values = np.stack([f.prior.at(u[:, i]) for i, f in enumerate(free)], axis=1)
    return SoilDraws(tuple(f.path for f in free), values)


def estimated_draws(
    free: Sequence[Coordinate], mean: Floats, covariance: Floats, count: int = DRAWS
) -> SoilDraws:
    r"""Draws of the maximum-entropy density in the prior with this mean (p,) and covariance (p, p).

    .. math:: p(u) \propto \exp(\lambda^\top u + u^\top \Lambda u), \quad u \in [0, 1]^p

    A narrow estimate gives a Gaussian, one as wide as the prior the uniform prior itself, which a
    truncated Gaussian does not. Moments that no density in the range has are met as nearly as
    samples allow. Priors must be uniform, not logarithmic.

    Raises `InputError` for a covariance that is not positive definite, or a mean outside the range.

    References: Jaynes, Phys. Rev. 106, 1957.
    """
    low = np.asarray([f.prior.lower for f in free])
    width = np.asarray([f.prior.upper for f in free]) - low
    middle, spread = (mean - low) / width, covariance / np.outer(width, width)
    if not (np.isfinite(spread).all() and np.linalg.eigvalsh(spread).min() > 0.0):
        raise InputError("the covariance of the estimate is not positive definite")
    if not ((middle >= 0.0) & (middle <= 1.0)).all():
        name = free[int(np.argmax(np.abs(middle - 0.5)))].path
        raise InputError(f"the estimate of {name} lies outside its prior")
    factor = np.linalg.cholesky(spread)

    def white(u: Floats) -> Floats:
        return np.asarray(np.linalg.solve(factor, (u - middle).T).T)

    found = importance_sample(lambda u: -0.5 * (white(u) ** 2).sum(axis=1), len(free))
    weights = moment_matched_weights(found.weights, white(found.u))
    rows = systematic_resampling(weights, count, np.random.default_rng(0).random())
    return SoilDraws(tuple(f.path for f in free), low + width * found.u[rows])


@dataclass(frozen=True, eq=False)
class MeasuredSoil:
    """What predicts on the soil of measured rows.

    case: The case whose parameters the draws give; of several explanations, with all their effects.
    draws: Draws of these parameters.
    unknown: The parameters that were unknown.
    readings: What was measured, beyond whose range errors fade.
    left: What the draws leave of the readings.
    spread: Factor on the standard deviations of errors given the readings.
    """

    case: Case
    draws: SoilDraws
    unknown: Sequence[Coordinate]
    warnings: tuple[Remark, ...]
    readings: Readings
    left: Sequence[LeftByDraws]
    spread: float = 1.0

    def with_errors(
        self, slip: Floats, load: Sequence[float], channels: Sequence[str]
    ) -> tuple[SoilDraws, SoilDraws]:
        """Draws given the rows, and of the prior, with the errors of these channels.

        slip, load: Slips and loads (N) at which errors are asked for.
        """
        found = drawn_errors(self.case, self.readings, self.left, slip, load, channels, self.spread)
        after, before = found or (None, None)
        prior = prior_draws(self.unknown, case=self.case)
        return replace(self.draws, errors=after), replace(prior, errors=before)


def estimated_soil(estimator: Estimator, case: Case, table: Table) -> MeasuredSoil:
    """The soil by a trained file, whose priors are those of the parameters.

    Raises `InputError` where the file is for another gear or estimates a parameter that the case
    lacks, and `FitError` where no row has all its readings.
    """
    warnings = _check_case(estimator, case)
    known, prior = case.parameters(), estimator.prior
    for name in estimator.names:
        if name not in known:
            raise InputError(f"{estimator.path} estimates {name}; the model has {', '.join(known)}")
    free = [
        Coordinate(name, unit, Prior(float(low), float(high)), float(known[name][1]), assumed=False)
        for name, unit, low, high in zip(
            estimator.names, estimator.units, prior.lower, prior.upper, strict=True
        )
    ]
    inputs = {name: table[column(name)] for name in estimator.inputs}
    complete = np.all([np.isfinite(values) for values in inputs.values()], axis=0)
    if not complete.any():
        names = ", ".join(column(name) for name in estimator.inputs)
        raise FitError(f"{table.source}: no row has all of {names}, which {estimator.path} reads")
    readings = {name: values[complete] for name, values in inputs.items()}
    readings = readings_with_model_error(estimator, readings, case, together=True)
    warnings += model_error_remarks(estimator, case, pooled=True)
    warnings += ignored_soil_tests(case)
    estimate = with_stated_model_error(estimator, case).run(**readings)
    if estimate.in_range and (aside := int(estimate.rows_set_aside)):
        text = f"{aside} of {aside + int(estimate.rows_used)} rows are out of range; they are set "
        warnings.append(Remark("rows-set-aside", f"{text}aside", severity="note"))
    if not estimate.in_range:
        text = (
            f"the rows are outside the training domain of {estimator.path}, which returns the "
            "prior, or no soil explains them, which widens its estimate"
        )
        warnings.append(Remark("out-of-range", text))
    draws = estimated_draws(free, estimate.mean, estimate.covariance)
    case, whole = case.without_explanations(), usable_readings(case, table)
    left = LeftByDraws(np.arange(DRAWS), _stated_sizes(case, whole))
    return MeasuredSoil(case, draws, free, tuple(warnings), whole, [left])


def _check_case(estimator: Estimator, case: Case) -> list[Remark]:
    """Warnings of fixed values and effects that differ; raises `InputError` for another gear."""
    trained = recipe_case(estimator.metadata["recipe"], estimator.path)
    if trained is None:
        return []
    for difference in gear_differences(case, trained):
        raise InputError(
            f"{estimator.path} was trained with {difference}; train a model for this gear"
        )
    found = [(text, "soil") for text in value_differences(case, trained)]
    found += [(text, "model") for text in effect_differences(case, trained)]
    head = f"{estimator.path} was trained with"
    return [
        Remark(f"another-{what}", f"{head} {text}: its estimate is of another {what}")
        for text, what in found
    ]


def measured_soil(
    case: Case,
    table: Table,
    free: Sequence[str] | None = None,
    estimator: Estimator | None = None,
    exact_model: bool = False,
) -> MeasuredSoil:
    """The soil of the rows of a table; raises as `pull_report` does.

    With `exact_model`, model and sensors are exactly as the case has them. Else draws are of one
    posterior over effects, soil and smooth error; what was learned from these rows is left out.
    """
    if estimator is not None:
        check_wheel_size(case, table)
        return estimated_soil(estimator, case, table.rows(table.answered))
    if exact_model:
        return _exact_soil(case, table, free)
    learned_before, case = case.remainder, case.without_learned_discrepancy()
    case = case.without_remainder_of(table)
    unknown = select_free(case, free)
    readings = usable_readings(case, table)
    check_declared(readings)
    found = posterior_draws_of(case, readings, unknown, DRAWS)
    warnings = [*([DRAWN_WITHOUT] if case.remainder is not learned_before else []), *readings.notes]
    if readings.channels == ("torque",):
        text = "torque alone hardly reveals errors of the model: measure pull or sinkage too"
        warnings.append(Remark("torque-alone", text, ("torque_Nm",)))
    warnings += found.remarks
    return MeasuredSoil(
        found.case, found.soil, unknown, tuple(warnings), found.readings, found.left,
        INTERVAL_FACTOR,
    )  # fmt: skip


def _exact_soil(case: Case, table: Table, free: Sequence[str] | None) -> MeasuredSoil:
    """The soil with model and sensors exactly as the case has them."""
    case = one_of(case, "the case")
    unknown, whole = select_free(case, free), usable_readings(case, table)
    check_declared(whole)
    samples = posterior_samples(case, whole.thinned(), unknown)
    x = samples.sample.u[samples.equally_weighted(DRAWS)]
    warnings = [*whole.notes]
    if samples.rejected:
        consequence = "bands are widened and may be biased"
        warnings.append(excess_residuals_remark(samples.noise_scale, case, consequence))
    residual = np.nan_to_num(whole.measured - predict(case, unknown, x, whole))
    none = np.zeros((len(whole), 0))
    left = LeftByDraws(
        np.arange(DRAWS), _stated_sizes(case, whole), residual,
        Whitening(1.0 / whole.std, none, np.zeros(0)),
    )  # fmt: skip
    draws = _soil_draws(unknown, x)
    return MeasuredSoil(case, draws, unknown, tuple(warnings), whole, [left], samples.noise_scale)


def _stated_sizes(case: Case, readings: Readings) -> dict[str, tuple[float, float]]:
    """Sizes of the stated errors; those of a [remainder] are in its functions."""
    sizes = {
        name: 1.0 if learned(case, name) else stated_size(case, readings, name) for name in CHANNELS
    }
    return {name: (size, size) for name, size in sizes.items() if size > 0.0}
