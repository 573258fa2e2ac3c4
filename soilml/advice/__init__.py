"""Which measurement to make next: what each would leave open, and what none has told yet."""

from soilml.advice.advise import Advice, Choice, advise
from soilml.advice.belief import Belief, of_moments, of_prior, of_rows
from soilml.advice.candidate import Candidate, Grid, grid
from soilml.advice.words import abstained, told

__all__ = [
    "Advice",
    "Belief",
    "Candidate",
    "Choice",
    "Grid",
    "abstained",
    "advise",
    "grid",
    "of_moments",
    "of_prior",
    "of_rows",
    "told",
]
