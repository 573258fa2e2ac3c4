"""From data to regressors to ONNX files: `training.spec.read_spec`, `training.train.train`.

Imports datagen and soilml. Nothing is imported here, so that the command line can be listed
without the libraries for training.
"""
