"""From a campaign to a better file for the board: what the model lacked, learned and judged.

`campaign` keeps runs back and writes recipes, `supported_errors` sizes the errors of the file,
`judgement` compares two files on the runs that were kept back, `workflow` is all of it, with
`result` as its answer.
"""

from training.adaptation.result import AdaptReport
from training.adaptation.workflow import adapt

__all__ = ["AdaptReport", "adapt"]
