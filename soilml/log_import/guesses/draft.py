"""The table of one channel in a guess, and the samples of a run as guesses read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from soilml.arrays import Floats
from soilml.errors import SoilmlError
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.log_import.channels.inputs import Inputs, moving, wheel_inputs
from soilml.log_import.channels.runs import Run
from soilml.log_import.guesses.columns import Candidate
from soilml.log_import.mapping.channel_map import ChannelMap
from soilml.log_import.mapping.log_map import WheelMap
from soilml.log_import.mapping.uncertain_value import Uncertain
from soilml.log_import.mapping.written_map import WrittenTable


@dataclass
class Draft(WrittenTable):
    """The table of one channel, and the column that it is guessed to be."""

    column: Candidate | None = None

    def only(self, path: str, keys: Sequence[str]) -> Draft:
        """The draft as a table of another path, with some of its keys."""
        kept = {key: value for key, value in self.keys.items() if key in keys}
        after = self.after if "column" in kept else []
        return Draft(path, kept, self.comments, after=after, column=self.column)


def keys_alike(drafts: Sequence[Draft]) -> list[str]:
    """The keys that the drafts of all wheels have alike."""
    first = drafts[0].keys
    return [k for k, v in first.items() if all(k in d.keys and d.keys[k] == v for d in drafts)]


def inputs_of(drafts: dict[str, Draft], run: Run) -> Inputs | None:
    """The samples as drafts read them, of a radius of 1 m; None where these do not fit the run."""
    try:
        tables = {role: Settings(dict(draft.keys), f"[{role}]") for role, draft in drafts.items()}
        channels = {r: take_declared(ChannelMap, own, r, role=r) for r, own in tables.items()}
        return wheel_inputs(run, WheelMap("", Uncertain(1.0), channels))
    except SoilmlError:
        return None


def driving_means(inputs: Inputs, seconds: float = 1.0) -> dict[str, Floats]:
    """Means (blocks,) of the channels over some seconds of driving, of a short log over less."""
    kept = np.flatnonzero(moving(inputs))
    width = max(1, min(round(seconds / inputs.step), kept.size // 60))
    blocks = kept[: kept.size // width * width].reshape(-1, width)
    means = {role: own[blocks].mean(axis=1) for role, own in inputs.values.items()}
    return {role: own for role, own in means.items() if np.isfinite(own).any()}


def travel_over_rotation(means: dict[str, Floats]) -> Floats:
    """Travel (m/s) over rotation (rad/s, or rim speed), without sign (blocks,); empty for none."""
    rotation = means.get("rim_speed", means.get("wheel_speed"))
    if rotation is None or "ground_speed" not in means:
        return np.zeros(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.abs(means["ground_speed"] / rotation))


def fastest_ratio(inputs: Inputs) -> float:
    """Largest ratio of travel to rotation, of means over two seconds; NaN where there are few."""
    ratio = travel_over_rotation(driving_means(inputs, 2.0))
    ratio = ratio[np.isfinite(ratio)]
    return float(np.percentile(ratio, 95)) if ratio.size > 1 else float("nan")
