"""Whether rows agree with an exact model: the fault detector beside an estimate with model errors.

An estimate has errors of its model, which explain most faults as well. Here the same rows are
compared with the same model without errors; sensors keep the errors that are declared, or usual.
"""

from __future__ import annotations

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

NO_ROWS: dict[str, list[float]] = {name: [] for name in REQUIRED_READINGS}


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
    return replace(
        estimate,
        exact_misfit=np.asarray(misfit),
        disagrees=np.asarray(reason == Reason.INCONSISTENT),
    )
