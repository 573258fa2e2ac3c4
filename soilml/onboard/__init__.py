"""The onboard runtime: estimates from one ONNX file, with numpy and onnxruntime only."""

from soilml.onboard.estimate import Estimate, Reason
from soilml.onboard.estimator import Estimator
from soilml.onboard.gaussian_product import PriorSummary
from soilml.onboard.memory import Memory

__all__ = ["Estimate", "Estimator", "Memory", "PriorSummary", "Reason"]
