"""One step of the filter of a rover without odometry as an ONNX graph, and as C."""
