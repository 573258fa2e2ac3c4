"""Names, order and markers shared by the graph of a set posterior and the runtime that feeds it.

Training writes graphs with these inputs and outputs (`training.set_posterior`), and the onboard
runtime (`soilml.onboard.set_posterior`) runs them. Released files carry these names: none may
change.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]  # the board does without soilml.arrays


#: Version of what a caller of the graph may feed and reads, in the metadata as `soilml_interface`;
#: files without that entry have version 1. docs/reference/onnx.md lists the changes.
INTERFACE = "5"

#: Readings that every row must have, and readings that a row may lack.
REQUIRED_READINGS = ("slip", "torque", "load")
OPTIONAL_READINGS = ("sinkage", "drawbar_pull")
#: Readings in the order of the graph's inputs.
READING_INPUTS = ("slip", "load", "torque", "sinkage", "drawbar_pull")
#: Standard deviations of a row in the order of the graph's inputs: noise of the three channels, and
#: the bias of the torque sensor, which all rows share.
STD_INPUTS = ("torque_std", "torque_bias", "sinkage_std", "drawbar_pull_std")
#: Standard deviations of a row's slip and load, zero where they are exact.
OPERATING_STD_INPUTS = ("slip_std", "load_std")
OPERATING_NOISE = ("slip", "load")  # Names under which that noise is declared
#: Standard deviations of errors of the sensors that all rows of a set share: offset of slip,
#: relative errors of load and torque, offsets of sinkage and drawbar pull.
SENSOR_ERROR_INPUTS = ("slip_bias", "load_gain", "torque_gain", "sinkage_bias", "drawbar_pull_bias")
#: Size of the errors of the model, as a multiple of their usual size; 0: the model is right; below
#: zero, which is the default: inferred from the readings.
MODEL_ERROR_INPUT = "model_error"
INFERRED = -1.0
COMMON_ERROR_INPUTS = (*SENSOR_ERROR_INPUTS, MODEL_ERROR_INPUT)  # All errors that a set shares
#: Errors of the sensors that all rows share, in the order of their columns of the residual system,
#: after those of the monomials.
SENSOR_ERROR_COLUMNS = (
    *("torque_bias", "sinkage_bias", "drawbar_pull_bias"),
    *("torque_gain", "slip_bias", "load_gain"),
)
#: Errors of the laws of the soil, the last columns: logarithm of the strength, its change with the
#: logarithm of load, and logarithm of the shear modulus. No reading tells them from other values of
#: the parameters.
LAW_ERROR_COLUMNS = ("strength", "strength_by_load", "shear_modulus")
#: Errors of the model, in the order of their columns, after those of the sensors: logarithm of the
#: bearing modulus, its changes with slip and with the logarithm of load, contact behind the axle
#: as a multiple of `exit-angle` at its usual size, logarithm of sinkage, drawbar pull over load;
#: changes with slip of the logarithms of torque and sinkage, and of drawbar pull over load.
MODEL_ERROR_COLUMNS = (
    *("bearing", "bearing_by_slip", "bearing_by_load", "contact", "sinkage", "drawbar_pull"),
    *("torque_by_slip", "sinkage_by_slip", "drawbar_pull_by_slip"),
    *LAW_ERROR_COLUMNS,
)
ERROR_COLUMNS = (*SENSOR_ERROR_COLUMNS, *MODEL_ERROR_COLUMNS)  # All columns of errors
#: Channels in the order in which a response surface predicts them.
RESPONSE_CHANNELS = ("torque", "sinkage", "drawbar_pull")
#: Names under which the noise of a file, or of a user, is declared.
NOISE_NAMES = ("torque", *OPTIONAL_READINGS, "torque_bias", *OPERATING_NOISE)

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
#: For callers that feed a graph themselves: a reading of this value was not measured, and this
#: standard deviation is that of the file's noise. They are the defaults of the inputs.
NOT_MEASURED = -1e30
NOISE_OF_FILE = -1.0
#: A set is estimated if at least this share of its rows is in range; the others are set aside.
#: Files of interface 4 and earlier do not state it.
LEAST_SHARE_IN_RANGE, FORMER_SHARE_IN_RANGE = 0.5, 0.9
#: Counts in the place of a memory that is not finite: so many rows out of range that every further
#: set is refused.
DAMAGED_COUNTS = (0.0, 1e9, 0.0)
#: Smallest standard deviation that a proportional noise model gives to a reading of zero (SI
#: units). The graph takes logarithms no further down either.
LEAST_STD = 1e-12


def empty_memory(columns: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """The residual system (0, columns) and the counts (3,) before the first reading, float32."""
    return np.zeros((0, columns), np.float32), np.zeros(3, np.float32)
