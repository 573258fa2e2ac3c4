"""The onboard runtime: estimates from one ONNX file, with numpy and onnxruntime only."""

from soilml.onboard.estimate import Estimate
from soilml.onboard.estimator import Estimator

__all__ = ["Estimate", "Estimator"]
