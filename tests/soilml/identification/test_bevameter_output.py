"""Remarks, priors, JSON and pictures of plate and shear tests."""

import numpy as np
import pytest
from bevameter_tables import KC, KPHI, PHI, C, K, N, plates, shear

from soilml.identification.bevameter import (
    bevameter,
)
from soilml.identification.bevameter.result import save_picture
from soilml.identification.bevameter.scatter import (
    SpreadEstimate,
)


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
