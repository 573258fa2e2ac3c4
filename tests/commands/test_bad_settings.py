"""Bad model files, recipes and specs: one line that names the place, and nothing left behind."""

import pytest
from conftest import MODEL

from soilml.cli import main
from soilml.onboard import Estimator

SPEC = '[[regressor]]\ntype = "linear"\n'
EFFECT = '[[effect]]\nname = "slip-sinkage"\nn1 = 0.1\n'
MODELS = {
    "400 digits": (MODEL.replace("0.15", "9" * 400), "gear radius: the whole number has more"),
    "digits of noise": (MODEL.replace('"2 %"', "9" * 400), "noise torque_Nm: the whole number"),
    "digits of a prior": (MODEL.replace("0.005", "9" * 400), "soil prior shear_modulus: the whole"),
    "5000 digits": (MODEL.replace("0.15", "9" * 5000), "a number has thousands of digits"),
    "nested": ("x = " + "[" * 20_000, "nested too deep"),
    "effect twice": (MODEL + EFFECT + EFFECT, "bad.toml [[effect]] number 2: the model has"),
    "folder": (None, "Is a directory"),
}
SPECS = {
    "seed": ("seed = -1\n" + SPEC, "seed is -1"),
    "text as target": ('targets = ["run"]\n' + SPEC, "'run' cannot be estimated"),
    "status as target": ('targets = ["status"]\n' + SPEC, "'status' cannot be estimated"),
    "reading as target": ('targets = ["torque"]\n' + SPEC, "'torque' cannot be estimated"),
    "target twice": ('targets = ["cohesion", "cohesion"]\n' + SPEC, "a name is repeated"),
    "half a ratio": ('features = ["torque/"]\n' + SPEC, "feature 'torque/'"),
    "truth as a width": ('[[regressor]]\ntype = "mlp"\nhidden = [true]\n', "hidden is [True]"),
    "nothing as a width": ('[[regressor]]\ntype = "lssvm"\nwidth = 1e-300\n', "width is 1e-300"),
    "an unbridled step": (
        '[[regressor]]\ntype = "mlp"\nhidden = [4]\nepochs = 3\nlearning_rate = 1e12\n',
        "mlp did not converge",
    ),
}


def refused(command, capsys, said):
    assert main(command) == 2
    captured = capsys.readouterr()
    lines = [line for line in captured.err.splitlines() if not line.endswith(" ...")]
    assert len(lines) == 1 and said in lines[0], captured.err
    assert captured.out == ""


@pytest.mark.parametrize("what", MODELS)
def test_model_files(tmp_path, capsys, what):
    text, said = MODELS[what]
    path = tmp_path / "bad.toml"
    path.mkdir() if text is None else path.write_text(text)
    refused(["simulate", str(path), "--slip", "0.1", "--load", "60"], capsys, said)


@pytest.mark.parametrize("what", SPECS)
@pytest.mark.filterwarnings("error")
def test_specs(tmp_path, capsys, small_data, what):
    text, said = SPECS[what]
    (tmp_path / "spec.toml").write_text(text)
    out = tmp_path / "o.onnx"
    refused(["train", str(tmp_path / "spec.toml"), str(small_data), str(out)], capsys, said)
    assert [p.name for p in tmp_path.iterdir()] == ["spec.toml"]


@pytest.mark.filterwarnings("error")
def test_readings_beyond_single_precision_are_out_of_range_and_refused_in_a_table(
    tmp_path, capsys, small_model
):
    assert not Estimator.load(small_model)(slip=0.1, load=60.0, torque=1e308).in_range
    (tmp_path / "runs.csv").write_text("run,slip,load_N,torque_Nm\na,0.1,60,1e308\n")
    command = ["estimate", str(small_model), str(tmp_path / "runs.csv")]
    refused(command, capsys, "line 2, column torque_Nm: 1e+308 given")
