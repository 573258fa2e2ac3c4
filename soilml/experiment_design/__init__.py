"""Experiment design: the next measurement with the least expected posterior variance."""

from soilml.experiment_design.design import Advice, RatedRow
from soilml.experiment_design.next_rows import advise

__all__ = ["Advice", "RatedRow", "advise"]
