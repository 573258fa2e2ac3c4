"""The runtime on board: one ONNX file, numpy and onnxruntime alone."""

from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator

__all__ = ["Estimate", "Estimator"]
