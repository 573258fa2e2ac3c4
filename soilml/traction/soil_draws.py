"""Equally weighted draws of soil parameters: of the prior, and of rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.explanations import one_of
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.covariance import Whitening
from soilml.fitting.misfit import excess_residuals_remark
from soilml.fitting.mixtures import with_all_effects
from soilml.fitting.predictions import predict
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.posterior import check_declared, posterior_samples, prior_fractions
from soilml.inference.constants import INTERVAL_FACTOR
from soilml.io.table import Table
from soilml.numerics.quantiles import systematic_resampling
from soilml.quantities import CHANNELS
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


def measured_soil(
    case: Case,
    table: Table,
    free: Sequence[str] | None = None,
    exact_model: bool = False,
) -> MeasuredSoil:
    """The soil of the rows of a table; raises as `pull_report` does.

    With `exact_model`, model and sensors are exactly as the case has them. Else draws are of one
    posterior over effects, soil and smooth error; what was learned from these rows is left out.
    """
    if exact_model:
        return _exact_soil(case, table, free)
    learned_before, case = case.remainder, case.without_learned_discrepancy()
    case = case.without_remainder_of(table)
    unknown = select_free(case, free)
    readings = usable_readings(case, table).thinned()
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
    unknown, readings = select_free(case, free), usable_readings(case, table).thinned()
    check_declared(readings)
    samples = posterior_samples(case, readings, unknown)
    x = samples.sample.u[samples.equally_weighted(DRAWS)]
    warnings = [*readings.notes]
    if samples.rejected:
        consequence = "bands are widened and may be biased"
        warnings.append(excess_residuals_remark(samples.noise_scale, case, consequence))
    residual = np.nan_to_num(readings.measured - predict(case, unknown, x, readings))
    none = np.zeros((len(readings), 0))
    left = LeftByDraws(
        np.arange(DRAWS), _stated_sizes(case, readings), residual,
        Whitening(1.0 / readings.std, none, np.zeros(0)),
    )  # fmt: skip
    draws = _soil_draws(unknown, x)
    return MeasuredSoil(
        case, draws, unknown, tuple(warnings), readings, [left], samples.noise_scale
    )


def _stated_sizes(case: Case, readings: Readings) -> dict[str, tuple[float, float]]:
    """Sizes of the stated errors; those of a [remainder] are in its functions."""
    sizes = {
        name: 1.0 if learned(case, name) else stated_size(case, readings, name) for name in CHANNELS
    }
    return {name: (size, size) for name, size in sizes.items() if size > 0.0}
