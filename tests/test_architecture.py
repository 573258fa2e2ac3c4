"""What the layout promises, checked on the source and in a fresh process."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("soilml", "datagen", "training")
FILES = sorted(f for p in PACKAGES for f in (ROOT / p).rglob("*.py"))
OF_SOILML = [file for file in FILES if file.is_relative_to(ROOT / "soilml")]
BOARD = {"numpy", "onnxruntime"}
ALLOWED_OUTSIDE_BOARD = {
    # where soilml itself may reach for more than the board has, always inside a function
    "soilml/arrays.py": {"torch", "array_api_compat"},
    "soilml/cli/commands/completion.py": {"shtab"},
    "soilml/io/csv_by_arrow.py": {"pyarrow"},
    "soilml/io/parquet.py": {"pyarrow"},
    "soilml/io/spreadsheet.py": {"python_calamine"},
    "soilml/io/table.py": {"pyarrow"},
    "soilml/experiment_design/simulator_runs.py": {"scipy"},
    "soilml/numerics/gaussian_emulator.py": {"scipy"},
    "soilml/systems/rim_stress/stress.py": {"scipy"},
    "soilml/systems/tracked_robot/signals.py": {"scipy"},
    "soilml/experiment_design/design.py": {"matplotlib"},
    "soilml/gap/notes.py": {"scipy"},
    "soilml/inference/evidence.py": {"scipy"},
    "soilml/inference/priors.py": {"scipy"},
    "soilml/inference/gaussian_terms.py": {"scipy"},
    "soilml/inference/scatter_elimination.py": {"scipy"},
    "soilml/rover_design/search.py": {"scipy"},
    "soilml/soil_maps/local_soils.py": {"scipy"},
    "soilml/soil_maps/raster.py": {"tifffile"},
    "soilml/soil_maps/workflow.py": {"scipy"},
    "soilml/report/page.py": {"jinja2"},
    "soilml/report/figure_style.py": {"matplotlib"},
    "soilml/report/column_figure.py": {"matplotlib"},
    "soilml/gap/pictures.py": {"matplotlib"},
    "soilml/log_import/import_report.py": {"matplotlib"},
    "soilml/log_import/readers/bags.py": {"rosbags", "mcap", "mcap_protobuf"},
    "soilml/log_import/readers/matlab.py": {"scipy", "h5py"},
    "soilml/log_import/readers/parquet_log.py": {"pyarrow"},
    "soilml/log_import/units.py": {"pint"},
    "soilml/physics/computing_device.py": {"torch"},
    "soilml/processes.py": {"threadpoolctl"},
    "soilml/results.py": {"pandas"},
    "soilml/serve/command.py": {"tornado"},
    "soilml/serve/application.py": {"tornado"},
    "soilml/serve/guarded_handler.py": {"tornado"},
    "soilml/optional_imports.py": {"tomli"},  # before Python 3.11
}


@cache
def text_of(file):
    return file.read_text()


@cache
def tree_of(file):
    return ast.parse(text_of(file))


def imports(tree, top_level_only=False):
    nodes = tree.body if top_level_only else ast.walk(tree)
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module


def test_the_layers_of_the_import_linter_hold():
    done = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout


def test_what_flies_imports_only_what_the_board_has():
    own = set(sys.stdlib_module_names) | {"soilml"}
    for file in OF_SOILML:
        name, tree = str(file.relative_to(ROOT)), tree_of(file)
        outside = {m.split(".")[0] for m in imports(tree)} - own
        assert outside - BOARD <= ALLOWED_OUTSIDE_BOARD.get(name, set()), name
        at_top = {m.split(".")[0] for m in imports(tree, top_level_only=True)}
        # handlers derive from the server's classes; the command imports them when it runs
        server = {"tornado"} if name.endswith(("/application.py", "/guarded_handler.py")) else set()
        assert at_top - own <= BOARD | server, name


def test_files_are_read_at_a_sitting_and_say_what_they_are():
    """One subject a file: usually 80 to 400 lines."""
    for file in FILES:
        assert len(text_of(file).splitlines()) <= 400, file
        assert ast.get_docstring(tree_of(file)), file
        assert file.stem not in ("utils", "common", "helpers", "core", "manager"), file


def test_public_functions_and_classes_are_described():
    for file in FILES:
        for node in tree_of(file).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{file}: {node.name}"


def test_no_two_classes_share_a_name():
    """Private classes of a module apart, a name means one thing in all three packages."""
    places = {}
    for file in FILES:
        for node in ast.walk(tree_of(file)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(file.relative_to(ROOT)))
    assert {name: files for name, files in places.items() if len(files) > 1} == {}


def test_no_program_searches_the_words_of_its_own_remarks():
    """Decisions are made from codes: texts may be reworded without another result."""
    searching = re.compile(
        r"in text for " + r"text in|in (str\([a-z_.]*|[a-z_]*)(note|remark|warning)(\)|\.text)"
    )
    for file in FILES:
        assert not searching.search(text_of(file)), file


def test_nothing_is_unpickled():
    modules = r"\b(pickle|cloudpickle|dill|joblib|marshal|shelve)\b|torch\.(load|save)\("
    assert not [file for file in FILES if re.search(modules, text_of(file))]
    tests = [file for file in (ROOT / "tests").rglob("*.py") if file != Path(__file__)]
    for file in [*FILES, *tests]:
        text = text_of(file)
        assert not re.search(r"allow_pickle\s*=\s*True|\bpickle\.loads?\(", text), file


def test_no_module_reads_the_time_of_day():
    """A clock that jumps must change no result, no name of a file and no waiting time."""
    reading = re.compile(r"\btime\.time\(|\bdatetime\.(now|today|utcnow)\(|\bdate\.today\(")
    assert not [str(file) for file in FILES if reading.search(text_of(file))]


def test_importing_soilml_loads_nothing_else():
    code = "import sys, soilml; print(*sorted(m for m in sys.modules if m.split('.')[0] in "
    code += "('numpy', 'scipy', 'torch', 'sklearn', 'onnxruntime', 'soilml')))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.split() == ["soilml"]


def test_listing_the_commands_loads_no_ground_library():
    code = "import sys; from soilml.cli.main import parser; parser(); "
    code += "print(*sorted({m.split('.')[0] for m in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    heavy = {"scipy", "torch", "sklearn", "onnx", "pyarrow", "matplotlib", "pint"}
    assert not heavy & set(done.stdout.split())


def test_every_public_name_can_be_had():
    import soilml

    for name in soilml.__all__:
        assert getattr(soilml, name) is not None
    assert set(dir(soilml)) == set(soilml.__all__)
    assert {effect.__name__ for effect in soilml.EFFECTS.values()} < set(soilml.__all__)
    with pytest.raises(AttributeError):
        _ = soilml.nonsense


def test_pinned_versions_cover_every_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pinned = {
        line.split("==")[0].lower().replace("_", "-")
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if "==" in line
    }
    needed = [*project["dependencies"]]
    for extra in project["optional-dependencies"].values():
        needed += extra
    for requirement in needed:
        assert re.match(r"[\w-]+", requirement)[0].lower() in pinned


def test_layout_page_names_every_room():
    page = (ROOT / "ARCHITECTURE.md").read_text()
    for room in sorted({file.parent.relative_to(ROOT) for file in FILES}):
        assert f"{room}/" in page, f"ARCHITECTURE.md does not name {room}/"


def test_no_two_test_files_share_a_name():
    """Pytest imports test files by their name alone, and refuses a second one of it."""
    names = [f.name for f in (ROOT / "tests").rglob("*.py")]
    assert sorted(names) == sorted(set(names))


def test_the_citation_names_this_version():
    import soilml

    assert f"version: {soilml.__version__}\n" in (ROOT / "CITATION.cff").read_text()
