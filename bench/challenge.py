"""Entries of the house in one challenge, scored: the table of docs/how-to/challenge.md.

python bench/challenge.py            24 sets, four methods: about three minutes of one core
python bench/challenge.py --sbi      and simulation-based inference, half a minute for each set
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from datagen.challenge import Challenge, Scores, Truth, make_challenge, score
from datagen.challenge.house_entries import METHODS, house_entry
from datagen.challenge.scoring import score_text, summary
from soilml.cli.progress import progress_bar

#: The seed was chosen before any entry was scored on its sets.
SETS, SEED = 24, 1
#: The method that needs an extra, and takes most of the time.
SLOW = "sbi"


def run(folder: Path, methods: tuple[str, ...]) -> None:
    """Make the challenge in a folder, enter by each method, and print the scores."""
    sealed = make_challenge(SETS, seed=SEED)
    for name, text in sealed.public.items():
        (folder / "blind" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "blind" / name).write_text(text, encoding="utf-8")
    (folder / "truth.json").write_text(sealed.truth, encoding="utf-8")
    challenge = Challenge.read(folder / "blind")
    truth = Truth.read(folder / "truth.json", challenge)
    scores: list[Scores] = []
    for method in methods:
        with progress_bar(f"{method}, sets", SETS) as progress:
            scores.append(score(challenge, truth, house_entry(challenge, method, 0, progress)))
    print(score_text(summary(scores, challenge)))


if __name__ == "__main__":
    chosen = tuple(name for name in METHODS if name != SLOW or "--sbi" in sys.argv)
    with tempfile.TemporaryDirectory() as scratch:
        run(Path(scratch), chosen)
