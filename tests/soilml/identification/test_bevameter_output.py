"""Remarks, priors, JSON and pictures of plate and shear tests."""

from dataclasses import replace

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, K, N, plates, shear
from remarked import remarked

from soilml.identification.bevameter import (
    bevameter,
    soil_section,
)
from soilml.identification.bevameter.remarks import plate_remarks, shear_remarks
from soilml.identification.bevameter.result import save_picture
from soilml.identification.bevameter.scatter import (
    SpreadEstimate,
)
from soilml.remarks import texts


def test_priors_of_a_soil_contain_its_value_and_keep_the_bounds():
    prior = soil_section._prior
    wide = prior("kphi", 1e6, (4e5, 2e6))
    assert (wide.lower, wide.upper, wide.log) == (4e5, 2e6, True)
    assert not prior("kphi", 1e6, (7e5, 2e6)).log  # less than a factor of three
    assert not prior("cohesion", 1e3, (0.0, 2e3)).log
    narrow = prior("n", 1.0, (1.0, 1.0))
    assert (narrow.lower, narrow.upper) == pytest.approx((0.999, 1.001))
    assert prior("cohesion", 10.0, (-50.0, 100.0)).lower == 0.0
    assert prior("friction_angle", 0.5, (0.1, 9.0)).upper == 1.4
    outside = prior("friction_angle", 2.0, (1.9, 2.1))
    assert outside.lower < outside.upper
    assert soil_section.within_bounds({"n": 9.0, "kc": 1.0, "cohesion": -2.0}) == {
        "n": 3.0,
        "kc": 1.0,
        "cohesion": 0.0,
    }


def test_remarks_name_what_stands_in_the_fits():
    fit = bevameter(plates(repeats=3, scatter=(0.2, 0.05))).plates
    said = texts(plate_remarks(fit))
    pressures = [np.exp(c.log_pressure) for t, c in zip(fit.tests, fit.curves, strict=True)]
    first = max(pressures[:3]) / min(pressures[:3])
    assert any(
        f"3 tests with the plate of 0.05 m differ by a factor {first:.2f}" in t for t in said
    )
    assert remarked(said, "they hold down to 0.08 m, the deepest test")
    assert not remarked(said, "no plate test was repeated")
    once = texts(plate_remarks(bevameter(plates(repeats=1)).plates))
    assert remarked(once, "no plate test was repeated")
    assert not remarked(once, "differ by a factor")
    negative = texts(plate_remarks(bevameter(plates(kc=-2e4, repeats=4)).plates))
    assert any(t.startswith(("kc is below zero", "kc may be below")) for t in negative)
    fit = bevameter(shear=shear(repeats=2, scatter=0.1)).shear
    said = texts(shear_remarks(fit))
    strengths = [c.strength for c in fit.curves[:2]]
    ratio = max(strengths) / min(strengths)
    assert any(f"2 tests at 5 kPa differ by a factor {ratio:.2f} in strength" in t for t in said)
    assert not remarked(said, "no shear test was repeated")
    assert not remarked(said, "normal stress varies")
    tests = [replace(t, normal_variation=0.051) for t in fit.tests]
    varied = texts(shear_remarks(replace(fit, tests=tuple(tests))))
    names = ", ".join(t.name for t in tests[:4])
    assert remarked(varied, f"within {names} and 2 more; its mean is used")
    poor = [replace(c, misfit=0.11 if i < 4 else 0.09) for i, c in enumerate(fit.curves)]
    said = texts(shear_remarks(replace(fit, curves=tuple(poor))))
    wanted = ", ".join(f"{t.name} (11%)" for t in fit.tests[:4])
    assert f"the law fits poorly, by its relative residual: {wanted}" in said
    peaks = [replace(c, peak=1.11 * c.end) for c in fit.curves]
    assert any(
        "passes a peak" in t for t in texts(shear_remarks(replace(fit, curves=tuple(peaks))))
    )
    peaks = [replace(c, peak=1.09 * c.end) for c in fit.curves]
    assert not any(
        "passes a peak" in t for t in texts(shear_remarks(replace(fit, curves=tuple(peaks))))
    )
    for change in ({"mobilised": 0.89}, {"end": 1.06 * fit.curves[0].strength, "mobilised": 1.0}):
        rising = (replace(fit.curves[0], **change), *fit.curves[1:])
        said = texts(shear_remarks(replace(fit, curves=rising)))
        assert any(f"still rises at the end of {fit.tests[0].name}:" in t for t in said)


