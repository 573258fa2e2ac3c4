"""The onboard runtime: estimates from one ONNX file, with numpy and onnxruntime only."""

from soilml.onboard.estimate import Estimate, PriorSummary, Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.memory import Memory

__all__ = ["Estimate", "Estimator", "Memory", "PriorSummary", "Reason"]
