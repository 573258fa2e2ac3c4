"""Candidates and the search: what free shapes cost, and how larger sets give way."""

from dataclasses import replace

import numpy as np
import pytest
from gap_sets import bench_of, case_of, driven

from soilml.gap.search.candidate_fits import coordinates
from soilml.gap.search.cross_validation import held_out_region, held_out_runs, shrink, unseen
from soilml.gap.search.stepwise import EARNS, _dropped, predicted_gains, search
from soilml.gap.statistics.signatures import signatures
from soilml.physics.effects import EFFECTS

DIGGING = EFFECTS["slip-sinkage"]
FEW = ("slip-sinkage", "bulldozing", "exit-angle", "torque-gain")


def small(bench):
    return replace(bench, effects={name: EFFECTS[name] for name in FEW})


@pytest.fixture(scope="module")
def dug():
    """A bench on rows in which the wheel digs itself in, and the soil alone fitted to them."""
    case = case_of()
    bench = small(bench_of(case, driven(case, [DIGGING(n1=0.4)], seed=2)))
    return bench, bench.soil_only([np.full(3, 0.5)])


@pytest.fixture(scope="module")
def named(dug):
    bench, soil = dug
    return bench.loosened(bench.fit(["slip-sinkage"], coordinates(soil)))


def test_the_true_law_needs_no_bend(named):
    assert not named.open
    assert named.strain == 0.0
    assert named.cost == named.strict.cost
    assert named.fit is named.strict
    assert named.price > 0.0


def test_free_shapes_lower_the_objective_and_pay_for_it(dug):
    case = case_of()
    bent = DIGGING(n1=0.4, by_slip=3.0)
    bench = small(bench_of(case, driven(case, [bent], seed=2)))
    found = bench.loosened(bench.fit(["slip-sinkage"], coordinates(dug[1])))
    assert found.shaped.cost + found.price < found.strict.cost
    assert found.open and found.fit is found.shaped
    assert found.cost == pytest.approx(found.shaped.cost + found.price)
    assert found.strain == pytest.approx(1.0, abs=0.3)  # by_slip 3 is one prior spread
    assert found.fit.values()["slip-sinkage.by_slip"] == pytest.approx(3.0, abs=0.5)


def test_an_effect_whose_law_is_certain_has_no_shape_to_pay_for(dug):
    bench, soil = dug
    found = bench.loosened(bench.fit(["torque-gain"], coordinates(soil)))
    assert found.price == 0.0 and not found.open


def test_slopes_are_shaped_only_as_far_as_slip_and_load_vary():
    case = case_of()
    bench = bench_of(case, driven(case, loads=(60.0, 60.0)))
    assert [a.path for a in bench.shapes(["slip-sinkage"])] == ["slip-sinkage.by_slip"]


def test_the_effect_that_acts_promises_most_and_keeps_it(dug, named):
    bench, soil = dug
    known, _ = signatures(soil.fitted(), bench.cells, bench.effects)
    gains = predicted_gains(bench, soil, known)
    assert max(gains, key=gains.get) == "slip-sinkage"
    assert soil.cost - named.cost > 0.5 * gains["slip-sinkage"]
    assert named.fit.values()["slip-sinkage.n1"] == pytest.approx(0.4, abs=0.02)


def test_the_search_names_what_acts(dug):
    bench, soil = dug
    found = search(bench, soil, 0)
    assert found.gap and found.adequate
    assert found.causes[0].names == ("slip-sinkage",)


def test_the_search_looks_no_further_where_nothing_is_missing():
    case = case_of()
    bench = small(bench_of(case, driven(case, seed=5)))
    found = search(bench, bench.soil_only([np.full(3, 0.5)]), 0)
    assert not found.gap
    assert found.causes == found.tried == ()


def test_a_larger_set_gives_way_to_a_smaller_that_explains_as_much(dug):
    bench, soil = dug
    pair = bench.fit(["bulldozing", "slip-sinkage"], coordinates(soil))
    tried = {pair.names: pair}
    kept = _dropped(bench, pair, tried)
    assert kept is not None and kept.names == ("slip-sinkage",)
    assert kept.cost <= pair.cost + EARNS
    assert set(tried) == {pair.names, ("slip-sinkage",), ("bulldozing",)}


def test_a_set_of_which_each_is_needed_stays():
    case = case_of()
    both = [DIGGING(n1=0.4), EFFECTS["bulldozing"](share=1.0)]
    bench = small(bench_of(case, driven(case, both, seed=3)))
    soil = bench.soil_only([np.full(3, 0.5)])
    pair = bench.fit(["bulldozing", "slip-sinkage"], coordinates(soil))
    assert _dropped(bench, pair, {pair.names: pair}) is None


def test_the_true_model_leaves_nothing_of_readings_without_noise(dug):
    case = case_of()
    bench = bench_of(case, driven(case, noise=0.0))
    truth = bench.cells.reading
    found = shrink(bench.cells, bench.cells.std, truth + 3.0 * bench.cells.std, truth, "all")
    assert found.before == pytest.approx(9.0) and found.after == 0.0
    assert set(found.channels) == {"torque_Nm", "drawbar_pull_N", "sinkage_m"}
    soil = bench.soil_only([np.full(3, 0.5)])
    for made in (held_out_runs(bench, soil, soil, 0), held_out_region(bench, soil, soil)):
        assert made.before == made.after < 0.05


def test_the_right_model_leaves_the_noise_and_the_soil_alone_more(dug, named):
    bench, soil = dug
    runs = held_out_runs(bench, soil, named.fit, 0)
    region = held_out_region(bench, soil, named.fit)
    train = shrink(bench.cells, bench.covariance.std, soil.prediction, named.fit.prediction, "all")
    for found in (train, runs, region):
        assert 0.5 < found.after < 1.8  # about 1, less a parameter's worth
        assert found.before > 10.0 * found.after
    assert region.what == "load_N >= 140, predicted from the rest"


def test_rows_that_took_no_part_are_predicted_as_well(dug, named):
    bench, soil = dug
    other = bench_of(bench.case, driven(bench.case, [DIGGING(n1=0.4)], loads=(75.0, 170.0), seed=9))
    found = unseen(bench, soil, named.fit, other.cells, "others")
    assert found.cells == len(other.cells)
    assert 0.4 < found.after < 2.0 < found.before


def test_a_prediction_without_equilibrium_counts_as_ten_sigma(dug):
    cells = dug[0].cells
    nowhere = np.full(len(cells), np.nan)
    assert shrink(cells, cells.std, nowhere, cells.reading, "all").before == 100.0
