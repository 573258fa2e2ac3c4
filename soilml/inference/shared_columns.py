"""Errors of sensors and model that all rows share, as further Gaussian terms for the soil."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.error_columns import error_columns, stacked
from soilml.fitting.readings import Readings
from soilml.fitting.shared_errors import USUAL_LAW_ERRORS, USUAL_MODEL_ERRORS, usual_errors


def shared_columns(
    case: Case, readings: Readings, soil: Sequence[Coordinate]
) -> tuple[Floats, tuple[Floats, ...]]:
    """Columns (m, k) of sensor errors of unit variance, and of errors inside the model (m, q).

    A sensor has the error that the case declares in [bias], else the typical one; the laws of the
    soil have typical errors, which rows cannot tell from another soil. Errors of bearing, contact
    and channels are of typical size times one amplitude, which is estimated.

    case: With the soil at which the errors are linearised.
    soil: Free parameters; what is free is no error.
    """
    errors = usual_errors(case, readings.row_load, [c.path for c in soil]) | USUAL_LAW_ERRORS
    columns, m = error_columns(case, readings, errors), len(readings)
    of_model = {name: own for name, own in columns.items() if name in USUAL_MODEL_ERRORS}
    others = {name: own for name, own in columns.items() if name not in of_model}
    return stacked(others, m), ((stacked(of_model, m),) if of_model else ())
