"""What the tracker in C is made with: the constants of `soilml.onboard.tracking`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from soilml.onboard.set_contract import (
    ABSENT_STD,
    LEAST_STD,
    OPERATING_NOISE,
    RESPONSE_CHANNELS,
)
from soilml.onboard.tracking import filter_state, misfit, row_window, soil_tracker
from training.export_c.interface import Interface
from training.set_posterior.row_inputs import noise_of

BYTES_OF_A_ROW, OTHER_BYTES = 64, 2048  # Beside the residual systems, at most


def tracker_values(
    interface: Interface, noise: Mapping[str, Sequence[float]], memory_bytes: int, length: int
) -> dict[str, Any]:
    """Values for the templates of the tracker.

    interface: Of the file.
    noise: Constant part and share of the file's noise by reading.
    memory_bytes: Size of the memory of a set.
    length: Rows that are remembered, as in `SoilTracker`.
    """
    names, watched = [field.name for field in interface.rows], filter_state.WATCHED
    per_block = -(-length // row_window.BLOCKS)
    blocks = length + per_block + 2
    system_rows = len(RESPONSE_CHANNELS) * blocks
    recent = min(row_window.RECENT_ROWS, length // 2)
    fresh = len(RESPONSE_CHANNELS) * filter_state.MOST_ROWS
    size = 2 * memory_bytes + (system_rows + fresh) * interface.columns * 4
    size += (blocks + filter_state.MOST_ROWS) * BYTES_OF_A_ROW
    parts = [noise_of(f"{name}_std", noise) for name in watched]
    own = {
        "length": length,
        "bytes": size + OTHER_BYTES,
        "fresh": fresh,
        "events": list(soil_tracker.Event),
        "system_rows": system_rows,
        "blocks": blocks,
        "rows_per_block": per_block,
        "recent": recent,
        "may_be_set": [str(n in OPERATING_NOISE).lower() for n in watched],
        "watched": watched,
        "stds": [names.index(f"{name}_std") for name in watched],
        "constants": [max(part[0], 0.0 if n in OPERATING_NOISE else LEAST_STD)
                      for n, part in zip(watched, parts, strict=True)],
        "shares": [share for _, share in parts],
        "absent_std": ABSENT_STD,
    }  # fmt: skip
    rules = (filter_state, misfit, row_window, soil_tracker)
    constants = (item for module in rules for item in vars(module).items())
    return {name.lower(): value for name, value in constants if name.isupper()} | own
