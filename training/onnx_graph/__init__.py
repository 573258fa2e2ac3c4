"""Construction of ONNX graphs: a builder, values with operators, and composite operations.

`Graph` collects nodes and constants by name, `Value` wraps a name so that formulas can be written
with operators, and `session_of` runs a finished model.
"""
