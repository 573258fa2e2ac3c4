"""Export of trained models: ONNX file, model card and learning curves."""
