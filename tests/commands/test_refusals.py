"""Bad input of every command: one line on standard error, status 2, nothing left behind."""

import numpy as np
import pytest
from conftest import MODEL, RECIPE, THREE_CHANNEL_MODEL
from console import refused

RUNS = "run,slip,load_N,torque_Nm\na,0.1,60,1.5\nb,0.3,80,3.0\n"
FULL = {"run": "a", "slip": "0.1", "load_N": "60", "torque_Nm": "1.5", "drawbar_pull_N": "1",
        "sinkage_m": "0.01"}  # fmt: skip
SPEC = '[[regressor]]\ntype = "linear"\n'
EFFECT = '[[effect]]\nname = "slip-sinkage"\nn1 = 0.1\n'
ROVER = """\
[rover]
mass = 30.0
centre_of_mass = [0.0, 0.0, 0.2]
[rover.wheels]
front = { position = [0.4, 0.0] }
rear = { position = [-0.4, 0.0] }
"""


def changed(*pairs, text=RUNS):
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def with_column(name, *cells):
    """The runs with a further column."""
    lines = zip(RUNS.splitlines(), (name, *cells), strict=True)
    return "".join(f"{line},{cell}\n" for line, cell in lines)


#: A table or a model file in the place of `bad`, and what is said of it by each command.
TABLES = {
    "misspelt column": (changed(("torque_Nm", "torqe_Nm")), "torqe_Nm"),
    "extra column": (with_column("mood", "5", "5"), "mood"),
    "wrong unit": (changed(("load_N", "load_kN")), "load is read in N"),
    "text in a number": (changed(("3.0", "three")), "line 3, column torque_Nm"),
    "NaN": (changed(("3.0", "NaN")), "line 3, column torque_Nm"),
    "negative load": (changed(("80", "-80")), "line 3, column load_N"),
    "slip in percent": (changed(("0.3", "30")), "as a fraction and not in percent"),
    "empty file": ("", "is empty"),
    "no such file": (None, "no such file"),
}
READERS = {
    "identify": "identify model.toml bad.csv -o out.json",
    "estimate": "estimate good.onnx bad.csv -o out.csv",
    "gap": "gap model.toml bad.csv -o out",
    "pull": "pull model.toml bad.csv -o out.csv",
    "plan next": "plan next model.toml bad.csv -o out.csv",
}
#: Column and value of `FULL` that no rover meets.
BEYOND = [("load_N", "2e7"), ("load_N", "1e-7"), ("torque_Nm", "1e308"), ("drawbar_pull_N", "1e9"),
          ("sinkage_m", "11"), ("pass", "0.5"), ("speed_m_s", "101"), ("slip_angle_rad", "2"),
          ("torque_Nm_std", "1e300"), ("torque_Nm_std", "0"), ("run", "")]  # fmt: skip