def test_json_of_the_result_holds_every_test():
    found = bevameter(plates(repeats=1), shear(repeats=1))
    content = found.as_json()
    assert set(content["estimates"]) == {*("n", "kc", "kphi"), *("cohesion", "friction_angle")} | {
        "shear_modulus"
    }
    entry = content["plate_tests"][1]
    assert (entry["test"], entry["plate_m"]) == ("0.1_0", 0.1)
    assert entry["n"] == pytest.approx(N, rel=1e-3)
    assert entry["k"] == pytest.approx(KC / 0.1 + KPHI, rel=1e-3) and entry["misfit"] < 1e-6
    entry = content["shear_tests"][2]
    assert (entry["test"], entry["normal_stress_Pa"]) == ("20000_0", 20e3)
    assert entry["strength_Pa"] == pytest.approx(C + 20e3 * np.tan(PHI), rel=0.01)
    assert entry["shear_modulus_m"] == pytest.approx(K, rel=0.02)
    assert content["soil"] == found.soil and content["remarks"] == [
        r.as_json() for r in found.remarks
    ]
    assert bevameter(plates()).as_json()["shear_tests"] == []
    assert bevameter(shear=shear()).as_json()["plate_tests"] == []
    assert isinstance(found.estimates()["n"], SpreadEstimate)


def saved_figures(monkeypatch):
    """A list that gets each figure that is saved."""
    figure, found = pytest.importorskip("matplotlib.figure").Figure, []
    save = figure.savefig
    monkeypatch.setattr(figure, "savefig", lambda f, *a, **k: (found.append(f), save(f, *a, **k)))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("kinds", "panels"), [("plates", 1), ("shear", 2), ("both", 3)])
def test_a_picture_shows_tests_curves_and_laws(tmp_path, monkeypatch, kinds, panels):
    drawn = saved_figures(monkeypatch)
    found = bevameter(
        None if kinds == "shear" else plates(repeats=1), None if kinds == "plates" else shear()
    )
    save_picture(tmp_path / "soil.png", found)
    axes = drawn[0].axes
    assert (tmp_path / "soil.png").read_bytes().startswith(b"\x89PNG") and len(axes) == panels
    assert list(drawn[0].get_size_inches()) == pytest.approx([4.6 * panels, 3.9])
    lines = {a.get_ylabel(): [line.get_data() for line in a.lines] for a in axes}
    legends = {a.get_ylabel(): a.get_legend() is not None for a in axes}
    assert all(legends.values())
    if kinds != "shear":
        (z, p), (_, own), *_, (depth, law) = lines["pressure, kPa"]
        test = found.plates.tests[0]
        np.testing.assert_allclose(z, 1e3 * test.sinkage)  # mm
        np.testing.assert_allclose(p, 1e-3 * test.pressure)  # kPa
        np.testing.assert_allclose(own, p, rtol=1e-6)
        assert (depth[0], depth[-1]) == pytest.approx((5.0, 80.0))
        expected = (KC / 0.1 + KPHI) * (1e-3 * depth) ** N
        np.testing.assert_allclose(law, 1e-3 * expected, rtol=1e-3)
    if kinds != "plates":
        (j, tau), (grid, own), *_ = lines["shear stress, kPa"]
        np.testing.assert_allclose(j, np.linspace(2.0, 80.0, 15))
        np.testing.assert_allclose(np.interp(j, grid, own), tau, rtol=5e-3)
        assert grid[0] == 0.0 and grid[-1] == pytest.approx(80.0) and own[0] == 0.0
        (sigma, strength), (grid, line) = lines["shear strength, kPa"]
        np.testing.assert_allclose(sigma, [5.0, 5.0, 10.0, 10.0, 20.0, 20.0])
        np.testing.assert_allclose(np.interp(sigma, grid, line), strength, rtol=1e-3)
        assert (grid[0], grid[-1]) == pytest.approx((0.0, 21.0))
        limits = next(a for a in axes if a.get_ylabel() == "shear strength, kPa")
        assert limits.get_xlim()[0] == limits.get_ylim()[0] == 0.0


@pytest.mark.slow
def test_a_legend_of_many_tests_is_left_out(tmp_path, monkeypatch):
    drawn = saved_figures(monkeypatch)
    for repeats in (3, 4):  # six and eight tests
        save_picture(tmp_path / "soil.png", bevameter(plates(repeats=repeats)))
    assert [figure.axes[0].get_legend() is not None for figure in drawn] == [True, False]
