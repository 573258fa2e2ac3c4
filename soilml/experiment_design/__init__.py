"""Experiment design: the next measurement with the least expected posterior variance."""

from soilml.experiment_design.design import (
    Advice,
    CandidateGrid,
    CandidateRow,
    RatedRow,
    advise,
    candidate_grid,
)
from soilml.experiment_design.parameter_samples import (
    ParameterSamples,
    samples_of_prior,
    samples_of_rows,
)
from soilml.experiment_design.presentation import is_identified

__all__ = [
    "Advice",
    "CandidateGrid",
    "CandidateRow",
    "ParameterSamples",
    "RatedRow",
    "advise",
    "candidate_grid",
    "is_identified",
    "samples_of_prior",
    "samples_of_rows",
]
