"""What the tracker in C is made with: the constants of `soilml.onboard.tracking`."""

from __future__ import annotations

from typing import Any

from soilml.onboard.set_contract import (
    ABSENT_STD,
    MODEL_ERROR_INPUT,
    OPERATING_NOISE,
    RESPONSE_CHANNELS,
)
from soilml.onboard.tracking import filter_state, misfit, row_window, soil_tracker
from training.export_c.interface import Interface

BYTES_OF_A_ROW, OTHER_BYTES = 64, 2048  # Beside the residual systems, at most
#: Fields of a tracker of which the checksum is, beside its memory and its estimate.
STATE = (
    *("rows_since_change", "drifting", "in_question", "system", "blocks", "block_count"),
    *("system_size", "added", "added_count", "recent", "recent_count", "known", "question"),
    *("disagrees", "question_count", "in_succession", "previous", "has_previous", "times"),
    *("changes", "increases", "increase_count", "since_drift", "variance", "misfit", "readings"),
    *("context", "stale"),
)


def tracker_values(interface: Interface, memory_bytes: int, length: int) -> dict[str, Any] | None:
    """Values for the templates of the tracker; None where a file cannot have one.

    That is a file without sets, or without errors that a set shares.

    interface: Of the file.
    memory_bytes: Size of the memory of a set.
    length: Rows that are remembered, as in `SoilTracker`.
    """
    names = [field.name for field in interface.rows]
    watched = [name for name in filter_state.WATCHED if name in names]
    complete = {"slip", "load", "torque"} <= {*watched}
    if not interface.context or not complete:
        return None
    per_block = -(-length // row_window.BLOCKS)
    blocks = length + per_block + 2
    system_rows = len(RESPONSE_CHANNELS) * blocks
    stds = [names.index(f"{n}_std") if f"{n}_std" in names else -1 for n in watched]
    recent = min(row_window.RECENT_ROWS, length // 2)
    fresh = len(RESPONSE_CHANNELS) * filter_state.MOST_ROWS
    size = 2 * memory_bytes + (system_rows + fresh) * interface.columns * 4
    size += (blocks + recent + filter_state.MOST_ROWS) * BYTES_OF_A_ROW
    own = {
        "length": length,
        "bytes": size + OTHER_BYTES,
        "state": STATE,
        "fresh": fresh,
        "events": list(soil_tracker.Event),
        "system_rows": system_rows,
        "blocks": blocks,
        "rows_per_block": per_block,
        "recent": recent,
        "may_be_set": [str(n in OPERATING_NOISE).lower() for n in watched],
        "watched": watched,
        "stds": stds,
        "absent_std": ABSENT_STD,
        "model_error": any(field.name == MODEL_ERROR_INPUT for field in interface.context),
    }
    rules = (filter_state, misfit, row_window, soil_tracker)
    constants = (item for module in rules for item in vars(module).items())
    return {name.lower(): value for name, value in constants if name.isupper()} | own
