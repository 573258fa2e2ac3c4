"""Measured runs in which something is hidden, to test an analyst with.

Own wheel, own causes, nothing of soilml: what finds the causes must not have written them.
"""

from datagen.hidden.causes import CAUSES
from datagen.hidden.plans import Plan, matrix
from datagen.hidden.sets import Drawn, draw, write

__all__ = ["CAUSES", "Drawn", "Plan", "draw", "matrix", "write"]
