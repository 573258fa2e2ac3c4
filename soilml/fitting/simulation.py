"""Rows that a case predicts, as a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilml.config.case import Case
from soilml.config.given_case import GivenCase, as_case
from soilml.errors import InputError
from soilml.fitting.predictions import forces_of_one_gear
from soilml.io.table import Table
from soilml.physics.contact import Force
from soilml.physics.operating_point import AFTER_CAMPAIGN, COVARIATES, Operating
from soilml.physics.pull_efficiency import (
    has_thrust,
    pull_efficiency,
    tractive_efficiency,
    traffic_class,
)
from soilml.quantities import CHANNELS, column
from soilml.row_status import Status

BLOCK = 65_536  # Rows that are solved at a time


def simulate(
    case: GivenCase,
    slip: ArrayLike,
    load: ArrayLike,
    *,
    speed: float | None = None,
    pass_number: float | None = None,
    slip_angle: float | None = None,
    run: ArrayLike | None = None,
    seed: int | None = None,
    on_rows: Callable[[int], None] | None = None,
    with_std: bool = False,
    with_efficiency: bool = False,
) -> Table:
    """Rows that a case predicts: torque, drawbar pull, sinkage and entry angle.

    Parameters
    ----------
    case
        Gear, soil and effects, as `read_case` returns them, or the path of a model file; one gear.
    slip, load
        Slip ratios and vertical loads (N), (n,) or numbers.
    speed, pass_number, slip_angle
        Speed in m/s, pass and slip angle in rad of all rows, where effects need them. What drifts
        in the order of the rows is as after the campaign.
    run
        Name of the run of each row, (n,) or one: a column `run`.
    seed
        Adds normal noise as the case declares it in [noise], with this seed; without one, readings
        are exact. An error of the model, [discrepancy], is not added.
    on_rows
        Called with the number of rows that are done.
    with_std
        Adds a column `<column>_std` for each channel that [remainder] has: the standard deviation
        of the model's error there. The mean of the remainder is in the readings anyway.
    with_efficiency
        Adds the columns `tractive_efficiency`, of the torque and the drawbar pull of the row,
        `pull_efficiency`, and its class, `traffic_class`; NaN where the gear does not drive.

    Returns
    -------
    Table
        Columns `run` where it is given, `slip`, `load_N`, known covariates, `torque_Nm`,
        `drawbar_pull_N`, `sinkage_m`, `entry_angle_rad`, NaN without equilibrium, and `status`.

    Raises
    ------
    InputError
        For a case of several gears, for values that are not valid, and for the efficiency of a leg
        that does not roll.

    Examples
    --------
    >>> from soilml import Case, Model, Wheel, simulate, soil
    >>> case = Case(Model(Wheel(radius=0.15, width=0.12)), soil("wong1989/dry_sand"))
    >>> rows = simulate(case, slip=[0.1, 0.3], load=60.0)
    >>> print(rows["torque_Nm"].round(2), rows["status"])
    [1.19 2.26] ['ok' 'ok']
    """
    case = as_case(case)
    if case.gears:
        raise InputError(f"simulate takes one gear; this case has {', '.join(case.gears)}")
    known = {"speed": speed, "pass_number": pass_number, "slip_angle": slip_angle}
    used = {field for effect in case.model.effects for field in effect.about.uses}
    known |= {field: value for field, value in AFTER_CAMPAIGN.items() if field in used}
    slips, loads = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in (slip, load)))
    parts = []
    for first in range(0, slips.size, BLOCK):
        rows = slice(first, first + BLOCK)
        at = Operating(slip=slips[rows], load=loads[rows], **known)
        parts.append(forces_of_one_gear(case, at))
        if on_rows is not None:
            on_rows(min(rows.stop, slips.size))
    names = [f.name for f in fields(Force)]
    force = Force(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names})
    columns = {} if run is None else {"run": np.broadcast_to(np.asarray(run, str), slips.shape)}
    columns |= {"slip": slips, "load_N": loads}
    for field, value in known.items():
        if value is not None:
            columns[COVARIATES[field]] = np.full(slips.size, value)
    rng = None if seed is None else np.random.default_rng(seed)
    for name in CHANNELS:
        values = np.asarray(getattr(force, name))
        if rng is not None and column(name) in case.noise:
            values = values + case.noise[column(name)].std(values) * rng.standard_normal(slips.size)
        columns[column(name)] = values
        if with_std and case.remainder is not None and case.remainder.of(name):
            columns[f"{column(name)}_std"] = case.remainder.mean_and_std(name, slips, loads)[1]
    columns["entry_angle_rad"] = np.asarray(force.entry_angle)
    if with_efficiency:
        columns |= _efficiencies(case, columns, known)
    status = np.asarray([Status(int(code)).reason for code in force.status])
    return Table(columns | {"status": status}, source="simulated rows")


def _efficiencies(
    case: Case, columns: Mapping[str, NDArray[Any]], known: Mapping[str, float | None]
) -> dict[str, NDArray[Any]]:
    """Tractive and pull efficiency of rows (n,), and its class; NaN or "" where nothing drives."""
    gear, slip = case.model.gear, columns["slip"]
    if not has_thrust(case.model):
        raise InputError(
            f"a gear of type {gear.name!r} has no tractive efficiency: it does not roll, or has no "
            "stresses; use a wheel or a track"
        )
    radius = float(np.asarray(gear.radius))
    tractive = tractive_efficiency(radius, slip, columns["torque_Nm"], columns["drawbar_pull_N"])
    pull, drives = np.full(slip.shape, np.nan), slip > 0.0
    if drives.any():
        at = Operating(slip=slip[drives], load=columns["load_N"][drives], **known)
        pull[drives] = np.asarray(pull_efficiency(case.model, case.soil, at))
    return {
        "tractive_efficiency": np.asarray(tractive),
        "pull_efficiency": pull,
        "traffic_class": np.where(drives, traffic_class(pull), ""),
    }
