"""Measured runs in which something is hidden, to test an analyst with.

Own wheel, own causes, nothing of soilml: what finds the causes must not have written them.
"""

from datagen.blind_sets.blind_set import Drawn, draw, write
from datagen.blind_sets.catalogue import CAUSES
from datagen.blind_sets.factorial_plan import Plan, matrix

__all__ = ["CAUSES", "Drawn", "Plan", "draw", "matrix", "write"]
