"""Blind sets: simulated runs with mechanisms that are not in the model given to the analyst.

The wheel and the mechanisms are an independent implementation, which imports nothing of soilml, so
that an error in the analysis cannot hide in the data that test it.
"""

from datagen.blind_sets.blind_set import BlindSet, draw_blind_set, write_blind_set
from datagen.blind_sets.catalogue import MECHANISMS
from datagen.blind_sets.factorial_plan import Plan, benchmark_plans, plan_matrix

__all__ = [
    "MECHANISMS",
    "BlindSet",
    "Plan",
    "benchmark_plans",
    "draw_blind_set",
    "plan_matrix",
    "write_blind_set",
]
