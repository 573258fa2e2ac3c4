"""Rows held out before an analysis, and soil that is free."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import case_of

from soilml.errors import InputError
from soilml.fitting.coordinates import fixed_parameters, free_soil_parameters
from soilml.gap.held_out import split_holdout
from soilml.io.table import Table
from soilml.quantities import SHEAR


def table_of(runs, line=False):
    names = np.repeat([f"run_{i}" for i in range(runs)], 2)
    load = np.where(np.arange(2 * runs) % 2, 90.0, 40.0)
    table = Table({"run": names, "load_N": load, "slip": np.linspace(0.1, 0.5, 2 * runs)})
    return replace(table, line=np.arange(2 * runs) + 2) if line else table


@pytest.mark.parametrize("runs, count", [(4, 1), (7, 1), (8, 2), (11, 2), (12, 3)])
def test_one_run_in_four_is_held_out(runs, count):
    table = table_of(runs)
    found = split_holdout(table, "run", 5)
    out, kept = set(found.held_out["run"]), set(found.analysed["run"])
    assert len(out) == count and len(kept) == runs - count and not out & kept
    assert len(found.held_out) + len(found.analysed) == len(table)
    assert found.name == "held_out_runs"
    assert found.description == f"runs {', '.join(sorted(out))}, held out"
    others = {split_holdout(table, "run", seed).description for seed in range(20)}
    assert len(others) > 2 and split_holdout(table, "run", 5).description == found.description


@pytest.mark.parametrize("line", [False, True])
def test_rows_with_a_value_are_held_out(line):
    found = split_holdout(table_of(3, line), "load_N=90", 0)
    assert found.held_out["load_N"].tolist() == [90.0] * 3
    assert found.analysed["load_N"].tolist() == [40.0] * 3
    assert (found.name, found.description) == ("held_out_region", "load_N=90, held out")


def test_what_cannot_be_held_out_is_refused():
    whole = split_holdout(table_of(3), None, 0)
    assert whole.held_out is None and len(whole.analysed) == 6
    with pytest.raises(InputError, match=r"needs four runs or more; the table has 3$"):
        split_holdout(table_of(3), "run", 0)
    with pytest.raises(InputError, match=r"^--holdout is 'load_N'; needed is run, or COLUMN=VALUE"):
        split_holdout(table_of(3), "load_N", 0)
    same = Table({"run": np.asarray(["a", "b"]), "load_N": np.asarray([90.0, 90.0])})
    with pytest.raises(InputError, match="load_N=90 holds out every row; no row remains"):
        split_holdout(same, "load_N=90", 0)


def test_a_soil_parameter_is_free_or_fixed():
    case = case_of()
    fixed = fixed_parameters(case, free_soil_parameters(case, ["cohesion"]))
    assert fixed[:7] == ["friction_angle", "shear_modulus", "kphi", "kc", "n", "a0", "a1"]
    assert fixed[7:] == [path for path in case.parameters() if path.startswith("gear.")]
    for prior, expected in (({}, SHEAR), ({"cohesion": case.prior["cohesion"]}, ["cohesion"])):
        free = free_soil_parameters(replace(case, prior=prior), None)
        assert [f.path for f in free] == list(expected)
    with pytest.raises(InputError, match=r"^--free gear.radius is not a soil parameter"):
        free_soil_parameters(case, ["cohesion", "gear.radius"])
