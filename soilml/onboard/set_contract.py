"""Names, order and markers shared by the graph of a set posterior and the runtime that feeds it.

Training writes graphs with these inputs and outputs (`training.set_posterior`), and the onboard
runtime (`soilml.onboard.set_posterior`) runs them. Released files carry these names: none may
change.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Readings that every row must have, and readings that a row may lack.
REQUIRED_READINGS = ("slip", "torque", "load")
OPTIONAL_READINGS = ("sinkage", "drawbar_pull")
#: Readings in the order of the graph's inputs.
READING_INPUTS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
#: Standard deviations of a row in the order of the graph's inputs: noise of the three channels, and
#: the bias of the torque sensor, which all rows share.
STD_INPUTS = ("torque_std", "torque_bias", "sinkage_std", "drawbar_pull_std")
#: Channels in the order in which a response surface predicts them.
RESPONSE_CHANNELS = ("torque", "sinkage", "drawbar_pull")
#: Names under which the noise of a file, or of a user, is declared.
NOISE_NAMES = ("torque", *OPTIONAL_READINGS, "torque_bias")

#: Inputs and outputs that carry the memory of a stream: the residual system and the counts of
#: informative readings, rows, and rows in range.
MEMORY_INPUTS = ("memory", "counted")
MEMORY_OUTPUTS = ("memory_out", "counted_out")
#: Outputs for a set, each with the prefix, in the order in which the runtime reads them.
SET_PREFIX = "set_"
SET_OUTPUTS = ("mean", "std", "covariance", "low", "high", "in_range", "misfit")
#: Output by row: whether the row lies in the range of the response surface.
ROW_IN_RANGE = "row_in_range"
#: Input that selects the set posterior in files that estimate from single rows as well.
SET_SWITCH = "joint"

#: A channel that was not measured has this reading with this standard deviation (SI units): the
#: largest noise that the graph gives any weight to is smaller by orders of magnitude.
ABSENT_READING = 1.0
ABSENT_STD = 1e6
#: Smallest standard deviation that a proportional noise model gives to a reading of zero (SI
#: units). The graph takes logarithms no further down either.
LEAST_STD = 1e-12


def empty_memory(terms: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The residual system (0, terms + 1) and the counts (3,) before the first reading, float32."""
    return np.zeros((0, terms + 1), np.float32), np.zeros(3, np.float32)
