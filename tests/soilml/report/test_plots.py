"""Every result draws itself, into axes of the caller or into a figure of its own."""

from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL

from soilml import Estimator, Table, identify, read_case
from soilml.errors import InputError
from soilml.gap.results import GapReduction, GapReport
from soilml.traction import pull_report

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
ROOT = Path(__file__).parents[3]
ROVER = ROOT / "examples/rover/rover.toml"
ROWS = {
    "run": np.asarray(["a"] * 4),
    "slip": np.asarray([0.1, 0.2, 0.3, 0.5]),
    "load_N": np.asarray([40.0, 80.0, 40.0, 80.0]),
    "torque_Nm": np.asarray([0.75, 2.5, 1.4, 4.1]),
}


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    file = tmp_path_factory.mktemp("case") / "model.toml"
    file.write_text(MODEL)
    return read_case(file)


def fit(case):
    return identify(case, Table(dict(ROWS)), method="nonlinear")


def estimate(case):
    estimator = Estimator.load(ROOT / "exported/wheel_linear.onnx")
    return estimator(slip=ROWS["slip"], torque=ROWS["torque_Nm"], load=ROWS["load_N"])


def gap(case):
    figures = GapReduction(320.0, 1.0, {"torque_Nm": (55.2, 1.1)}, 12, "all rows fitted")
    return GapReport("named", "named", case, gap={"train": figures})


def pull(case):
    return pull_report(case, Table(dict(ROWS)), loads=[60.0], slip_limit=0.4, exact_model=True)


def rover(case):
    slopes = np.asarray([0.0, 0.1])
    return pull_report(read_case(ROVER), Table(dict(ROWS)), slopes=slopes, exact_model=True)


def imported(case):
    from soilml.log_import.result import ImportedLog

    table = Table(ROWS | {"torque_Nm_std": np.full(4, 0.05)})
    return ImportedLog(table, {}, (), (), radius=0.15)


def of_plates_and_shear(case):
    from soilml.identification.bevameter import bevameter

    z, j = np.linspace(0.005, 0.04, 8), np.linspace(0.002, 0.1, 8)
    plates = {"test": ["p"] * 8, "plate_radius_m": [0.05] * 8, "sinkage_m": z}
    shear = {
        "test": np.repeat(["a", "b"], 8),
        "normal_stress_Pa": np.repeat([4e3, 8e3], 8),
        "shear_displacement_m": np.tile(j, 2),
        "shear_stress_Pa": np.concatenate([s * -np.expm1(-j / 0.02) for s in (3e3, 5e3)]),
    }
    return bevameter(plates | {"pressure_Pa": 1e6 * z}, shear)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "shape", "said"),
    [
        (fit, (2,), "residual, sigma"),
        (estimate, (3,), "friction angle φ, °"),
        (gap, (1,), "fitted rows"),
        (pull, (3,), "drawbar pull, N"),
        (rover, (2, 2), "margin, N"),
        (imported, (1,), "torque, N m"),
        (of_plates_and_shear, (3,), "shear strength, kPa"),
    ],
)
def test_results_draw_themselves(make, shape, said, case):
    from matplotlib import pyplot
    from matplotlib.figure import Figure

    result = make(case)
    own = result.plot()
    assert np.shape(own) == shape
    texts = " ".join(t.get_text() for a in np.ravel(own) for t in a.findobj(matplotlib.text.Text))
    assert said in texts
    assert all(a.has_data() for a in np.ravel(own))
    pyplot.close("all")
    given = Figure().subplots(*shape, squeeze=False)
    back = np.ravel(result.plot(ax=given))
    assert all(a is b for a, b in zip(back, given.ravel(), strict=True))
    assert not pyplot.get_fignums()
    with pytest.raises(InputError, match="this plot needs"):
        result.plot(ax=Figure().subplots(5, 1))


def test_a_picture_of_columns_names_its_bands_and_points():
    from soilml.report.column_figure import column_picture

    pull = np.asarray([1.0, 2.0])
    ends = {"drawbar_pull_N_prior_p05": pull - 1, "drawbar_pull_N_prior_p95": pull + 1}
    columns = {"slip": np.asarray([0.1, 0.2]), "drawbar_pull_N": pull, **ends}
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots(1, 1, squeeze=False)
    picture = column_picture(columns, "slip", [("drawbar_pull_N",)], measured=columns)
    picture.draw(axes)
    named = {text.get_text() for text in axes[0, 0].get_legend().get_texts()}
    assert {"90 %, prior", "measured"} <= named
