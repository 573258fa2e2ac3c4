"""Sizes of errors of model and sensors that a campaign supports, for the file trained on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError, InputError
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.error_columns import error_columns, stacked
from soilml.fitting.misfit import fit_under_declared_noise, misfit_limit
from soilml.fitting.readings import Readings
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS, declared_errors, usual_errors
from soilml.fitting.usable_readings import usable_readings
from soilml.inference.conditional import Conditional, conditional
from soilml.inference.evidence import linear_model, of_priors
from soilml.inference.gaussian_terms import GaussianTerms
from soilml.io.table import Table
from soilml.onboard.set_contract import MODEL_ERROR_COLUMNS, SENSOR_ERROR_INPUTS
from training.set_posterior.error_scales import USUAL_SCALES, ErrorScale, ErrorScales

#: A model that is all but right: errors of bearing, contact and channels are a seventh of the usual
#: ones. Those of the laws are what they are in most models, because readings on one soil do not
#: tell them from another soil. One model in five is so right before any row is seen.
CHECKED = ErrorScale(0.2, bearing=0.15, channels=0.15, laws=0.6)
#: Larger errors that a campaign may show, and their probabilities where the model is not that
#: right. None of them has errors of zero: rows on one soil cannot show that the laws are exact.
LARGER = (
    ErrorScale(0.6, bearing=0.6, channels=0.3, laws=0.6),
    ErrorScale(0.32, bearing=1.0, channels=1.5, laws=1.0),
    ErrorScale(0.08, bearing=3.0, channels=4.0, laws=2.0),
)
#: Share of the prior that no campaign rules out: errors on other soils than its own.
OPEN = 0.05
#: Shares of the usual errors of sensors by which later drives may differ from the campaign, which
#: its rows cannot tell. Radius and gear ratios hardly change; the load moves with what is carried;
#: the torque of a motor for its current falls by some per cent as it warms up.
DRIFT = {
    "slip_bias": 0.2,
    "load_gain": 0.5,
    "torque_gain": 0.7,
    "sinkage_bias": 0.3,
    "drawbar_pull_bias": 0.3,
}


def board_errors(
    case: Case, readings: Readings, free: Sequence[Coordinate], scale: ErrorScale
) -> dict[str, float]:
    """Standard deviations of errors as a file for the board has them, by name.

    Usual ones of sensors, and scaled ones of the model; those of laws act as another soil does.
    """
    factors: Mapping[str, float] = dict(
        zip(MODEL_ERROR_COLUMNS, scale.of_columns.tolist(), strict=True)
    )
    usual = usual_errors(case, readings.row_load, [c.path for c in free])
    scaled = {n: s * (factors[n] if n in USUAL_MODEL_ERRORS else 1.0) for n, s in usual.items()}
    return {n: s for n, s in scaled.items() if s > 0.0}


@dataclass(frozen=True, eq=False)
class _ScaleFit:
    """Rows fitted beside errors of one scale: evidence, and the errors of sensors given the rows.

    log_evidence: Up to a constant that all scales share.
    errors: Standard deviations of the errors beside which it was made, by name.
    squares: By the name of each sensor error, its expected square in variances of its prior.
    """

    log_evidence: float
    errors: Mapping[str, float]
    squares: Mapping[str, float]


@dataclass(frozen=True)
class SupportedErrors:
    """Sizes of errors that a file for the board takes from a campaign.

    Attributes
    ----------
    scales
        Sizes of the model's errors, and their probabilities: `CHECKED` and `LARGER`.
    sensors
        Standard deviations of errors of the sensors that all rows share, by input of the file.
        Those that the case declares, and of channels that were not measured, are missing.
    """

    scales: ErrorScales
    sensors: dict[str, float]


#: Those of a file of which no campaign tells.
USUAL_ERRORS = SupportedErrors(USUAL_SCALES, {})


def supported_errors(case: Case, kept_back: Table, whole: Table) -> SupportedErrors:
    r"""Sizes of errors of a hybrid model, and of its sensors, given the rows of a campaign.

    .. math:: p(s | y) \propto p(s) \int p(y | \theta, s)\, p(\theta)\, d\theta

    The rows of the runs that were kept back, by which the model was not chosen, say how large its
    errors s may be; all rows of the campaign do so too. Those count that leave less to `CHECKED`. A
    share of the prior, `OPEN`, remains in any case. Errors that leave a significant misfit are not
    supported; where all do, the larger ones have the probabilities that they had before any row.

    Board and campaign have the same sensors. An error e of a sensor, in usual standard deviations,
    has a mean m and a variance v given all rows and a size of the model's errors. The file has

    .. math:: \sigma^2 = \min\left(1, \sum_s p(s | y) \left(m_s^2 + v_s\right) + d^2\right)

    with the drift d between campaign and later drives, `DRIFT`; m^2 + v is 1 where s is not
    supported.

    Parameters
    ----------
    case
        The hybrid model, with priors of soil and effects and the noise of the sensors.
    kept_back, whole
        Rows of the runs that were kept back, and all rows.

    References
    ----------
    MacKay, Neural Computation 4(3), 1992 (evidence by Laplace's approximation). Kennedy and
    O'Hagan, J. R. Statist. Soc. B 63(3), 2001 (errors that all readings share).
    """
    rest = 1.0 - CHECKED.probability
    scales = [CHECKED, *(s._replace(probability=s.probability * rest) for s in LARGER)]
    prior = np.asarray([scale.probability for scale in scales])
    own = replace(case, discrepancy={}, remainder=None, soil_tests=())
    fits = [_fits(own, rows, scales) for rows in (kept_back, whole)]
    found = [_posterior(of_rows, prior) for of_rows in fits]
    widest = min(found, key=lambda probabilities: float(probabilities[0]))
    return SupportedErrors(
        ErrorScales(
            tuple(s._replace(probability=float(p)) for s, p in zip(scales, widest, strict=True))
        ),
        _sensor_errors(own, fits[1], widest),
    )


def _posterior(fits: Sequence[_ScaleFit | None], prior: Floats) -> Floats:
    """Probabilities of the scales given these fits; the prior of the larger ones without a fit."""
    logs = np.log(prior) + [-np.inf if fit is None else fit.log_evidence for fit in fits]
    if not np.isfinite(logs).any():
        logs = np.log(prior)
        logs[0] = -np.inf
    weights = np.exp(logs - logs.max())
    return np.asarray((1.0 - OPEN) * weights / weights.sum() + OPEN * prior)


def _fits(case: Case, rows: Table, scales: Sequence[ErrorScale]) -> list[_ScaleFit | None]:
    """Fits beside errors of each scale.

    None where a scale leaves a significant misfit, for which the evidence, linearised in the
    errors, means nothing, and where no fit succeeds.
    """
    found: list[_ScaleFit | None] = [None] * len(scales)
    try:
        free = select_free(case, None)
        readings = usable_readings(case, rows).thinned()
        optimum = fit_under_declared_noise(case, readings, free)
        if readings.undeclared:
            readings = replace(readings, std=optimum.problem.readings.std)
    except (FitError, InputError):
        return found
    for k, scale in enumerate(scales):
        errors = board_errors(case, readings, free, scale)
        try:
            found[k] = _fit(case, replace(readings, shared_errors=errors), free, optimum.x)
        except (FitError, InputError):
            continue
    return found


def _fit(
    case: Case, readings: Readings, free: Sequence[Coordinate], start: Floats
) -> _ScaleFit | None:
    """The fit beside the shared errors of the readings; None where it leaves a misfit."""
    optimum = fit_under_declared_noise(case, readings, free, start)
    freedom = max(len(readings) - len(free), 1)
    if optimum.cost / freedom > misfit_limit(freedom):
        return None
    own = optimum.problem.readings
    columns = error_columns(optimum.fitted(), own, readings.shared_errors)
    terms = GaussianTerms.of_columns(own, stacked(columns, len(own)))
    at, kept = terms.first(), np.zeros(len(own), bool)
    model = linear_model(terms, optimum, kept)
    evaluated = model.evaluate(at)
    value = evaluated.value + of_priors(model, evaluated)
    given: Conditional = conditional(model, at)
    squares = given.mean**2 + np.diag(given.covariance)
    of_columns = dict(zip(columns, map(float, squares), strict=False))
    return _ScaleFit(-0.5 * value, readings.shared_errors, of_columns)


def _sensor_errors(
    case: Case, fits: Sequence[_ScaleFit | None], probabilities: Floats
) -> dict[str, float]:
    """Standard deviations of the errors of sensors, by name; see `supported_errors`."""
    usual = {n: s for fit in fits if fit is not None for n, s in fit.errors.items()}
    found = {}
    for name in SENSOR_ERROR_INPUTS:
        if name not in usual or name in declared_errors(case):
            continue
        squares = [1.0 if fit is None else fit.squares.get(name, 1.0) for fit in fits]
        size = np.sqrt(min(1.0, float(probabilities @ squares) + DRIFT[name] ** 2))
        if size < 1.0:
            found[name] = float(f"{size * usual[name]:.3g}")
    return found
