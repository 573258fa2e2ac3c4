"""Figures of a verdict and checks of its data on numbers that are worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml import Table
from soilml.errors import InputError
from soilml.gap import checks
from soilml.gap.checks import CheckedData, Consequence
from soilml.gap.design.run_kinds import LISTED, check_costs, rank_by_cost
from soilml.gap.design.run_options import (
    HIGHEST_SLIP,
    ROWS_PER_RUN,
    _middle_load,
    _usual,
    _whole,
    drivable_slips,
)
from soilml.gap.evidence.holdout_split import split_holdout
from soilml.gap.report.results import NextRun
from soilml.gap.verdict import remainder as remaining
from soilml.remarks import texts

CHANNELS = ("torque", "sinkage")


def made(columns):
    """A table of lists."""
    return Table({name: np.asarray(values) for name, values in columns.items()})


def stub(**values):
    return SimpleNamespace(**values)


def readings(torque, sinkage=(), slip=None, load=None):
    channel = np.asarray([0] * len(torque) + [1] * len(sinkage))
    values = np.asarray([*torque, *sinkage], dtype=float)
    slip = np.linspace(0.1, 0.5, values.size) if slip is None else np.asarray(slip)
    load = np.full(values.size, 60.0) if load is None else np.asarray(load)
    return stub(channels=CHANNELS, channel=channel, measured=values, slip=slip, load=load)


def test_where_the_discrepancy_is_largest():
    slip, load = np.asarray([0.1, 0.25]), np.asarray([60.0, 123.4])
    said = remaining._largest(np.asarray([0.5, -2.0]), slip, load, "N")
    assert said == "measured below the model by up to 2.0 N, at slip 0.25 under 123 N"
    assert remaining._largest(np.zeros(2), slip, load, "N") == ""


def severities(check, **values):
    data = CheckedData(**{"readings": None, "rows": 10, "parameters": 3} |
                       values)  # fmt: skip
    return [severity for severity, _ in check(data)]


@pytest.mark.parametrize(
    ("count", "expected"),
    [(6, [Consequence.ERROR]), (7, [Consequence.NAMING_OBSTACLE]), (11, [])],
)
def test_readings_for_three_parameters(count, expected):
    class Several:
        channels = CHANNELS

        def __len__(self):
            return count

    assert severities(checks._check_count, readings=Several()) == expected


@pytest.mark.parametrize(
    ("values", "std", "expected"),
    [
        ([1.0, 2.0, 3.0, 4.0], 4e-6, [Consequence.ERROR]),
        ([1.0, 2.0, 3.0, 4.0], 4.1e-6, []),
        ([1.0, 2.0, 3.0, 4.0], np.nan, [Consequence.ERROR]),
        ([1.0, 1.0, 1.0, 1.0], 0.1, [Consequence.ERROR]),
        ([1.0, 1.0, 1.0], 0.1, []),  # few rows may agree
    ],
)
def test_noise_and_life_of_a_channel(values, std, expected):
    given = readings(values)
    given = stub(**vars(given) | {"std": np.full(len(values), std), "channels": ("torque",)})
    assert severities(checks._check_channels, readings=given) == expected


def test_repeats_give_the_noise_by_their_degrees_of_freedom():
    """Two groups of four: deviations of 1 and 2 about their means, six degrees of freedom."""
    values = [9.0, 11.0, 9.0, 11.0, 18.0, 22.0, 18.0, 22.0]
    given = stub(
        channels=("torque",), channel=np.zeros(8, dtype=int), measured=np.asarray(values),
        std=np.full(8, np.nan), replicates=np.repeat([3, 7], 4),
    )  # fmt: skip
    noise, notes = checks.estimate_repeat_noise(given)
    assert noise == {"torque": pytest.approx(np.sqrt(20.0 / 6.0))}
    assert texts(notes) == [
        "noise of torque_Nm is not declared: 1.83 was estimated from repeated rows"
    ]  # fmt: skip
    few = stub(**vars(given) | {"replicates": np.asarray([3, 3, 3, 3, 7, 7, 7, 8])})
    assert checks.estimate_repeat_noise(few) == ({}, [])
    equal = stub(**vars(given) | {"measured": np.repeat([9.0, 18.0], 4)})
    noise, notes = checks.estimate_repeat_noise(equal)
    assert noise == {} and "its repeated rows are equal" in notes[0].text
    known = stub(**vars(given) | {"std": np.ones(8)})
    assert checks.estimate_repeat_noise(known) == ({}, [])


def test_a_quarter_of_the_runs_is_held_out():
    table = made({"run": list("aabbccddeeffgghh"), "slip": np.arange(16.0)})
    split = split_holdout(table, "run", seed=1)
    held = set(split.held_out["run"])
    assert len(held) == 2 and held | set(split.analysed["run"]) == set("abcdefgh")
    assert not held & set(split.analysed["run"])
    assert split.name == "held_out_runs"
    assert split.description == f"runs {', '.join(sorted(held))}, held out"
    few = made({"run": list("aabbccdd"), "slip": np.arange(8.0)})
    assert len(set(split_holdout(few, "run", seed=0).held_out["run"])) == 1
    with pytest.raises(InputError, match="needs four runs or more; the table has 3"):
        split_holdout(made({"run": list("abc"), "slip": np.arange(3.0)}), "run", seed=0)


def test_rows_with_a_value_are_held_out():
    table = made({"load_N": [40.0, 80.0, 40.0], "slip": [0.1, 0.1, 0.1]})
    split = split_holdout(table, "load_N=40", seed=0)
    assert split.held_out["load_N"].tolist() == [40.0, 40.0]
    assert (split.name, split.description) == ("held_out_region", "load_N=40, held out")
    assert split_holdout(table, None, seed=0).held_out is None
    with pytest.raises(InputError, match="no row remains"):
        split_holdout(table, "slip=0.1", seed=0)
    with pytest.raises(InputError, match="needed is run, or COLUMN=VALUE"):
        split_holdout(table, "runs", seed=0)


def test_runs_by_what_they_tell_per_cost():
    runs = [NextRun(kind, kind, float(d), None) for d, kind in
            ((6, "heavier"), (5, "braking"), (4, "reverse"))]  # fmt: skip
    assert [run.kind for run in rank_by_cost(runs, {})] == ["heavier", "braking", "reverse"]
    ranked = rank_by_cost(runs, {"heavier": 3.0, "reverse": 0.5})
    assert [(run.kind, run.cost) for run in ranked] == [
        ("reverse", 0.5),
        ("braking", 1.0),
        ("heavier", 3.0),
    ]
    assert len(rank_by_cost(runs * 4, {})) == LISTED
    assert check_costs({"second-pass": 2, "heavier": 0.1}) == {"second pass": 2.0, "heavier": 0.1}
    for cost in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="needed is a number above zero"):
            check_costs({"heavier": cost})


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0.05, 0.6, [0.05, 0.15, 0.2, 0.3, 0.35, 0.45, 0.5, 0.6]),
        (0.1, 0.2, [0.1, 0.11, 0.13, 0.14, 0.16, 0.17, 0.19, 0.2]),
        (0.1, 0.4, [0.1, 0.14, 0.19, 0.23, 0.27, 0.31, 0.36, 0.4]),  # seven in steps of 0.05
        (0.78, 0.95, [0.78, 0.79, 0.8]),
        (-0.95, -0.78, [-0.8, -0.79, -0.78]),
    ],
)
def test_slips_in_steps_that_a_rig_can_set(low, high, expected):
    found = drivable_slips(low, high)
    assert found.tolist() == expected
    assert found.size <= ROWS_PER_RUN and np.abs(found).max() <= HIGHEST_SLIP


@pytest.mark.parametrize(
    ("load", "expected"), [(124.2, 124.0), (10.4, 10.0), (9.87, 9.9), (0.1234, 0.12), (99.6, 100.0)]
)
def test_loads_in_whole_newton_or_two_digits(load, expected):
    assert _whole(load) == expected


def test_the_middle_load_is_the_level_nearest_the_mean_logarithm():
    levels = stub(index=np.asarray([0, 0, 0, 1, 2]), count=3)
    given = stub(load=np.asarray([20.0, 20.4, 20.8, 60.0, 180.0]), load_levels=levels)
    # the mean logarithm is that of 37.6 N: nearer to 60 than to 20.4, as ratios
    assert _middle_load(given) == 60.0
    heavy = stub(load=np.asarray([20.0, 20.4, 20.8, 100.0, 180.0]), load_levels=levels)
    assert _middle_load(heavy) == 20.0


def test_covariates_as_most_rows_were_driven():
    at = stub(speed=np.asarray([-0.1, 0.1, 0.1234]), pass_number=np.asarray([3.0, 1.0, 2.0]),
              slip_angle=None)  # fmt: skip
    assert _usual(stub(at=at)) == {"speed": 0.1, "pass_number": 1.0}
    slow = stub(speed=np.asarray([0.01234]), pass_number=None, slip_angle=np.asarray([0.2, 0.1]))
    assert _usual(stub(at=slow)) == {"speed": 0.012, "slip_angle": 0.15}
