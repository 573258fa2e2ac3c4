"""Readings under small changes of the parameters, by the implicit function theorem."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from soilml.arrays import Array, namespace
from soilml.physics.contact import Force
from soilml.physics.effects.base import apply_stage
from soilml.physics.equilibrium import equilibrium_forces, sensor_readings, without_unsolved
from soilml.physics.forces import apply_input_effects, forces_at_sinkage
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.load_case import LoadCase, rows
from soilml.physics.model import in_chunks, in_chunks_near
from soilml.physics.sinkage_estimate import SinkageEstimate

#: Step in the logarithm of sinkage of the difference for dW/d(ln z): a truncation error of the
#: order of the step, and a rounding error of 1e-10.
SINKAGE_STEP = 1e-5


@dataclass(frozen=True)
class LinearResponse:
    """Forces (batch,) as sensors read them, linear in the distance of rows to their base rows."""

    force: Force
    #: sinkage of every row, to first order, and the slope at that of its base row
    sinkage: SinkageEstimate


def linear_response(
    load_case: LoadCase, base: Array, estimate: SinkageEstimate | None = None
) -> LinearResponse:
    r"""Readings of rows that differ slightly from a base row, from one search for equilibrium.

    .. math::
        \Delta\ln z = -\frac{W(z^*) - W_0}{\partial W / \partial\ln z}, \qquad
        f = f(z^*) + \frac{\partial f}{\partial\ln z} \Delta\ln z

    with the load W and the forces f of a row at the sinkage z* of its base row, the load W_0 to be
    carried, and the derivatives of the base row. Effects on readings act on the result.
    Second-order terms are left out. From an estimate, z* is accurate to about 1e-6; the step
    corrects this at the base rows too, to about 1e-11.

    load_case: Parameters of shape () or (batch,), from `soilml.physics.model.flattened`.
    base (batch,): Index of the base row of each row; that of a base row is its own.
    estimate: Of the base rows, in increasing order of their index.

    Returns: NaN in rows whose base row has no equilibrium, or where the load carried does not rise
    with sinkage there.

    References: Implicit function theorem; Griewank and Walther, Evaluating Derivatives, 2008,
    section 15.1.
    """
    xp = namespace(load_case.at.slip)
    if isinstance(load_case.gear, EmulatedGear):
        force = in_chunks(load_case, sensor_readings)  # no search, so that each row is answered
        nothing = xp.full_like(force.load, math.nan)
        return LinearResponse(force, SinkageEstimate(nothing, nothing))
    base_rows = xp.sort(xp.unique_values(base))
    position = xp.searchsorted(base_rows, base)
    everything = xp.arange(base.shape[0], device=base.device)
    with np.errstate(all="ignore"):  # rows without an answer are flagged, not warned about
        near = None if estimate is None else replace(estimate, rough=True)
        solved = in_chunks_near(rows(load_case, base_rows), equilibrium_forces, near)
        # all rows at the sinkage of their base row, then base rows at one that is a little larger
        deeper = solved.sinkage * math.exp(SINKAGE_STEP)
        at_sinkage = in_chunks(
            rows(load_case, xp.concat([everything, base_rows], axis=0)),
            lambda part, z: forces_at_sinkage(apply_input_effects(part), z),
            xp.concat([xp.take(solved.sinkage, position, axis=0), deeper], axis=0),
        )
        true_case, size = apply_input_effects(load_case), base.shape[0]
        here: dict[str, Array] = {f.name: getattr(at_sinkage, f.name)[:size] for f in fields(Force)}
        rate: dict[str, Array] = {  # of the base rows, by the logarithm of sinkage
            name: (getattr(at_sinkage, name)[size:] - value[base_rows]) / SINKAGE_STEP
            for name, value in here.items()
            if name != "status"
        }
        load = true_case.at.load + xp.zeros_like(here["load"])
        rising = xp.where(rate["load"] > 0, rate["load"], xp.full_like(rate["load"], math.nan))
        step = (load - here["load"]) / rising[position]
        moved = {name: here[name] + rate[name][position] * step for name in rate}
        moved |= {"load": load, "status": solved.status[position]}
        reading = apply_stage(true_case.effects, "on_reading", Force(**moved), true_case)
        slope = rising / here["load"][base_rows]
        sinkage = SinkageEstimate(xp.log(here["sinkage"]) + step, slope[position])
        return LinearResponse(without_unsolved(reading), sinkage)
