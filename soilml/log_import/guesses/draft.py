"""The table of one channel in a draft of a map, and the samples of a run as drafts read them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from soilml.errors import SoilmlError
from soilml.io.cell_text import is_plain
from soilml.io.toml_settings import Settings
from soilml.log_import.channels.inputs import Inputs, moving, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.mapping.channel_map import take_channel
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.mapping.uncertain_value import Uncertain


def toml_value(value: Any) -> str:
    """A value in TOML: numbers without needless digits, patterns in single quotes.

    Characters that are not plain are written as escapes, and half a pair of surrogates, which TOML
    does not have, as a question mark.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float | int | np.number):
        return f"{float(value):g}" if float(value) != int(value) else f"{int(value)}"
    if isinstance(value, str) and "\\" in value and "'" not in value and is_plain(value):
        return f"'{value}'"
    written = json.dumps(value, ensure_ascii=False).encode("utf-8", "replace").decode()
    return "".join(c if is_plain(c) else f"\\U{ord(c):08x}" for c in written)


class Marked(str):
    """A line of a map, or the comment of a key, with what no log shows: a person must look."""


def key_line(key: str, value: Any, comment: str = "") -> str:
    """The line of a key, which is marked where its comment is."""
    line = f"{key} = {toml_value(value)}" + (f"  # {comment}" if comment else "")
    return Marked(line) if isinstance(comment, Marked) else line


@dataclass
class Draft:
    """The table of one channel: its keys, and a comment for each of them."""

    keys: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    column: Candidate | None = None

    def put(self, key: str, value: Any, why: str = "") -> None:
        """Set a key and its comment."""
        self.keys[key] = value
        if why:
            self.comments[key] = why

    @property
    def is_marked(self) -> bool:
        """Whether a line of it says that a person must look."""
        return any(isinstance(why, Marked) for why in self.comments.values())

    def without(self, shared: Draft) -> Draft:
        """The keys that are not in another draft."""
        return Draft({k: v for k, v in self.keys.items() if k not in shared.keys}, self.comments)


def keys_alike(wheels: Sequence[dict[str, Draft]]) -> dict[str, Draft]:
    """The keys that all wheels share, by role, with the comments of the first wheel."""
    return {
        role: Draft(
            {
                key: value
                for key, value in first.keys.items()
                if all(key in w[role].keys and w[role].keys[key] == value for w in wheels)
            },
            first.comments,
        )
        for role, first in (wheels[0] if wheels else {}).items()
    }


def wheel_of(drafts: dict[str, Draft]) -> WheelMap:
    """The channels of a draft as a wheel with a radius of 1 m; raises `InputError`."""
    channels = {
        role: take_channel(Settings(dict(draft.keys), f"draft [{role}]"), role)
        for role, draft in drafts.items()
    }
    return WheelMap("", Uncertain(1.0), channels)


def inputs_of(drafts: dict[str, Draft], run: Run) -> Inputs | None:
    """The samples as a draft reads them; None where it does not fit the run."""
    try:
        return wheel_inputs(run, wheel_of(drafts))
    except SoilmlError:
        return None


def fastest_ratio(inputs: Inputs) -> float:
    """Largest ratio of travel (m/s) to rotation (rad/s, or rim speed), of means over a second."""
    rotation = inputs.values.get("rim_speed", inputs.values.get("wheel_speed"))
    ground = inputs.values.get("ground_speed")
    if rotation is None or ground is None:
        return float("nan")
    driven = moving(inputs) & np.isfinite(rotation) & np.isfinite(ground)
    width = max(1, round(2.0 / inputs.step))
    kept = np.flatnonzero(driven)
    count = kept.size // width
    if count < 2:
        return float("nan")
    blocks = kept[: count * width].reshape(count, width)
    ratios = np.abs(ground[blocks].mean(axis=1)) / np.abs(rotation[blocks].mean(axis=1))
    return float(np.percentile(ratios, 95))
