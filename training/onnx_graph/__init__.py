"""Construction of ONNX graphs: a builder, values with operators, and composite operations.

`Graph` collects nodes and constants by name, `Value` wraps a name so that formulas can be written
with operators, and `session_of` runs a finished model.
"""

from training.onnx_graph.builder import IR_VERSION, OPSET, Graph, Output, session_of
from training.onnx_graph.value import Value

__all__ = ["IR_VERSION", "OPSET", "Graph", "Output", "Value", "session_of"]
