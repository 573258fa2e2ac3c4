"""Soil parameters from plate-sinkage and shear tests."""

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, K, N, plates, shear

from soilml import read_case
from soilml.errors import InputError, TableError
from soilml.identification.bevameter import bevameter
from soilml.identification.bevameter.soil_section import (
    missing_values,
    model_file_text,
    updated_soil,
)
from soilml.io.table import Table
from soilml.remarks import about


def model_file(tmp_path, radius=0.1, width=0.05, prior="cohesion = [0.0, 2000.0]\nkc = [0.0, 1e4]"):
    path = tmp_path / "model.toml"
    path.write_text(
        f'[gear]\ntype = "wheel"\nradius = {radius}\nwidth = {width}\n[soil]\n'
        f'name = "wong1989/dry_sand"\n[soil.prior]\n{prior}\n[noise]\ntorque_Nm = "2 %"\n'
    )
    return read_case(path)


def codes(result):
    return {remark.code for remark in result.remarks}


def contains(span, value):
    return span[0] <= value <= span[1]


def test_exact_tests_give_back_their_soil():
    found = bevameter(plates(), shear())
    true = {"kc": KC, "kphi": KPHI, "n": N, "cohesion": C, "friction_angle": PHI}
    for name, value in (true | {"shear_modulus": K}).items():
        assert found.soil[name] == pytest.approx(value, rel=0.01), name
        assert contains(found.estimates()[name].mean_95, value)
        assert contains(found.estimates()[name].another_place_95, value)


def test_size_area_and_load_describe_the_same_plate():
    table = plates(sizes=(0.05, 0.1))
    r = table["plate_radius_m"]
    by_load = {**table.columns, "load_N": table["pressure_Pa"] * np.pi * r**2}
    del by_load["pressure_Pa"]
    by_area = {**by_load, "plate_area_m2": np.pi * r**2}
    del by_area["plate_radius_m"]
    values = [bevameter(Table(columns)).soil for columns in (table.columns, by_load, by_area)]
    for other in values[1:]:
        assert other == pytest.approx(values[0], rel=1e-9)
    square = {**by_load, "plate_width_m": 2.0 * r, "plate_length_m": np.pi * r / 2.0}
    del square["plate_radius_m"]
    assert bevameter(Table(square)).plates.sizes == pytest.approx([np.pi * 0.025, np.pi * 0.05])


def test_a_ring_gives_what_a_shear_plate_gives():
    table, inner, outer = shear(), 0.10, 0.15
    ring = {
        "test": table["test"],
        "inner_radius_m": np.full(len(table), inner),
        "outer_radius_m": np.full(len(table), outer),
        "angle_rad": table["shear_displacement_m"] / (0.5 * (inner + outer)),
        "torque_Nm": table["shear_stress_Pa"] * 2.0 * np.pi * (outer**3 - inner**3) / 3.0,
        "load_N": table["normal_stress_Pa"] * np.pi * (outer**2 - inner**2),
    }
    assert bevameter(shear=Table(ring)).soil == pytest.approx(bevameter(shear=table).soil)


def test_a_blank_displacement_is_the_steady_end_of_a_test():
    table = shear(points=3)
    last = np.flatnonzero(np.append(table["test"][1:] != table["test"][:-1], True))
    j, tau = table["shear_displacement_m"].copy(), table["shear_stress_Pa"].copy()
    j[last] = np.nan
    tau[last] = C + table["normal_stress_Pa"][last] * np.tan(PHI)
    columns = table.columns | {"shear_displacement_m": j, "shear_stress_Pa": tau}
    assert bevameter(shear=Table(columns)).soil["cohesion"] == pytest.approx(C, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(0.05,), (0.05, 0.10)])
