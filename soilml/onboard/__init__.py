"""The onboard runtime: estimates from one ONNX file, with numpy and onnxruntime only."""

from soilml.onboard.estimate import Estimate, PriorSummary
from soilml.onboard.estimator import Estimator
from soilml.onboard.set_posterior import Memory

__all__ = ["Estimate", "Estimator", "Memory", "PriorSummary"]
