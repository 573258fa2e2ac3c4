"""Equations without a solution, as an error that says what to look at."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from soilml.errors import FitError


@contextmanager
def solvable(what: str) -> Iterator[None]:
    """Inside, matrices that cannot be factored raise `FitError` naming what was computed.

    Also a decorator. Such matrices come of readings, noise or parameters many orders of magnitude
    apart, which no check of single values finds.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise FitError(
            f"{what} has no solution for these rows ({error}): check the units of the columns, and "
            "that the declared noise is that of the sensors"
        ) from None
