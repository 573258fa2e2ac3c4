"""Blind sets with a smooth discrepancy and other designs: as large, and as driven, as they say."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from datagen.blind_sets import Plan, draw_blind_set
from datagen.blind_sets.reading_errors import CHANNELS
from datagen.blind_sets.run_schedules import DESIGNS, LOAD_JITTER

PLAN = Plan("A", "slip-sinkage", 1.0, 0.01, 8, "dry-sand", 3, 7)


@pytest.mark.slow
def test_the_discrepancy_is_smooth_common_to_all_runs_and_independent_per_channel():
    found = []
    for seed in range(6):
        plan = Plan("D", "", 0.0, 0.01, 4, "loam", 3, seed, discrepancy=0.02, design="repeats")
        drawn = draw_blind_set(plan)
        extra = np.array([drawn.truth["discrepancy"]["runs"][name] for name in CHANNELS])
        slip, load = drawn.columns["slip"], drawn.columns["load_N"]
        one = (load == load[0]) & (drawn.columns["run"] == drawn.columns["run"][0])
        order = np.argsort(slip[one])
        steps = np.diff(extra[:, one][:, order], axis=1) / np.diff(slip[one][order])
        rms = np.sqrt(np.mean(extra**2, axis=1, keepdims=True))
        assert np.abs(steps / rms).max() < 40.0  # at most a few times the rms in 0.1 of slip
        for name in np.unique(drawn.columns["run"])[1:]:
            same = (drawn.columns["run"] == name) & (load == load[0])
            if same.any():
                np.testing.assert_array_equal(extra[:, same], extra[:, one])
        found.append(np.corrcoef(extra)[np.triu_indices(3, 1)])
    assert abs(np.mean(found)) < 0.3


@pytest.mark.slow
@pytest.mark.parametrize("design", DESIGNS)
def test_a_design_is_driven_as_it_says(design):
    runs = {"one-run": 1, "few-runs": 3, "few-rows": 1}.get(design, 8)
    for seed in range(2):
        drawn = draw_blind_set(replace(PLAN, design=design, runs=runs, seed=seed))
        columns = drawn.columns
        load, run = columns["load_N"], columns["run"]
        levels, count = len(np.unique(load)), len(np.unique(run))
        assert drawn.truth["plan"]["design"] == design
        if design == "one-load":
            assert levels == 1 and count == 8
        if design == "one-run":
            assert levels == 1 and count == 1 and len(load) == 24
        if design == "few-rows":
            assert levels == 1 and count == 1 and 5 <= len(load) <= 10
            assert all(np.isfinite(columns[name]).all() for name in CHANNELS)
        if design == "torque-alone":
            assert np.isfinite(columns["torque_Nm"]).all()
            assert (
                np.isnan(columns["drawbar_pull_N"]).all() and np.isnan(columns["sinkage_m"]).all()
            )
        if design == "few-runs":
            assert levels == 3 and count == 3
        if design.startswith("jittered"):
            spread = np.std([np.log(load[run == r]) for r in np.unique(run)], axis=1)
            assert levels > 8
            assert 0.3 * LOAD_JITTER[0] < np.mean(spread) < 1.5 * LOAD_JITTER[1]
        if design == "jittered-one-load":
            assert np.std(np.log(load)) < 1.5 * LOAD_JITTER[1]
        if design == "repeats":
            points = Counter(zip(columns["slip"], load, strict=True))
            assert set(points.values()) in ({2}, {3})
            assert count == len(points) * next(iter(points.values())) // (len(load) // count)
        if design == "missing-channels":
            blank = [name for name in CHANNELS if np.isnan(columns[name]).all()]
            assert sorted(blank) == sorted(drawn.truth["missing"]) and len(blank) in (1, 2)
            kept = set(CHANNELS) - set(blank)
            assert all(np.isfinite(columns[name]).all() for name in kept)
        if design == "two-gears":
            assert Counter(columns["gear"]) == {"wheel_a": 32, "wheel_b": 32}
        if design == "braking":
            assert columns["slip"].min() < -0.2 and columns["slip"].max() > 0.4
            assert drawn.region["slip"].min() < -0.2
        assert load.max() * 1.29 < drawn.region["load_N"].min()
