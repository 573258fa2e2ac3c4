"""Draws of the soil that rows were measured on: by the posterior, or by a trained file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.fitting.coordinates import Coordinate, select_free
from soilml.fitting.shared_errors import usual_errors
from soilml.fitting.usable_readings import usable_readings
from soilml.identification.fit import excess_residuals_remark
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.remarks import Remark
from soilml.traction.onboard_draws import onboard_draws
from soilml.traction.soil_draws import SoilDraws, posterior_draws


@dataclass(frozen=True)
class MeasuredSoil:
    """Draws of the soil, the parameters that were unknown, and warnings.

    `noise_scale` is the factor on the declared noise; None for the estimate of a trained file.
    """

    draws: SoilDraws
    unknown: Sequence[Coordinate]
    warnings: tuple[Remark, ...]
    noise_scale: float | None


def measured_soil(
    case: Case,
    table: Table,
    free: Sequence[str] | None = None,
    estimator: Estimator | None = None,
    as_usual: bool = False,
) -> MeasuredSoil:
    """The soil of the rows of a table; raises as `pull_report` does.

    With `as_usual`, sensors and model have the errors that they usually have.
    """
    if estimator is not None:
        check_wheel_size(case, table)
        unknown, draws, notes = onboard_draws(estimator, case, table.rows(table.answered))
        return MeasuredSoil(draws, unknown, tuple(notes), None)
    unknown = select_free(case, free)
    readings = usable_readings(case, table)
    if as_usual:
        errors = usual_errors(case, readings.row_load, [f.path for f in unknown])
        readings = replace(readings, shared_errors=errors)
    posterior = posterior_draws(case, readings, unknown)
    warnings = list(readings.notes)
    if readings.channels == ("torque",):
        text = "torque alone hardly reveals errors of the model: measure pull or sinkage too"
        warnings.append(Remark("torque-alone", text, ("torque_Nm",)))
    if posterior.samples.noise_inflated:
        scale = posterior.samples.noise_scale
        consequence = "bands are widened and may be biased"
        warnings.append(excess_residuals_remark(scale, case, consequence))
    return MeasuredSoil(posterior.draws, unknown, tuple(warnings), posterior.samples.noise_scale)
