"""Whether rows agree with an exact model: the fault detector beside an estimate with model errors.

An estimate has errors of its model, which explain most faults as well. Here the same rows are
compared with the same model without errors; sensors keep the errors that are declared, or usual.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.memory import Memory
from soilml.onboard.model_file import Session
from soilml.onboard.set_contract import (
    MODEL_ERROR_INPUT,
    REQUIRED_READINGS,
    SENSOR_ERROR_COLUMNS,
    SET_PREFIX,
)
from soilml.onboard.set_posterior import SetPosterior, of_reason

#: Share of sound sets whose misfit is above the limit of a file, and its standard normal quantile.
FALSE_ALARM_RATE, ALARM_QUANTILE = 0.01, 2.326
#: Beyond the largest calibrated number of readings n the limit grows by 1 + 3 / sqrt(n) a reading:
#: that of a chi-squared distribution with n degrees of freedom is n + 3 sqrt(n) to 3 standard
#: deviations, roughly, and a straight line through it lies above it.
MARGIN = 3.0
NO_ROWS: dict[str, list[float]] = {name: [] for name in REQUIRED_READINGS}


def misfit_limit(limits: Mapping[str, Sequence[float]], readings: float) -> float:
    """The limit `most` of a file for so many readings; NaN where the file states none."""
    if not limits:
        return math.nan
    numbers, last = limits["readings"], limits["readings"][-1]
    place = math.log(min(max(readings, numbers[0]), last))
    inside = float(np.interp(place, np.log(numbers), limits["most"]))
    return inside + max(readings - last, 0.0) * (1.0 + MARGIN / math.sqrt(last))


def exact_probability(misfit: float, readings: float, limit: float) -> float:
    r"""Share of sound sets with a larger misfit; NaN without a reading.

    The cube root of a chi-squared variable with n degrees of freedom, over n, is nearly normal
    with the standard deviation :math:`\sqrt{2 / (9 n)}`. Its place is given by the limit, which
    1 % of sound sets exceed.

    References: Wilson and Hilferty, Proc. Natl. Acad. Sci. 17, 1931.
    """
    degrees = readings - 1.0 if readings > 2.0 else 1.0
    if not (readings > 0.5 and math.isfinite(limit)):
        return math.nan
    third = 1.0 / 3.0
    cube_root = (max(misfit, 0.0) / degrees) ** third - (limit / degrees) ** third
    normal = cube_root / math.sqrt(2.0 / (9.0 * degrees)) + ALARM_QUANTILE
    return 0.5 * math.erfc(normal / math.sqrt(2.0))


def with_exact_check(
    estimate: Estimate,
    sets: SetPosterior,
    session: Session,
    memory: Memory,
    answer: Estimate | None = None,
) -> Estimate:
    """The estimate with the check of the rows of a memory; `answer` is theirs if it is another.

    One call of the graph without rows, of the system without columns of errors of the model. It is
    not needed where the answer took the model as exact.
    """
    answer = answer or estimate
    misfit, reason = float(answer.misfit), Reason(int(answer.reason))
    if sets.common_errors.get(MODEL_ERROR_INPUT, 0.0):
        exact, outputs = sets.exact, (SET_PREFIX + "misfit", SET_PREFIX + "in_range")
        system = memory.system.copy()
        system[:, sets.terms + len(SENSOR_ERROR_COLUMNS) :] = 0.0
        fed = exact.feed(exact.rows(NO_ROWS), Memory(system, memory.counts))
        found, in_range = (one[0] for one in session.run(outputs, fed))
        misfit, reason = float(found), of_reason(bool(in_range), memory, sets.least_share_in_range)
    readings = float(memory.counts[0])
    limit = misfit_limit(sets.misfit_limits, readings)
    return replace(
        estimate,
        exact_misfit=np.asarray(misfit),
        exact_probability=np.asarray(exact_probability(misfit, readings, limit)),
        disagrees=np.asarray(reason == Reason.INCONSISTENT),
    )
