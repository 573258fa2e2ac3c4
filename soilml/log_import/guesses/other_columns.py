"""The column that a refused channel may have stood for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.channel_drafts import is_error
from soilml.log_import.guesses.columns import Candidate, candidates_of
from soilml.log_import.guesses.forces import by_behaviour
from soilml.log_import.guesses.roles import assign
from soilml.log_import.mapping.log_map import WheelMap
from soilml.remarks import Remark

#: Refusals that another column may cure.
_CURED = {
    "pull-out-of-range", "traction-out-of-range", "sinkage-out-of-range", "load-not-of-mass",
    "unit-of-another-kind",
}  # fmt: skip


def with_other_columns(
    hints: Sequence[Remark], wheel: WheelMap, run: Run, steady: bool = False
) -> list[Remark]:
    """Hints with the columns that fit their channels by name and behaviour, where others do.

    hints: Why the map of the wheel is refused.
    run: A run whose columns are looked at; of `steady` runs, where each row is one.
    """
    if not _CURED & {hint.code for hint in hints}:
        return list(hints)
    columns = [c for c in candidates_of(run.recordings, steady) if not is_error(c)]
    found = assign(by_behaviour(columns, run).candidates)
    return [_with_columns(hint, wheel, found.shared) for hint in hints]


def _with_columns(hint: Remark, wheel: WheelMap, found: dict[str, Candidate]) -> Remark:
    if hint.code not in _CURED:
        return hint
    used = {c for channel in wheel.channels.values() for c in channel.columns}
    texts = []
    for role in hint.about:
        if role not in wheel.channels or role not in found:
            continue
        address = found[role].address
        if address not in wheel.channels[role].columns:
            taken = " (which the map has elsewhere)" if address in used else ""
            texts.append(f"{address!r}{taken} would be the likely column of [{role}]")
    return replace(hint, text="; ".join([hint.text, *texts])) if texts else hint
