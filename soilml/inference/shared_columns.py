"""Errors that all rows share, as columns: of sensors, and of what acts inside the model."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate
from soilml.fitting.error_columns import error_columns, stacked
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.fitting.shared_errors import USUAL_MODEL_ERRORS, usual_errors
from soilml.numerics.prior import Prior
from soilml.numerics.smooth_process import independent_process_columns, slip_load_points
from soilml.parameters import declared
from soilml.physics.soils import Soil


def shared_columns(case: Case, readings: Readings, soil: Sequence[Coordinate]):
    variant = os.environ.get("VARIANT", "F")
    if variant == "v0":
        return None, ()
    errors = usual_errors(case, readings.row_load, [c.path for c in soil])
    mods = set(USUAL_MODEL_ERRORS)
    sens = {k: v for k, v in errors.items() if k not in mods}
    model = {k: v for k, v in errors.items() if k in mods}
    fixed_names = dict(sens)
    groups = []
    if "B" in variant and "bearing" in model:
        fixed_names["bearing"] = model.pop("bearing")
    if "M" in variant:
        groups.append(model)
    if "S" in variant:
        groups = [{k: v} for k, v in model.items()]
    fixed = _columns(case, readings, fixed_names) if "F" in variant else None
    inner = [c for g in groups if (c := _columns(case, readings, g)).shape[1]]
    if "I" in variant:
        inner.append(_inner(case, readings, ("cohesion", "friction_angle", "shear_modulus"), 0.1))
    if "J" in variant:
        inner += [
            _inner(case, readings, (n,), 0.1)
            for n in ("cohesion", "friction_angle", "shear_modulus")
        ]
    if "K" in variant:
        inner.append(_inner(case, readings, ("kc", "kphi"), 0.2, together=True))
    return fixed, inner


def _columns(case, readings, errors):
    return stacked(error_columns(case, readings, errors), len(readings))


def _inner(case, readings, names, share, together=False):
    coords = []
    for n in names:
        v = float(getattr(case.soil, n))
        if v == 0:
            continue
        b = declared(Soil)[n]
        unit = share * abs(v)
        lo, up = sorted(((b.lower - v) / unit, (b.upper - v) / unit))
        coords.append(Coordinate(n, b.unit, Prior(v, v + unit), lower=lo, upper=up))
    jac = np.nan_to_num(linearise(case, coords, np.zeros(len(coords)), readings).jacobian)
    if together:
        jac = jac.sum(axis=1, keepdims=True)
    pts = slip_load_points(readings.slip, readings.load, 0.3, 0.6)
    psi = independent_process_columns(pts, readings.gear, least_eigenvalue=1e-2)
    return np.concatenate([jac[:, [i]] * psi for i in range(jac.shape[1])], axis=1)
