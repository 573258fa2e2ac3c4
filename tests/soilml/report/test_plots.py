"""Every result draws itself, into axes of the caller or into a figure of its own."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import MODEL

from soilml import Estimator, Table, identify, read_case
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.experiment_design.design import CandidateRow
from soilml.gap.report.results import GapReduction, GapReport
from soilml.numerics.prior import Prior
from soilml.traction.report import pull_report

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
    return pull_report(case, Table(dict(ROWS)), loads=[60.0], slip_limit=0.4)


def rover(case):
    from soilml.traction.rover_report import rover_report

    return rover_report(read_case(ROVER), Table(dict(ROWS)), slopes=np.asarray([0.0, 0.1]))


def imported(case):
    from soilml.log_import.result import ImportedLog

    table = Table(ROWS | {"torque_Nm_std": np.full(4, 0.05)})
    return ImportedLog(table, {}, (), (), radius=0.15)


def comparison(case):
    from training.benchmark.methods import MethodEstimates, MethodKind
    from training.benchmark.paired_results import MethodResult
    from training.benchmark.user_comparison import MethodScores

    rng = np.random.default_rng(0)
    priors = (Prior(0.0, 1e3), Prior(0.4, 0.8))
    truth = np.stack([p.at(rng.random(9)) for p in priors], axis=1)
    std = np.asarray([p.std for p in priors])
    ends = np.stack([truth - std, truth + std], axis=1)
    estimates = MethodEstimates(
        mean=truth + 0.5 * std * rng.standard_normal((9, 2)),
        covariance=np.broadcast_to(np.diag(std**2), (9, 2, 2)),
        interval50=ends,
        interval90=ends,
        flagged=np.zeros(9, bool),
        seconds=0.1,
    )
    score = MethodResult(
        rows=1,
        method="m",
        kind=MethodKind.ANALYTIC,
        inputs="torque",
        priors=priors,
        truth=truth,
        estimates=estimates,
    )
    return MethodScores([score, replace(score, rows=6)], ["cohesion", "friction_angle"])


def audited(case):
    from soilml.gap import audit
    from soilml.physics.effects import EFFECTS

    slip, load = np.tile([0.1, 0.3, 0.5], 3), np.repeat([40.0, 60.0, 90.0], 3)
    noisy = replace(case, noise={"torque_Nm": Noise(share=0.02)})
    names = ("slip-sinkage", "torque-gain")
    design = {"run": np.repeat(["a", "b", "c"], 3), "slip": slip, "load_N": load}
    return audit(noisy, design, effects={name: EFFECTS[name] for name in names})


def advised(case):
    from soilml.experiment_design.design import Advice, RatedRow

    rows = [
        RatedRow(CandidateRow(slip, load, ("torque",)), np.asarray([0.9, slip, 0.5]))
        for slip in (0.1, 0.3)
        for load in (40.0, 60.0)
    ]
    names = ("cohesion", "friction_angle", "shear_modulus")
    return Advice(names, np.ones(3), tuple(rows), (), tuple(rows[:1]), 0)


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
        (fit, (3,), "cohesion c (kPa)"),
        (estimate, (3,), "friction angle φ (°)"),
        (gap, (), "Fitted rows"),
        (pull, (3, 1), "60 N on the wheel"),
        (rover, (2, 2), "steepest slope, degrees"),
        (imported, (1,), "torque / (load × radius)"),
        (comparison, (2, 2), "friction angle"),
        (audited, (), "that separates it from its nearest rival"),
        (advised, (3,), "shear modulus: now 100%"),
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
    given = Figure().subplots(*(shape or (1,)), squeeze=False)
    back = np.ravel(result.plot(ax=given[0, 0] if not shape else given))
    assert all(a is b for a, b in zip(back, given.ravel(), strict=True))
    assert not pyplot.get_fignums()
    with pytest.raises(InputError, match="this plot needs"):
        result.plot(ax=Figure().subplots(5, 1))


@pytest.mark.slow
def test_the_backend_is_left_to_the_user():
    """Reports need none; what the user draws after them has the one of MPLBACKEND."""
    code = "from soilml.report.figure_style import report_style\nwith report_style(): pass\n"
    code += "import os; from matplotlib import pyplot; pyplot.figure()\n"
    code += "print(pyplot.get_backend().lower(), os.environ['MPLBACKEND'])"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env=os.environ | {"PYTHONPATH": str(ROOT), "MPLBACKEND": "svg"},
    )  # fmt: skip
    assert done.stdout.split() == ["svg", "svg"]
