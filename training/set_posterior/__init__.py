"""The posterior of a set of readings of one soil, as one ONNX graph that runs onboard.

A wheel family (`RecipeFamily`, `DimensionlessFamily`) simulates wheels, `fit_response` fits their
response surface, `calibrate_misfit_limits` makes the graph with its misfit limits, and
`validate_posterior` measures its accuracy.
"""
