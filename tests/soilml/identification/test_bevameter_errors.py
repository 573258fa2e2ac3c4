"""Tables without a curve are refused, with what they lack."""

import numpy as np
import pytest
from bevameter_tables import plates, shear

from soilml.errors import InputError, TableError
from soilml.identification.bevameter import bevameter
from soilml.io.table import Table

MISTAKES = {
    "no plate": ("plate_radius_m", None, "the size of the plate is missing"),
    "no pressure": ("pressure_Pa", None, "pressure_Pa or load_N"),
    "nothing measured": ("pressure_Pa", np.nan, "more samples with growing sinkage"),
    "no sinkage": ("sinkage_m", None, "sinkage_m is missing"),
}


@pytest.mark.parametrize(("key", "value", "said"), MISTAKES.values(), ids=MISTAKES)
def test_plate_tables_without_a_curve_are_refused(key, value, said):
    columns = dict(plates().columns)
    if value is None:
        del columns[key]
    else:
        columns[key] = np.full(len(columns[key]), value)
    with pytest.raises(TableError, match=said):
        bevameter(Table(columns))


def test_shear_tables_without_a_curve_are_refused():
    columns = shear().columns
    with pytest.raises(TableError, match="column normal_stress_Pa is missing"):
        bevameter(shear=Table({k: v for k, v in columns.items() if k != "normal_stress_Pa"}))
    with pytest.raises(TableError, match="column shear_displacement_m is missing"):
        bevameter(shear=Table({k: v for k, v in columns.items() if k != "shear_displacement_m"}))
    blank = np.full(len(columns["test"]), np.nan)
    with pytest.raises(TableError, match="samples with a displacement and a shear"):
        bevameter(shear=Table(columns | {"shear_stress_Pa": blank}))
    with pytest.raises(TableError, match="no normal stress above zero"):
        bevameter(shear=Table(columns | {"normal_stress_Pa": blank}))
    with pytest.raises(InputError, match="no tests"):
        bevameter()