def test_ranges_of_plate_tests_contain_mean_and_next_place(sizes):
    """95 % ranges hold the true mean, and another place, in 88 to 100 % of 120 sets of tests."""
    scatter, rng = (0.25, 0.08), np.random.default_rng(7)
    mean, place = [], []
    for seed in range(120):
        fit = bevameter(plates(sizes, 3, scatter, seed)).plates
        n = fit.estimates()["n"]
        pressure = fit.draws.estimate(lambda d: d[0] + d[1] / sizes[-1], "Pa")
        level, change = np.asarray(scatter) * rng.standard_normal(2)
        p = (KC / sizes[-1] + KPHI) * fit.depth**N
        other = p * np.exp(level) * (fit.depth / 0.06) ** change
        mean += [contains(n.mean_95, N), contains(pressure.mean_95, p)]
        place += [
            contains(n.another_place_95, N + change),
            contains(pressure.another_place_95, other),
        ]
    assert 0.88 < np.mean(mean) <= 1.0
    assert 0.88 < np.mean(place) <= 1.0


@pytest.mark.slow
def test_ranges_of_shear_tests_contain_mean_and_next_place():
    rng, mean, place = np.random.default_rng(8), [], []
    for seed in range(120):
        found = bevameter(shear=shear(repeats=2, scatter=0.12, seed=seed)).estimates()
        factor = np.exp(0.12 * rng.standard_normal())
        mean += [
            contains(found["cohesion"].mean_95, C),
            contains(found["friction_angle"].mean_95, PHI),
        ]
        place.append(
            contains(found["friction_angle"].another_place_95, np.arctan(factor * np.tan(PHI)))
        )
    assert 0.88 < np.mean(mean) <= 1.0
    assert 0.88 < np.mean(place) <= 1.0


def test_more_tests_make_it_surer_and_more_samples_in_a_test_do_not():
    def width(**drawn):
        return np.diff(bevameter(plates(scatter=(0.2, 0.05), **drawn)).estimates()["n"].mean_95)[0]

    assert width(points=500) == pytest.approx(width(points=12), rel=0.2)
    assert width(repeats=8) < 0.7 * width(repeats=2)


def test_one_plate_size_tells_k_for_its_width_alone(tmp_path):
    table = plates(sizes=(0.08,))
    found = bevameter(table)
    assert "kc" not in found.estimates() and found.soil["kc"] == 0.0
    assert found.estimates()["k"].value == pytest.approx(KC / 0.08 + KPHI, rel=0.01)
    assert "one-plate-size" in codes(found)
    # the range at another width holds all from kphi = 0 to kc = 0
    same, narrow, wide = (
        bevameter(table, case=model_file(tmp_path, width=w)) for w in (0.08, 0.02, 0.16)
    )
    span = same.prior["kphi"]
    for other, low, high in ((narrow, 1.0, 4.0), (wide, 0.5, 1.0)):
        assert other.prior["kphi"].lower == pytest.approx(low * span.lower, rel=1e-3)
        assert other.prior["kphi"].upper == pytest.approx(high * span.upper, rel=1e-3)
        assert about(other.remarks, "another-width") == {"kphi"}
    assert "another-width" not in codes(same)
    assert contains((narrow.prior["kphi"].lower, narrow.prior["kphi"].upper), KC / 0.02 + KPHI)


def test_two_plate_sizes_tell_k_at_the_width_of_the_wheel(tmp_path):
    case = model_file(tmp_path, width=0.07)
    found = bevameter(plates(scatter=(0.1, 0.03)), case=case)
    updated = updated_soil(case, found)
    assert "kc" not in updated.prior  # at one width kc and kphi are one parameter
    span = updated.prior["kphi"]
    low, high = (x + updated.soil.kc / 0.07 for x in (span.lower, span.upper))
    assert contains((low, high), KC / 0.07 + KPHI)


