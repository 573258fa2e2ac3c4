"""Synthetic measurements from recipes: `datagen.recipe.read_recipe`, `datagen.generate.generate`.

Imports soilml and is imported by training. Nothing is imported here, so that the command line can
be listed without the libraries for data generation.
"""
