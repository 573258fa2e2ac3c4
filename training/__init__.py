"""From data to fitted regressors to ONNX, and how good they are. Imports datagen and soilml."""
