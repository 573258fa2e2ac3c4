"""From a campaign to a better file for the board: what the model lacked, learned and judged.

`campaign` keeps runs back and writes recipes, `board_file` makes a model file of a recipe,
`judgement` compares two files on the runs that were kept back, `steps` repeats nothing that is
done, `workflow` is all of it, with `result` and `page` as its answer.
"""

from training.adaptation.result import AdaptReport
from training.adaptation.workflow import adapt

__all__ = ["AdaptReport", "adapt"]
