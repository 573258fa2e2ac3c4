"""Soil parameters that an analysis fits, and those that it takes as given."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.free_parameters import FreeParameter, select_free
from soilml.quantities import SHEAR


def free_soil_parameters(case: Case, free: Sequence[str] | None) -> list[FreeParameter]:
    """The soil parameters to fit: those named, else those with a prior, else the shear parameters.

    Raises `InputError` where a named parameter is one of the gear or of an effect.
    """
    selected = select_free(case, free if free is not None or case.prior else SHEAR)
    other = [f.path for f in selected if "." in f.path]
    if free is not None and other:
        raise InputError(f"--free {other[0]} is not a soil parameter; only those can be freed here")
    return [f for f in selected if "." not in f.path]


def fixed_parameters(case: Case, free: Sequence[FreeParameter]) -> list[str]:
    """Soil and gear parameters that were fixed at the values of the model file."""
    freed = {f.path for f in free}
    soil = [name for name in (*SHEAR, "kphi", "n") if name not in freed]
    return [*soil, *(path for path in case.parameters() if path.startswith(("gear.", "gears.")))]
