"""A challenge of blind sets: what entrants get, what is sealed, entries, and their scores.

`challenge_files` has the files and their checks, `sealing` makes a challenge, `scoring` scores
entries. `house_entries` makes entries by methods of this package: `linear_entries` by linearised
models, `process_entry` by a Gaussian process without physics, `simulation_entry` by
simulation-based inference with `sbi`.
"""

from datagen.challenge.challenge_files import Challenge, Entry, Truth
from datagen.challenge.scoring import Scores, bootstrap, crps, score
from datagen.challenge.sealing import make_challenge

__all__ = [
    "Challenge",
    "Entry",
    "Scores",
    "Truth",
    "bootstrap",
    "crps",
    "make_challenge",
    "score",
]
