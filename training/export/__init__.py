"""Export of trained models: ONNX file and model card."""
