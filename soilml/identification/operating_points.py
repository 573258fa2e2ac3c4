"""How the rows of a table were driven."""

from __future__ import annotations

import numpy as np

from soilml.io.table import Table
from soilml.physics.operating_point import COVARIATES, Operating


def operating_points(table: Table) -> Operating:
    """The rows of a table as they were driven; a covariate with a blank cell counts as unknown."""
    known = {
        field: table[key]
        for field, key in COVARIATES.items()
        if key in table and np.isfinite(table[key]).all()
    }
    return Operating(slip=table["slip"], load=table["load_N"], **known)
