"""The posterior of a set of readings, as one ONNX graph that runs on board."""