@pytest.mark.parametrize(
    ("given", "own_prior"),
    [
        (None, None),
        (1000.0, (500.0, 1500.0)),
        (1000.0, (500.0, 20000.0)),
        (15000.0, (0.0, 20000.0)),  # above the whole strength
        (1000.0, None),
    ],
)
def test_one_normal_stress_shares_the_strength(tmp_path, given, own_prior):
    table, sigma = shear(stresses=(10e3,), repeats=4, scatter=0.02), 10e3
    case = model_file(
        tmp_path, prior=f"cohesion = {list(own_prior)}" if own_prior else "n = [1, 2]"
    )
    case = None if given is None else case.with_values({"cohesion": given})
    found = bevameter(shear=table, case=case)
    strength, soil = found.estimates()["shear_strength"], found.soil
    assert strength.value == pytest.approx(C + sigma * np.tan(PHI), rel=0.05)
    assert "one-normal-stress" in codes(found)
    weakest, strongest = strength.another_place_95
    lowest, highest = own_prior or (0.0, strongest)
    highest = min(highest, strongest)
    assert soil["cohesion"] == pytest.approx(min(given or 0.0, highest), rel=1e-5)
    tangent = max(strength.value - soil["cohesion"], 0.0) / sigma
    assert np.tan(soil["friction_angle"]) == pytest.approx(tangent, rel=1e-5, abs=1e-9)
    ends = {"cohesion": (lowest, highest)}
    tangents = [max(weakest - highest, 0.0) / sigma, max(strongest - lowest, 0.0) / sigma]
    ends["friction_angle"] = np.arctan(tangents)
    for name, span in ends.items():
        prior = found.prior[name]
        assert (prior.lower, prior.upper) == pytest.approx(tuple(span), rel=2e-3, abs=1e-3)
    whose = "the model file's" if own_prior else "0 to the whole strength"
    (said,) = [r.text for r in found.remarks if r.code == "assumed-range"]
    assert whose in said


def test_a_curved_failure_line_is_said_and_widens_the_ranges():
    table = shear(stresses=np.linspace(2e3, 30e3, 6), repeats=1)
    sigma = table["normal_stress_Pa"]
    bent = table.columns | {"shear_stress_Pa": table["shear_stress_Pa"] * (1.0 - sigma / 1e5)}
    straight, curved = bevameter(shear=table), bevameter(shear=Table(bent))
    assert "curved-failure-line" not in codes(straight)
    assert "curved-failure-line" in codes(curved)
    angles = [half[1] for half in curved.shear.halves]
    assert angles[0] > angles[1]
    assert all(contains(curved.estimates()["friction_angle"].mean_95, a) for a in angles)


def test_a_line_below_zero_goes_through_the_origin():
    table = shear()
    lower = table.columns | {
        "shear_stress_Pa": table["shear_stress_Pa"]
        * (table["normal_stress_Pa"] * np.tan(PHI) - 500.0)
        / (C + table["normal_stress_Pa"] * np.tan(PHI))
    }
    found = bevameter(shear=Table(lower))
    assert found.soil["cohesion"] == 0.0
    assert about(found.remarks, "below-zero") == {"cohesion"}


def test_peaks_and_rising_stresses_are_remarked_on():
    table = shear()
    j, tau = table["shear_displacement_m"], table["shear_stress_Pa"]
    peak = tau * (1.0 + 0.5 * np.exp(-(((j - 0.03) / 0.01) ** 2)))
    rising = tau * (1.0 + 20.0 * np.maximum(j - 0.04, 0.0))
    for stress, said in ((peak, "peak"), (rising, "still-rising")):
        found = bevameter(shear=Table(table.columns | {"shear_stress_Pa": stress}))
        assert said in codes(found)
    assert not {"peak", "still-rising"} & codes(bevameter(shear=table))


def test_a_bent_curve_is_remarked_on_and_its_exponents_are_in_the_range():
    table = plates()
    bent = table["pressure_Pa"] * (1.0 + table["sinkage_m"] / 0.05)
    found = bevameter(Table(table.columns | {"pressure_Pa": bent}))
    assert "exponent-depends-on-depth" in codes(found)
    assert "exponent-depends-on-depth" not in codes(bevameter(table))
    span = found.estimates()["n"].mean_95
    assert all(contains(span, half) for half in np.mean([c.halves for c in found.plates.curves], 0))


def test_unloading_and_zero_offsets_are_left_out():
    table = plates(repeats=1)
    extra = {
        "test": np.append(table["test"], ["0.05_0", "0.05_0"]),
        "plate_radius_m": np.append(table["plate_radius_m"], [0.05, 0.05]),
        "sinkage_m": np.append(table["sinkage_m"], [0.06, 0.0]),
        "pressure_Pa": np.append(table["pressure_Pa"], [10.0, -5.0]),
    }
    assert bevameter(Table(extra)).soil == pytest.approx(bevameter(table).soil)


