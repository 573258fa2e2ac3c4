"""The files of a rover's slip filter for the board: its graph with metadata, and C."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilml import __version__
from soilml.config.case import Case
from soilml.config.wheeled_rover import WheeledRover
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.onboard.model_file import SLIP_STEP, with_checksums
from soilml.onboard.slip_stream import SLIP_FORMAT
from soilml.slip_filter.filter import SlipFilter
from soilml.slip_filter.force_table import ForceTable, force_table
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
        raise InputError("the model file has no [rover]; export slip needs mass and wheels")
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
    text = case_as_toml(case)
    metadata = {
        "soilml_kind": SLIP_STEP,
        "soilml_format": SLIP_FORMAT,
        "soilml_version": __version__,
        "rover": json.dumps(_rover_entry(rover, table)),
        # ends of the 90 % interval, with the median between, of each parameter, SI
        "prior": json.dumps(dict(zip(
            table.names, np.quantile(table.values, (0.05, 0.5, 0.95), axis=0).T.tolist(),
            strict=True,
        ))),
        "table": json.dumps({
            "load_N": [float(table.load[0]), float(table.load[-1])],
            "load_of_attitude": shares.tolist(),
        }),
        "probe": json.dumps(_probe(filter_, rover, least_speed)),
        "case": text,
        "case_sha256": hashlib.sha256(text.encode()).hexdigest(),
    }  # fmt: skip
    content = with_checksums(model.SerializeToString(deterministic=True), metadata)
    texts = ("", "")
    if c_file is not None:
        texts = write_slip_c(model, filter_, Path(c_file).stem, Path(origin).name, metadata)
    grounds, recent = start_of(filter_)
    return SlipFiles(content, *texts, len(grounds), 4 * (grounds.size + recent.size + 2))


def _rover_entry(rover: WheeledRover, table: ForceTable) -> dict[str, Any]:
    """The rover of the metadata."""
    return {
        "mass_kg": rover.mass,
        "gravity_m_s2": rover.gravity,
        "centre_of_mass_m": list(rover.centre_of_mass),
        "wheels": [
            {
                "name": name,
                "radius_m": float(radius),
                "forward_m": wheel.forward,
                "left_m": wheel.left,
            }
            for (name, wheel), radius in zip(rover.wheels.items(), table.radius, strict=True)
        ],
    }


def _probe(filter_: SlipFilter, rover: WheeledRover, least_speed: float) -> list[dict[str, Any]]:
    """Rows one after the other, with the answers of the filter in double precision.

    On level ground, uphill and downhill, with rims alike and apart; the last one has a torque that
    no soil carries.
    """
    k, found, belief = len(filter_.table.wheels), [], filter_.start()
    apart = 0.05 * np.resize([1.0, -1.0], k)
    apart = 1.0 + apart - apart.mean()
    usual = filter_.errors.loss + 0.15 * rover.weight / k * filter_.table.radius
    wild = np.where(np.arange(k) == 0, 1e20, usual)
    rows = ((0.0, 1.0, usual), (0.08, apart, 1.6 * usual), (-0.03, apart, usual), (0.0, 1.0, wild))
    for slope, ratio, torque in rows:
        row = {
            "rim_speed": max(0.1, 2.0 * least_speed) * ratio * np.ones(k),
            "torque": np.asarray(torque),
            "load": rover.loads(slope),
        }
        answer, belief = filter_.step(belief, **row, slope=slope)
        found.append({
            "row": {**{name: v.tolist() for name, v in row.items()}, "slope": slope},
            "speed": answer.mean,
            "speed_std": answer.std,
            "no_soil": answer.no_soil,
            "beyond": answer.beyond,
        })  # fmt: skip
    return found
