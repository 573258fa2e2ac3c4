"""What tests share: the input box, a reference case, small data."""

from __future__ import annotations

import functools
import os
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import qmc

os.environ.setdefault("OMP_NUM_THREADS", "1")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a job in the background of a shell
    signal.signal(signal.SIGINT, signal.default_int_handler)  # processes of tests are interrupted
sys.path.insert(0, str(Path(__file__).parent))

from compiled_c_fixtures import compiled as compiled
from compiled_c_fixtures import exported as exported
from compiled_c_fixtures import library as library
from shared_files import shared_folder
from slip_step_fixtures import slip_case as slip_case
from slip_step_fixtures import slip_drive as slip_drive
from slip_step_fixtures import slip_files as slip_files
from slip_step_fixtures import slip_in_c as slip_in_c
from slip_step_fixtures import slip_stream as slip_stream

#: The reference wheel on dry sand.
WHEEL_ON_SAND = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
"""
MODEL = (
    WHEEL_ON_SAND
    + """\
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.436332, 0.785398]
shear_modulus = [0.005, 0.03]
[noise]
torque_Nm = "2 %"
"""
)

#: A model with wider priors, whose noise is declared for three channels.
THREE_CHANNEL_MODEL = (
    WHEEL_ON_SAND
    + """\
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.3, 0.8]
shear_modulus = [0.005, 0.04]
[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.2"
sinkage_m = "2 %"
"""
)

RECIPE = (
    """\
rows = {rows}
seed = {seed}
"""
    + MODEL
    + """\
[operating]
slip = [0.05, 0.6]
load_N = [30.0, 120.0]
"""
)


def input_box(count: int, seed: int) -> dict[str, np.ndarray]:
    """Rows that fill the whole input box of the rigid wheel."""
    u = qmc.Sobol(11, rng=seed).random(count)

    def line(i, a, b):
        return a + (b - a) * u[:, i]

    def log(i, a, b):
        return a * (b / a) ** u[:, i]

    return {
        "cohesion": line(0, 0.0, 6000.0),
        "friction_angle": np.deg2rad(line(1, 15.0, 50.0)),
        "shear_modulus": log(2, 0.002, 0.06),
        "n": line(3, 0.4, 1.6),
        "kc": np.zeros(count),
        "kphi": log(4, 4e4, 1e7),
        "slip": line(5, -0.9, 0.95),
        "load": log(6, 5.0, 1000.0),
        "radius": log(7, 0.04, 0.5),
        "width": log(8, 0.02, 0.4),
        "a0": line(9, 0.3, 0.6),
        "a1": line(10, 0.0, 0.3),
    }


def solved(box: dict[str, np.ndarray], effects=(), gear=None, **known):
    """The package's answer for rows of a box; `known` are further fields of Operating."""
    from soilml import Model, Operating, Soil, Wheel

    names = ("cohesion", "friction_angle", "shear_modulus", "n", "kc", "kphi", "a0", "a1")
    soil = Soil(**{name: box[name] for name in names})
    gear = (gear or Wheel)(radius=box["radius"], width=box["width"])
    return Model(gear, tuple(effects))(soil, Operating(slip=box["slip"], load=box["load"], **known))


@pytest.fixture(scope="session", autouse=True)
def _one_session_for_each_file():
    """A file that many tests read is prepared once: a session keeps nothing between its runs."""
    from soilml.onboard import model_file

    with pytest.MonkeyPatch.context() as patch:
        made = functools.lru_cache(maxsize=12)(model_file.create_session)
        patch.setattr(model_file, "create_session", made)
        yield


#: Files of tests that look at the pictures of pages. Elsewhere these are drawn and not rendered,
#: which takes half of the time of a report.
LOOKING = ("test_one_report", "test_reports", "test_climb_command", "test_track_commands",
           "test_gap_command", "test_comparison")  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def _pictures_are_rendered_where_a_test_looks(request: pytest.FixtureRequest):
    from soilml.report import figure_style

    with pytest.MonkeyPatch.context() as patch:
        if request.path.stem not in LOOKING:
            patch.setattr(figure_style, "_inline", lambda *_: "<svg></svg>")
        yield


@pytest.fixture
def model_file(tmp_path: Path) -> Path:
    """The reference wheel as a model file."""
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    return path


@pytest.fixture
def case(model_file: Path):
    """The case of the reference wheel."""
    from soilml import read_case

    return read_case(model_file)


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of the test's own, in which it works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def small_data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Some thousand rows, a quarter of them in runs of 32."""
    from datagen.generate import generate
    from datagen.recipe import read_recipe

    def fill(folder: Path) -> None:
        recipe = folder / "recipe.toml"
        blocks = "[[runs]]\nrows = 1\nshare = 0.7\n[[runs]]\nrows = 32\nshare = 0.3\n"
        recipe.write_text(RECIPE.format(rows=8192, seed=5) + blocks)
        generate(read_recipe(recipe), folder / "data.parquet")

    return shared_folder(tmp_path_factory, "small_data", fill) / "data.parquet"


@pytest.fixture(scope="session")
def small_model(small_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fused estimator trained on the small data, with a quick perceptron."""
    from soilml.cli import main

    def fill(folder: Path) -> None:
        spec = folder / "spec.toml"
        spec.write_text(
            'seed = 1\n[[regressor]]\ntype = "fixed-size-lssvm"\ncentres = 60\n'
            '[[regressor]]\ntype = "mlp"\nhidden = [24]\nepochs = 12\n'
            '[[regressor]]\ntype = "linear"\n'
        )
        assert main(["train", str(spec), str(small_data), str(folder / "small.onnx")]) == 0

    return shared_folder(tmp_path_factory, "small_model", fill) / "small.onnx"


#: What a set of readings may be off by, generously: nothing of it is measured here.
LENIENT = ((1.0, 8.0, 64.0, 512.0), (15.0, 30.0, 120.0, 700.0))
#: Noise of the sensors in the files of sets.
SET_NOISE = {"torque": [0.0, 0.02], "sinkage": [0.0005, 0.05], "drawbar_pull": [0.5, 0.03]}


def _exported(folder: Path, posterior) -> Path:
    from training.export.model_file import export_any_wheel
    from training.set_posterior.response_surface import ResponseSettings
    from training.spec import AnyWheelSpec

    path = folder / "small.onnx"
    spec = AnyWheelSpec(posterior.family, ResponseSettings(0, 0, 0, 0), SET_NOISE, "{}")
    export_any_wheel(spec, replace(posterior, noise=SET_NOISE), {}, path)
    return path


def _fitted(factory: pytest.TempPathFactory, name: str, family, settings):
    """The set posterior of a family, with a response surface that is fitted once."""
    from response_arrays import load_response, save_response

    from training.set_posterior.graph import SetPosteriorGraph
    from training.set_posterior.posterior_summary import MisfitLimits
    from training.set_posterior.response_surface import fit_response

    def fill(folder: Path) -> None:
        save_response(folder / "response.npz", fit_response(family, settings, lambda *_: None))

    folder = shared_folder(factory, name, fill)
    response = load_response(folder / "response.npz")
    return SetPosteriorGraph(family, response, MisfitLimits(*map(np.asarray, LENIENT)))


@pytest.fixture(scope="session")
def wheel_posterior(tmp_path_factory: pytest.TempPathFactory):
    """The set posterior of the packaged wheel, learned from few designs."""
    from datagen.recipe import read_recipe
    from soilml.quantities import SHEAR
    from training.set_posterior.families.recipe_family import RecipeFamily
    from training.set_posterior.response_surface import ResponseSettings

    family = RecipeFamily.of(read_recipe("wheel"), SHEAR)
    return _fitted(tmp_path_factory, "wheel_response", family, ResponseSettings(768, 32, 400, 0))


@pytest.fixture(scope="session")
def wheel_set_file(wheel_posterior, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a model file, without regressors of single readings."""
    return _exported(tmp_path_factory.mktemp("wheel_set"), wheel_posterior)


@pytest.fixture(scope="session")
def wheel_sets(wheel_set_file: Path):
    """Its estimator."""
    from soilml import Estimator

    return Estimator.load(wheel_set_file)


@pytest.fixture(scope="session")
def any_posterior(tmp_path_factory: pytest.TempPathFactory):
    """The set posterior of wheels of any size, learned from so few designs that it is coarse."""
    from datagen.recipe import packaged_file
    from soilml.io.toml_settings import read_settings
    from training.set_posterior.families.dimensionless_family import DimensionlessFamily
    from training.set_posterior.response_surface import ResponseSettings

    settings = read_settings(packaged_file("any_wheel", "training", "specs"))
    family = DimensionlessFamily.take(settings.table("any_wheel"))
    return _fitted(tmp_path_factory, "any_response", family, ResponseSettings(768, 32, 60, 0))


@pytest.fixture(scope="session")
def any_set_file(any_posterior, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as a model file."""
    return _exported(tmp_path_factory.mktemp("any_set"), any_posterior)


def simulated_run(posterior, rows, seed=0, x=(0.2, -0.3, 0.1)):
    """Readings (rows,) of a soil in the middle of the prior, with 2 % of noise."""
    rng = np.random.default_rng(seed)
    recipe = posterior.family.recipe
    slip, load = (part.at(rng.random(rows)) for part in (recipe.slip, recipe.load))
    answers = posterior.family.responses(
        np.stack([slip, load], axis=1), np.broadcast_to(x, (rows, 1, 3))
    )[:, 0]
    torque = np.exp(answers[:, 0]) * load * (1.0 + 0.02 * rng.standard_normal(rows))
    return {"slip": slip, "load": load, "torque": torque}, np.exp(answers[:, 1])


#: Noise of the sensors as it is declared in `whole_file`.
FILE_NOISE = {"torque": [0.01, 0.02], "torque_bias": [0.0, 0.01], "sinkage": [0.0005, 0.05]}


@pytest.fixture(scope="session")
def whole_file(small_data: Path, wheel_posterior, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with estimates of single readings and a set posterior, as `wheel.onnx` is."""
    from training.dataset import read_dataset
    from training.export.model_file import export_model
    from training.spec import read_spec
    from training.train import train

    def fill(folder: Path) -> None:
        (folder / "spec.toml").write_text('seed = 1\n[[regressor]]\ntype = "linear"\n')
        spec = read_spec(folder / "spec.toml")
        trained = train(spec, read_dataset(small_data, spec.features, spec.targets))
        posterior = replace(wheel_posterior, noise=FILE_NOISE)
        whole = replace(trained, set_posterior=posterior)
        export_model(whole, folder / "whole.onnx", small_data)

    return shared_folder(tmp_path_factory, "whole_file", fill) / "whole.onnx"


#: Fixtures that train: tests that use one are slow.
TRAINED = {
    "whole_file",
    "small_data",
    "small_model",
    "wheel_posterior",
    "wheel_set_file",
    "any_posterior",
    "any_set_file",
}


#: A warning is an error, but for files and sockets left open, which are noticed when memory is
#: collected, in whatever test runs then.
LEFT_OPEN = ("default::ResourceWarning", "default::pytest.PytestUnraisableExceptionWarning")
WARNINGS = pytest.mark.filterwarnings("error", *LEFT_OPEN)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark tests that use a trained fixture as slow, and make warnings errors."""
    for item in items:
        if TRAINED & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)
        item.add_marker(WARNINGS, append=False)