MODELS = {
    "400 digits": (MODEL.replace("0.15", "9" * 400), "gear radius: the whole number has more"),
    "5000 digits": (MODEL.replace("0.15", "9" * 5000), "a number has thousands of digits"),
    "digits of noise": (MODEL.replace('"2 %"', "9" * 400), "noise torque_Nm: the whole number"),
    "nested": ("x = " + "[" * 20_000, "nested too deep"),
    "many parts": (".".join("a" * 1000) + " = 1", "nested too deep"),
    "effect twice": (MODEL + EFFECT + EFFECT, "bad.toml [[effect]] number 2: the model has"),
    "misspelt key": (changed(("radius", "raduis"), text=MODEL), "'raduis'"),
    "noise of nothing real": (THREE_CHANNEL_MODEL + 'slip = "1e300 %"\n', "bad.toml [noise]: "),
    "folder": (None, "Is a directory"),
}
SPECS = {
    "seed": ("seed = -1\n" + SPEC, "seed is -1"),
    "status as target": ('targets = ["status"]\n' + SPEC, "'status' cannot be estimated"),
    "target twice": ('targets = ["cohesion", "cohesion"]\n' + SPEC, "a name is repeated"),
    "half a ratio": ('features = ["torque/"]\n' + SPEC, "feature 'torque/'"),
    "truth as a width": ('[[regressor]]\ntype = "mlp"\nhidden = [true]\n', "hidden is [True]"),
    "an unbridled step": (
        '[[regressor]]\ntype = "mlp"\nhidden = [4]\nepochs = 3\nlearning_rate = 1e12\n',
        "mlp did not converge",
    ),
}
SIMULATE = "simulate model.toml --slip 0.1 --load"
GAP = "gap model.toml runs.csv -o out"
#: A command line, and what its one line says.
LINES = {
    f"{SIMULATE} 1e6 -o o.csv": "no equilibrium",
    "simulate model.toml --slip 1 --load 9": "slip is 1",
    f"{SIMULATE} -9": "load is -9",
    "simulate model.toml --slip a:b:c --load 9": "start:stop:count",
    "simulate none.toml --slip 0.1 --load 9": "no such file",
    "simulate model.toml --slip 0.1": "--load",
    "simulat": "simulat",
    f"{SIMULATE} 9 -o o.parquet": "must end in .csv",
    f"{SIMULATE} 9 -o no/o.csv": "does not exist",
    f"{SIMULATE} 9 --speed=--": "--speed=--: needed is a value",
    f"{SIMULATE} 9 --slip-angle 95": "'95' given; needed is -91 to 91 degrees",
    f"{SIMULATE} 9 --run {'a' * 300}": "--run",
    "identify model.toml runs.csv --free phi": "phi",
    "identify model.toml runs.csv --method best": "best",
    "identify model.toml runs.csv --where run=z": "run = z",
    "identify model.toml runs.csv --where run": "COLUMN=",
    "identify model.toml cm.csv": "cm.csv line 2, column sinkage_m",
    "pull two.toml gears.csv": "choose one with --gear, which also selects its rows",
    "identify two.toml gears.csv --gear round": "no row has gear = round; values are narrow, wide",
    "identify model.toml runs.csv --gear wide": "model.toml has one gear, in [gear]; omit --gear",
    "estimate runs.csv runs.csv": "not a valid ONNX model",
    "estimate cut.onnx runs.csv -o o.csv": "cut.onnx",
    "estimate good.onnx runs.csv --by soil": "column soil",
    "estimate good.onnx lugs.csv": "line 3, column grouser_height_m: 0.01 given",
    "estimate good.onnx wide.csv": "line 2, column wheel_radius_m: 0.1 given",
    "estimate good.onnx --by run": "RUNS.csv is missing",
    "compare small.toml good.parquet good.onnx -o o": "radius 0.15",
    "compare model.toml runs.csv good.onnx -o o": "no truth",
    "train fusd good.parquet o.onnx": "fused, leg_soil, linear, lssvm, mlp, slip",
    "train spec.toml cut.parquet o.onnx": "not a complete Parquet",
    "train spec.toml runs.csv o.onnx": "cohesion_Pa",
    "train spec.toml good.parquet o.pkl": "must end in .onnx",
    "generate model.toml o.parquet": "is missing",
    "generate recipe.toml o.parquet --rows 0": "a whole number from 1",
    "generate recipe.toml o.csv": "must end in .parquet",
    "show soils wong1989/wet_sand": "wet_sand",
    "show effects sinking": "sinking",
    f"{GAP} --seed -1": "--seed: '-1' given; needed is a whole number from 0",
    f"{GAP} --holdout pass=2": "column pass is missing",
    f"{GAP} --holdout load_N=61": "no row has load_N = 61",
    f"{GAP} --holdout run": "needs four runs or more; the table has 2",
    f"{GAP} --checked bulldozing=1": "needed is EFFECT=STD, with one of",
    f"{GAP} --checked torque-gain=0": "must be a number above zero",
    f"{GAP} --effects broken.py": "division by zero",
    f"{GAP} --effects empty.py": "no effect in it",
    "gap model.toml runs.csv -o file": "is a file; needed is a folder",
    "gap model.toml runs.csv -o taken": "gap.json",
    "gap same/model.toml runs.csv -o same": "same/model.toml is an input and would be overwritten",
    "gap rate.toml many.csv -o out": "the effect rate needs the column speed_m_s",
    "plan effects quiet.toml runs.csv": "give [noise] in the model file",
    "plan effects model.toml heavy.csv -o a.json": "heavy.csv line 3: no equilibrium",
    "plan effects model.toml runs.csv -o a.csv": "must end in .json",
    "plan next model.toml": "give --load 30,60,120",
    "plan next model.toml runs.csv --slip x": "--slip is 'x'; needed is start:stop:count",
    "plan next model.toml --load 1:100:2000": "too many to try; at most 1000",
    "plan next model.toml --load 60 --where run=a": "--where selects rows of RUNS.csv",
    "plan next model.toml runs.csv --slip 1.5": "slip 1.5 cannot be driven",
    "plan next model.toml --load 0": "load 0 N cannot be driven",
    "plan next model.toml --load 1e6": "try smaller loads",
    "plan next quiet.toml runs.csv": "declare it in [noise]",
    "plan next model.toml runs.csv --picture o.svg": "must end in .png",
    "plan next model.toml runs.csv -o runs.csv": "would be overwritten",
    "plan next rate.toml --load 60": "speed",
    "pull model.toml runs.csv --gravity 0": "gravity is 0 m/s^2; it must lie between",
    "pull rover.toml runs.csv --gravity pluto": "one of earth, moon, mars",
    "pull model.toml runs.csv --gravity moon --gravity-law bekker": "one of open, constant",
    "pull rover.toml runs.csv --tested-at earth": "--tested-at needs --gravity",
    "pull bare.toml runs.csv": "nothing to identify",
    "pull quiet.toml runs.csv": "needs the noise",
    "pull model.toml runs.csv --slip-limit 1": "0.001 to 0.999",
    "pull model.toml runs.csv --load 1e6": "at most about",
    "pull model.toml runs.csv --load 0": "needed is a load above zero",
    "pull model.toml runs.csv --load much": "start:stop:count",
    "pull model.toml runs.csv --load 10:90:9": "at most 8",
    "pull model.toml runs.csv --slope 70": "slopes must lie between 0 and 60 degrees",
    "pull model.toml runs.csv --by run --picture p.png": "--picture draws one soil",
    "bevameter runs.csv --format json -o soil.toml": "--format json and --out soil.toml differ",
}


