"""A trained model as an ONNX file, with its card and learning curves."""
