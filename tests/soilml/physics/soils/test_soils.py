"""The catalogue of soils: units, bounds, sources, published numbers."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from soilml import soil, soil_catalogue
from soilml.errors import InputError
from soilml.parameters import check

PRINTED = list(
    csv.DictReader(Path(__file__).with_name("soils_printed.csv").read_text().splitlines())
)
FACTOR = {"kPa": 1e3, "deg": math.pi / 180.0, "kN": 1e3, "1": 1.0, "mm": 1e-3, "rad": 1.0, "m": 1.0}


def test_printed_values_stand_in_the_catalogue():
    for row in PRINTED:
        found = soil_catalogue()[row["soil"]].published[row["field"]]
        printed = float(row["value"]) * FACTOR[row["unit"]]
        assert found == pytest.approx(printed, rel=1e-5), row


def test_every_soil_is_valid_and_says_where_it_comes_from():
    for name, entry in soil_catalogue().items():
        check(entry.soil)
        assert any(year in entry.source for year in ("19", "20")), name
        assert entry.text and not set(entry.assumed) & set(entry.published), name


def test_printed_ranges_surround_the_value_and_stand_within_bounds():
    spread = {n: e for n, e in soil_catalogue().items() if e.spread}
    assert {"ding2015/lunar_soil", "moore1999/drift", "scott1970/apollo12"} <= set(spread)
    for entry in spread.values():
        for field, (low, high) in entry.spread.items():
            value = getattr(entry.soil, field)
            assert low <= value <= high
            check(soil(entry.name, **{field: low}))
            check(soil(entry.name, **{field: high}))
    ends = np.rad2deg(soil_catalogue()["moore1999/cloddy"].spread["friction_angle"])
    assert ends == pytest.approx([34.0, 39.0], abs=1e-4)


def test_unknown_names_come_with_a_hint():
    with pytest.raises(InputError, match="wong1989/dry_sand"):
        soil("wong/dry_sand")
    with pytest.raises(InputError, match=r"a soil has no 'phi'; it has: .*friction_angle"):
        soil("wong1989/dry_sand", phi=0.6)
