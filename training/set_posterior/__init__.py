"""The posterior of a set of readings of one soil, as one ONNX graph that runs onboard.

A wheel family (`RecipeFamily`, `DimensionlessFamily`) simulates wheels, `fit_response` fits their
response surface, `with_misfit_limits` measures the misfit limits of its graph, and
`validate_posterior` measures its accuracy.
"""