@pytest.fixture
def folder(workplace, small_model, small_data):
    many = [
        f"{r},{s},{w},{s * w / 20}" for r, w in (("a", 60), ("b", 80)) for s in np.arange(1, 6) / 10
    ]
    quiet, _, noise = MODEL.partition("[noise]")
    gear, named = MODEL.partition("[soil]")[0], ("gears.narrow", "gears.wide")
    texts = {
        "model.toml": MODEL,
        "small.toml": changed(("radius = 0.15", "radius = 0.1"), text=MODEL),
        "rover.toml": MODEL + ROVER,
        "quiet.toml": quiet,
        "bare.toml": f"{MODEL.partition('[soil.prior]')[0]}[noise]{noise}",
        "rate.toml": MODEL + '[[effect]]\nname = "rate"\na = 0.1\n',
        "recipe.toml": RECIPE.format(rows=200, seed=1),
        "spec.toml": SPEC,
        "runs.csv": RUNS,
        "two.toml": MODEL.replace(gear, "\n".join(gear.replace("gear", name) for name in named)),
        "gears.csv": with_column("gear", "narrow", "wide"),
        "heavy.csv": changed(("80", "1e6")),
        "cm.csv": with_column("sinkage_m", "1.3", "1.9"),
        "lugs.csv": with_column("grouser_height_m", "0", "0.01"),
        "wide.csv": with_column("wheel_radius_m", "0.1", "0.1"),
        "many.csv": "\n".join([RUNS.split()[0], *many]) + "\n",
        "broken.py": "x = 1 / 0\n",
        "empty.py": "x = 1\n",
        "file": "a file\n",
        "same/model.toml": MODEL,
        "same/next_runs.csv": RUNS,
    }
    (workplace / "taken/gap.json").mkdir(parents=True)
    (workplace / "same").mkdir()
    for name, text in texts.items():
        (workplace / name).write_text(text)
    for file in (small_model, small_data):
        content = file.read_bytes()
        (workplace / f"good{file.suffix}").write_bytes(content)
        (workplace / f"cut{file.suffix}").write_bytes(content[:5000])
    return workplace


def test_command_lines(folder, capsys, subtests):
    for line, said in LINES.items():
        with subtests.test(line[:80]):
            refused(line.split(), capsys, said, folder)


def test_tables(folder, capsys, subtests):
    for fault, (text, said) in TABLES.items():
        (folder / "bad.csv").unlink(missing_ok=True)
        if text is not None:
            (folder / "bad.csv").write_text(text)
        for command, words in READERS.items():
            with subtests.test(f"{fault}, {command}"):
                refused(words.split(), capsys, said, folder)


def test_numbers_beyond_what_a_rover_meets_name_row_and_column(folder, capsys):
    for column, value in BEYOND:
        row = {**FULL, column: value}
        (folder / "bad.csv").write_text(f"{','.join(row)}\n{','.join(row.values())}\n")
        words = ["identify", "model.toml", "bad.csv"]
        refused(words, capsys, f"bad.csv line 2, column {column}", folder)


def test_model_files(folder, capsys, subtests):
    for fault, (text, said) in MODELS.items():
        (folder / f"bad/{fault}").mkdir(parents=True)
        bad = folder / f"bad/{fault}/bad.toml"
        bad.mkdir() if text is None else bad.write_text(text)
        with subtests.test(fault):
            refused(["identify", bad, "runs.csv"], capsys, said, folder)


def test_specs(folder, capsys, subtests):
    for fault, (text, said) in SPECS.items():
        (folder / "spec.toml").write_text(text)
        with subtests.test(fault):
            words = ["train", "spec.toml", "good.parquet", "o.onnx"]
            refused(words, capsys, said, folder)
