"""What is fuzzed: each target takes bytes, and only errors of soilml may leave it.

A target is a function of bytes and a strategy that makes them, so that every input that ever failed
can be kept as a file in `tests/fuzz/corpus/TARGET/`.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[1] / "faults"))

import files
import numpy as np
import onnx
import small_files
from hypothesis import strategies as st

import soilml
from datagen.recipe import parse_recipe, read_recipe
from soilml import EFFECTS, Estimator, LinearWheel, Model, Operating, Soil, Track, Wheel, identify
from soilml.cli import main
from soilml.config.case import read_case
from soilml.errors import SoilmlError, TableError
from soilml.gap import audit, gap
from soilml.identification import METHODS
from soilml.io.read_table import as_table, read_table
from soilml.io.table import Table
from soilml.log_import import import_log, init_map
from soilml.log_import.readers import read_log
from soilml.parameters import declared
from soilml.serve.forward import case_of_text

EXPORTED = Path(soilml.__file__).parents[1] / "exported"
ONNX = (EXPORTED / "wheel_linear.onnx").read_bytes()


@dataclass(frozen=True)
class Target:
    """A function of bytes, the strategy that makes them, and its relative share of examples."""

    run: Callable[[bytes], object]
    inputs: st.SearchStrategy[bytes]
    share: float = 1.0


def _in_file(name: str, use: Callable[[Path], object]) -> Callable[[bytes], object]:
    """`use` of a file with these bytes."""

    def run(content: bytes) -> object:
        with TemporaryDirectory() as folder:
            file = Path(folder) / name
            file.write_bytes(content)
            return use(file)

    return run


def _read_all(file: Path) -> None:
    table = read_table(file, ("run", "slip"), ignore_extra=True)
    for name in ("run", "slip"):
        list(table.groups(name))


def _log(content: bytes) -> None:
    """A map is guessed for a log, and is a map; the log is imported by it."""
    with TemporaryDirectory() as folder:
        log, drawn = Path(folder) / "rig.csv", Path(folder) / "map.toml"
        log.write_bytes(content)
        text = init_map(log)
        tomllib.loads(text)
        drawn.write_text(text.replace("# radius = ", "radius = "), encoding="utf-8")
        import_log(log, drawn, accept=True)


def _page_model(content: bytes) -> None:
    """A model file of the page: none of its text leads to a file."""
    asked: list[str] = []
    with _without_files(asked):
        try:
            case_of_text(content.decode(errors="replace"))
        finally:
            assert not asked, asked


@contextlib.contextmanager
def _without_files(asked: list[str]) -> Iterator[None]:
    """Note each file that is opened for reading and does not belong to the page."""
    opened = Path.open

    def noted(path: Path, *words: Any, **more: Any) -> Any:
        if path.name != "MODEL.toml" and "soilml" not in path.parts:
            asked.append(str(path))
        return opened(path, *words, **more)

    with mock.patch.object(Path, "open", noted):
        yield


def _rows(content: bytes) -> None:
    """Columns of Python values, as a mapping and as a table made of them: checked alike."""
    columns = json.loads(content)
    found = []
    for rows in (columns, Table(columns)):
        with contextlib.suppress(SoilmlError):
            found.append(as_table(rows))
    for table in found:
        assert len({len(column) for column in table.columns.values()}) == 1
        assert all(np.abs(table["slip"]) < 1.0) if "slip" in table else True
    if not found:
        raise TableError("refused")


def _model(content: bytes) -> None:
    """Forces over and beyond the box: a status or finite numbers for every row."""
    given = json.loads(content)
    soil = Soil(**dict(zip(declared(Soil), given["soil"], strict=False)))
    gears = (Wheel, LinearWheel, Track)
    gear = gears[given["gear"] % 3]
    sizes = dict(zip(declared(gear), given["sizes"], strict=False))
    names = sorted(EFFECTS)
    chosen = [EFFECTS[names[i % len(names)]] for i in given["effects"]]
    effects = [e(**{e.about.size: given["size"]}) for e in dict.fromkeys(chosen)]
    at = Operating(slip=np.asarray(given["slip"]), load=np.asarray(given["load"]), speed=0.1,
                   pass_number=2.0, slip_angle=0.1)  # fmt: skip
    if "base" in sizes:
        sizes["base"] = 2.0 * sizes["radius"] + abs(sizes["base"])
    force = Model(gear(**sizes), tuple(effects))(soil, at)
    ok = force.status == 0
    for name in ("torque", "drawbar_pull", "sinkage", "entry_angle"):
        assert np.isfinite(getattr(force, name)[ok]).all(), name
        assert np.isnan(getattr(force, name)[~ok]).all(), name


def _estimator(content: bytes) -> None:
    """Single readings and sets: always an estimate inside the prior."""
    given = json.loads(content)
    estimator = Estimator.load(EXPORTED / f"{('wheel', 'wheel_linear')[given['file'] % 2]}.onnx")
    readings = {name: np.asarray(given[name]) for name in ("slip", "load", "torque")}
    estimates = [estimator(**readings)]
    with contextlib.suppress(SoilmlError):
        estimates.append(estimator.run(**readings))
    for estimate in estimates:
        assert np.isfinite(estimate.mean).all() and (estimate.std > 0.0).all()
        assert (estimate.low <= estimate.high).all()


def _identified(content: bytes) -> None:
    model, _, table = content.partition(b"\x1e")
    with TemporaryDirectory() as folder:
        (Path(folder) / "m.toml").write_bytes(model)
        (Path(folder) / "r.csv").write_bytes(table)
        case, rows = read_case(Path(folder) / "m.toml"), read_table(Path(folder) / "r.csv")
    for method in METHODS:
        with contextlib.suppress(SoilmlError):
            identify(case, rows, method=method)
    audit(case, rows)


def _gap(content: bytes) -> None:
    model, _, table = content.partition(b"\x1e")
    with TemporaryDirectory() as folder:
        (Path(folder) / "m.toml").write_bytes(model)
        (Path(folder) / "r.csv").write_bytes(table)
        gap(read_case(Path(folder) / "m.toml"), read_table(Path(folder) / "r.csv"))


def _command(content: bytes) -> None:
    """A command line in a folder with a model, a table, a recipe and a model file."""
    words = json.loads(content)
    before = Path.cwd()
    with TemporaryDirectory() as folder:
        for name, text in (("m.toml", files.MODEL), ("r.csv", files.TABLE),
                           ("recipe.toml", files.RECIPE_TEXT)):  # fmt: skip
            (Path(folder) / name).write_text(text)
        (Path(folder) / "w.onnx").write_bytes(ONNX)
        os.chdir(folder)
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
                status = main(words)
        finally:
            os.chdir(before)
    assert status in (0, 1, 2), status
    assert status != 2 or said.getvalue().count("\n") == 1, said.getvalue()


numbers: st.SearchStrategy[Any] = (
    st.floats()
    | st.floats(0.0, 1.0)
    | st.floats(-1.0, 1.0)
    | st.sampled_from([0.15, 60.0, 1e4, 1e6, 1e-3, 1e308, -1e308, 0.999999999, 1e-12])
)


def near(lower: float, upper: float) -> st.SearchStrategy[float]:
    """A number of an interval, and one time in twenty any number."""
    within = st.floats(lower, upper)
    return st.integers(0, 19).flatmap(lambda chance: numbers if chance == 0 else within)


words = st.lists(
    st.sampled_from(
        ["m.toml", "r.csv", "w.onnx", "recipe.toml", "--out", "o.csv", "o.json", "o.parquet", "o/",
         "--slip", "0.1", "0.1:0.5:3", "--load", "60", "40,90", "--by", "run", "--where",
         "run=a", "--free", "cohesion", "--method", "linear", "posterior", "--seed", "--rows", "7",
         "--workers", "1", "--gear", "--effects", "--with", "--count", "--ignore-extra"]
    )
    | files.tokens.filter(lambda text: "\0" not in text and text.isprintable()),
    max_size=9,
)  # fmt: skip
commands = st.sampled_from(
    ["simulate", "identify", "gap", "estimate", "generate", "show", "plan", "bevameter",
     "import", "pull", "paper", "train", "export", "compare"]
)  # fmt: skip
slips, loads = (st.lists(near(*ends), min_size=3, max_size=3) for ends in ((-1, 1), (1, 1e3)))
torques = st.lists(near(-10.0, 50.0), min_size=3, max_size=3)
pairs = st.tuples(files.changed_text(files.MODEL), files.changed_text(files.TABLE)).map(
    lambda both: b"\x1e".join(both)
)
onnx_metadata = {e.key: e.value for e in onnx.load_from_string(ONNX).metadata_props}


@st.composite
def changed_metadata(draw: st.DrawFn) -> bytes:
    """The model file with one entry of its metadata changed, and signed again."""
    key = draw(st.sampled_from(sorted(onnx_metadata)))
    try:
        value = json.loads(onnx_metadata[key])
    except ValueError:
        value = onnx_metadata[key]
    return files.signed_model(ONNX, key, draw(files.changed_json(value)))


@st.composite
def parquet_files(draw: st.DrawFn) -> bytes:
    """Parquet files with columns of several types, damaged or not."""
    cells = st.sampled_from([0.1, 0.5, 0.2, 0.3, None, 1e308, float("nan"), -1.0, 3])
    texts = st.sampled_from(["a", "b", "c", "", None, "\x1b[2J", "=1", "a" * 300])
    count = draw(st.integers(1, 3))
    columns = {
        name: draw(st.lists(texts if name in ("run", "status") else cells, min_size=count,
                            max_size=count))
        for name in ("run", "slip", *draw(st.sets(st.sampled_from(["load_N", "status"]))))
    }  # fmt: skip
    metadata = {"soilml_units": draw(st.sampled_from(["{}", "[]", "{", "3"]))}
    if draw(st.booleans()):
        metadata["soilml_recipe"] = draw(st.sampled_from(["{}", "[", ""]))
    try:
        content = files.parquet_bytes(columns, metadata)
    except Exception:  # columns that Arrow has no type for
        content = b""
    return draw(st.just(content) | st.just(content) | files.changed_bytes(content or b"PAR1"))


def as_json(strategy: st.SearchStrategy[Any]) -> st.SearchStrategy[bytes]:
    """Values as the JSON that a target reads."""
    return strategy.map(lambda value: json.dumps(value).encode())


load_cases = {
    "soil": st.tuples(*(near(p.lower, p.upper) for p in declared(Soil).values())),
    "gear": st.integers(0, 2),
    "slip": slips,
    "load": loads,
    "size": near(0.0, 0.5),
    "sizes": st.lists(near(0.03, 0.4), min_size=8, max_size=8),
    "effects": st.lists(st.integers(0, 40), max_size=2),
}
readings = {"file": st.integers(0, 1), "slip": slips, "load": loads, "torque": torques}
#: Columns of one length mostly, of numbers mostly, some with names that no table has.
column_values = st.lists(numbers, min_size=2, max_size=2) | st.sampled_from(
    [[], [1.0], ["a", "b"], ["0.1", "0.2"], [None, 0.2], [True, False], [[0.1], [0.2, 0.3]], 0.1]
)
python_columns = st.dictionaries(
    st.sampled_from(["run", "slip", "load_N", "torque_Nm", "sinkage_m", "status", "load", "5"])
    | st.text(max_size=4),
    column_values,
    max_size=5,
)
RECIPE_JSON = json.dumps(read_recipe("wheel").content)
TARGETS: dict[str, Target] = {
    "csv": Target(
        _in_file("r.csv", _read_all), files.changed_text(files.TABLE) | st.binary(max_size=64), 3.0
    ),
    "parquet": Target(_in_file("r.parquet", _read_all), parquet_files()),
    "model-file": Target(_in_file("m.toml", read_case), files.changed_text(files.MODEL), 3.0),
    "recipe": Target(_in_file("m.toml", read_recipe), files.changed_text(files.RECIPE_TEXT), 2.0),
    "recipe-json": Target(
        lambda content: parse_recipe(content.decode(), "file"),
        as_json(files.changed_json(json.loads(RECIPE_JSON))),
        2.0,
    ),
    "log": Target(_log, files.changed_text(files.LOG) | st.binary(max_size=64), 0.3),
    "spreadsheet": Target(
        _in_file("r.xlsx", read_log), files.changed_bytes(small_files.small_xlsx()), 0.3
    ),
    "matlab": Target(
        _in_file("r.mat", read_log), files.changed_bytes(small_files.small_mat()), 0.5
    ),
    "hdf5": Target(_in_file("r.h5", read_log), files.changed_bytes(small_files.small_hdf5()), 0.5),
    "page-model": Target(_page_model, files.changed_text(files.MODEL + files.SIMULATOR), 0.5),
    "python-rows": Target(_rows, as_json(python_columns), 3.0),
    "onnx": Target(
        _in_file("m.onnx", Estimator.load), files.changed_bytes(ONNX) | changed_metadata(), 0.5
    ),
    "forward-model": Target(_model, as_json(st.fixed_dictionaries(load_cases)), 2.0),
    "estimator": Target(_estimator, as_json(st.fixed_dictionaries(readings)), 0.5),
    "identify": Target(_identified, pairs, 0.2),
    "gap": Target(_gap, pairs, 0.025),
    "command": Target(
        _command, as_json(st.tuples(commands, words).map(lambda c: [c[0], *c[1]])), 0.3
    ),
}


def check(name: str, content: bytes) -> None:
    """Run a target; any other error than soilml's leaves this."""
    with contextlib.suppress(SoilmlError):
        TARGETS[name].run(content)
