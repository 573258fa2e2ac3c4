"""Experiment design: the next measurement with the least expected posterior variance."""

from soilml.experiment_design.design import (
    Advice,
    CandidateGrid,
    RatedRow,
    candidate_grid,
    rate_rows,
)
from soilml.experiment_design.next_rows import advise
from soilml.experiment_design.parameter_samples import (
    ParameterSamples,
    samples_of_prior,
    samples_of_rows,
)

__all__ = [
    "Advice",
    "CandidateGrid",
    "ParameterSamples",
    "RatedRow",
    "advise",
    "candidate_grid",
    "rate_rows",
    "samples_of_prior",
    "samples_of_rows",
]
