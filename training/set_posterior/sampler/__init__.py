"""Importance sampling of the posterior of a set of readings, as nodes of an ONNX graph."""
