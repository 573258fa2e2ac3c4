"""The table [windows] of a new map."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.drafts.draft import Draft

#: Shortest window for long runs, s, and its share of short ones.
_USUAL, _SHARE = 2.0, 0.15


def guess_windows(runs: Sequence[Run], drafts: dict[str, Draft]) -> list[str]:
    """Lines of the table; short runs get shorter windows."""
    lengths = sorted(times[-1] - times[0] for run in runs for times in run.times)
    middle = lengths[len(lengths) // 2] if lengths else 0.0
    shortest = min(_USUAL, float(f"{max(_SHARE * middle, 0.05):.1g}"))
    settle = min(0.5, shortest / 4.0)
    return [
        "",
        "[windows]  # steady windows: each becomes a row",
        f'shortest = "{shortest:g} s"',
        f'settle = "{settle:g} s"  # left out after each change',
        "sensitivity = 1  # 2 finds smaller changes, 0.5 only larger ones",
        "# within = [5, 60]  # s after the start: only this part of each run",
        "",
        "# [[leave_out]]  # a stretch that somebody disturbed",
        f'# run = "{runs[0].name}"',
        "# from = 12.0  # s",
        '# why = "the carriage was pulled"',
    ]
