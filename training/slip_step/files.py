"""The files of a rover's slip filter for the board: its graph with metadata, and C."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.onboard.slip_stream import KIND
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import force_table
from training.slip_step.c_file import write_slip_c
from training.slip_step.graph import slip_step_model, start_of


@dataclass(frozen=True)
class SlipFiles:
    """Content of the files; C texts are empty where none were asked for."""

    model: bytes
    source: str
    header: str
    grounds: int
    state_bytes: int


def slip_files(
    case: Case,
    soils: int,
    steepest: float,
    least_speed: float,
    c_file: str | None = None,
    origin: str = "",
) -> SlipFiles:
    """The filter of a case's rover, with loads for pitches up to `steepest` degrees either way.

    Raises `InputError` as `force_table` does, and where a wheel leaves the ground there.
    """
    rover = case.rover
    if rover is None:
        raise InputError("the model file has no [rover]; export-slip needs mass and wheels")
    load = rover.loads(np.deg2rad(np.linspace(-steepest, steepest, 21)))
    table = force_table(case, (float(load.min()), float(load.max())), soils)
    own = case.noise.get("torque_Nm")
    noise = (0.0, 0.02) if own is None else (own.constant, own.share)
    filter_ = SlipFilter(table, rover.weight, case.drive, noise)
    model = slip_step_model(filter_, least_speed, rover.gravity)
    # loads at three attitudes, in which they are linear
    angle = 0.01
    level = rover.loads(0.0)
    uphill, aside = rover.loads(angle), rover.loads(0.0, angle)
    columns = [level, uphill - level * np.cos(angle), aside - level * np.cos(angle)]
    shares = np.stack([columns[0], *(part / np.sin(angle) for part in columns[1:])], axis=1)
    own_entries: dict[str, Any] = {
        "soilml_kind": KIND,
        "soilml_version": __version__,
        "wheels": "\n".join(table.wheels),
        "load_of_attitude": " ".join(repr(float(x)) for x in shares.ravel()),
        "load_N": f"{float(table.load[0])!r} {float(table.load[-1])!r}",
    }
    for key, value in own_entries.items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    texts = ("", "")
    if c_file is not None:
        texts = write_slip_c(model, filter_, Path(c_file).stem, Path(origin).name)
    grounds, recent = start_of(filter_)
    return SlipFiles(
        model.SerializeToString(), *texts, len(grounds), 4 * (grounds.size + recent.size)
    )
