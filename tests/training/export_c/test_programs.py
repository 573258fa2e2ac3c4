"""Programs in C and C++ around exported files: examples, and a run under sanitizers."""

import re
import shutil
import subprocess

import numpy as np
import pytest
from compiled_c import COMPILERS, ROOT, WARNINGS
from simulated_rows import rows_of
from test_agreement import ONE_FIRST

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not COMPILERS, reason="no C compiler")]
EXAMPLES = ROOT / "examples" / "board"
SANITIZERS = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
FIELDS = ("slip", "torque", "load", "sinkage", "drawbar_pull")


def build(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:3000]
    assert done.stderr == ""


def run(program, given=""):
    done = subprocess.run([program], input=given, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:3000]
    return done.stdout


def lines_of(source, name, exported, library, program, compiler=None):
    """What a program around a released file prints; without a compiler it is C++."""
    folder, made = exported(name), library(name, *([compiler] if compiler else []))
    words = [compiler, *WARNINGS] if compiler else ["g++", "-std=c++11", *WARNINGS[1:]]
    command = [*words, f"-I{folder}", source, made, f"-Wl,-rpath,{made.parent}", "-lm"]
    build([*command, "-o", program])
    return run(program).splitlines()


@pytest.mark.parametrize("compiler", ONE_FIRST)
def test_the_c_example(compiler, exported, library, tmp_path):
    example, program = EXAMPLES / "main.c", tmp_path / "board"
    assert lines_of(example, "wheel", exported, library, program, compiler)[-1] == "answered"


@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_compiler_that_takes_no_nan_is_refused(compiler, flag, exported):
    source = exported("wheel_linear") / "wheel_linear.c"
    command = [compiler, "-std=c99", flag, "-c", source, "-o", "/dev/null"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode != 0 and "NAN marks what was not measured" in done.stderr


@pytest.mark.parametrize("compiler", ONE_FIRST)
def test_the_walk_through_of_the_page(compiler, exported, library, tmp_path):
    """The program of docs/how-to/deploy.md, which ends with a row that is set aside."""
    page = (ROOT / "docs/how-to/deploy.md").read_text()
    (tmp_path / "main.c").write_text(re.search(r"<<'END'\n(.*?)^END$", page, re.M | re.S)[1])
    own, program = tmp_path / "main.c", tmp_path / "board"
    *events, identity = lines_of(own, "wheel", exported, library, program, compiler)
    assert [line.split(":")[0] for line in events] == [f"event {e}" for e in (0, 0, 0, 0, 1)]
    assert identity.startswith("wheel by soilml ")


@pytest.mark.skipif(not shutil.which("g++"), reason="no C++ compiler")
def test_the_cpp_example(exported, library, tmp_path):
    example, program = EXAMPLES / "main.cpp", tmp_path / "board"
    lines = lines_of(example, "any_wheel", exported, library, program)
    assert len(lines) == 2 and all(line.endswith(", in range") for line in lines)


def sanitized(folder, program):
    """Whether the driver could be built with sanitizers, whose libraries may be missing."""
    driver = ROOT / "tests" / "training" / "export_c" / "driver.c"
    command = ["gcc", "-std=c99", "-O0", *SANITIZERS, f"-I{folder}", driver, folder / "wheel.c"]
    done = subprocess.run([*command, "-lm", "-o", program], capture_output=True)
    return done.returncode == 0


@pytest.mark.long
@pytest.mark.skipif("gcc" not in COMPILERS, reason="no gcc")
def test_no_access_out_of_bounds_and_nothing_undefined(exported, compiled, tmp_path):
    """Sets with rows of every sort; the answers are also those of the file without sanitizers."""
    program, rng = tmp_path / "driver", np.random.default_rng(6)
    if not sanitized(exported("wheel"), program):
        pytest.skip("gcc has no sanitizers here")
    odd = np.array([np.nan, np.inf, -np.inf, 0.0, -1.0, 2.0, 1e-40, 3e38], np.float32)
    sets = []
    for _ in range(6):
        rows = np.stack([rows_of(rng, 40)[name] for name in FIELDS], axis=1)
        spoilt = rng.random(rows.shape) < 0.03
        rows[spoilt] = rng.choice(odd, spoilt.sum())
        sets.append(rows)
    lines = ["\n".join(" ".join(f"{v:.9g}" for v in row) for row in rows) for rows in sets]
    found = np.loadtxt(run(program, "\n\n".join(lines) + "\n").splitlines())
    model, expected = compiled("wheel"), []
    for rows in sets:
        memory = model.start()
        for values in rows:
            row = model.row(**dict(zip(FIELDS, values.tolist(), strict=True)))
            alone, one = model.single(row)
            step, _ = model.step(memory, (type(row) * 1)(row))
            answer, whole = model.answer(memory)
            means = [one["mean"] * (alone >= 0), whole["mean"] * (answer >= 0)]
            expected.append([alone, step, answer, *np.stack(means, axis=1).reshape(-1)])
    expected = np.array(expected)
    assert (found[:, :3] == expected[:, :3]).all() and len(np.unique(found[:, :3])) > 3
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], rtol=1e-3, atol=1e-12)