def test_the_soil_can_be_written_as_a_model_file(tmp_path):
    case = model_file(tmp_path)
    found = bevameter(plates(), shear(), case)
    path = tmp_path / "soil.toml"
    path.write_text(model_file_text(found, case, "plates.csv"))
    again = read_case(path)
    assert again == updated_soil(case, found)
    assert again.soil.n == pytest.approx(N, rel=0.01) and again.noise == case.noise
    for name, prior in again.prior.items():
        assert contains((prior.lower, prior.upper), float(getattr(again.soil, name))), name
    part = bevameter(plates())
    assert missing_values(part) == ["cohesion", "friction_angle", "shear_modulus"]
    text = model_file_text(part, None, "plates.csv")
    assert "[gear]" not in text and "[soil.prior]" in text


def test_odd_units_are_remarked_on():
    kilopascals = plates().columns | {"pressure_Pa": plates()["pressure_Pa"] * 1e-3}
    assert about(bevameter(Table(kilopascals)).remarks, "doubtful-unit") == {"pressure_Pa"}
    low = shear().columns | {"normal_stress_Pa": shear()["normal_stress_Pa"] * 1e-3}
    assert "doubtful-unit" in codes(bevameter(shear=Table(low)))
    for factors, about_them in (
        ({"shear_displacement_m": 1e2}, {"shear_displacement_m"}),
        (
            {"shear_stress_Pa": 1e3, "normal_stress_Pa": 1e3},
            {"shear_stress_Pa", "normal_stress_Pa"},
        ),
    ):
        wrong = shear().columns | {name: f * shear()[name] for name, f in factors.items()}
        assert about(bevameter(shear=Table(wrong)).remarks, "doubtful-unit") == about_them


MISTAKES = [
    (plates, "plate_radius_m", None, "the size of the plate is missing"),
    (plates, "pressure_Pa", None, "pressure_Pa or load_N"),
    (plates, "pressure_Pa", np.nan, "more samples with growing sinkage"),
    (plates, "sinkage_m", None, "sinkage_m is missing"),
    (shear, "normal_stress_Pa", None, "column normal_stress_Pa is missing"),
    (shear, "shear_displacement_m", None, "column shear_displacement_m is missing"),
    (shear, "shear_stress_Pa", np.nan, "samples with a displacement and a shear"),
    (shear, "normal_stress_Pa", np.nan, "no normal stress above zero"),
]


@pytest.mark.parametrize(("tests", "key", "value", "said"), MISTAKES)
def test_tables_without_a_curve_are_refused(tests, key, value, said):
    table = tests(repeats=12)
    columns = {name: table[name] for name in table.columns if name != key}
    if value is not None:
        columns[key] = np.full(len(table), value)
    kind = "plates" if tests is plates else "shear"
    with pytest.raises(TableError, match=said):
        bevameter(**{kind: Table(columns)})


def test_no_tests_are_refused():
    with pytest.raises(InputError, match="no tests"):
        bevameter()


def test_json_of_the_result_holds_every_test():
    found = bevameter(plates(repeats=1), shear(repeats=1))
    content = found.as_json()
    assert list(content["estimates"]) == list(found.estimates())
    entry = content["plate_tests"][1]
    assert (entry["test"], entry["plate_m"]) == ("0.1_0", 0.1)
    assert entry["n"] == pytest.approx(N, rel=1e-3)
    assert entry["k"] == pytest.approx(KC / 0.1 + KPHI, rel=1e-3) and entry["misfit"] < 1e-6
    entry = content["shear_tests"][2]
    assert (entry["test"], entry["normal_stress_Pa"]) == ("20000_0", 20e3)
    assert entry["strength_Pa"] == pytest.approx(C + 20e3 * np.tan(PHI), rel=0.01)
    assert entry["shear_modulus_m"] == pytest.approx(K, rel=0.02)
    assert content["soil"] == found.soil
    assert content["remarks"] == [r.as_json() for r in found.remarks]
    assert bevameter(plates()).as_json()["shear_tests"] == []
