"""What the runtime on board loads."""

import shutil
import subprocess
import sys


def test_the_runtime_loads_numpy_and_onnxruntime_only(small_model, tmp_path):
    shutil.copy(small_model, tmp_path / "m.onnx")
    code = (
        "import sys; from soilml.onboard.estimator import Estimator; e = Estimator.load('m.onnx');"
        "e(slip=0.3, torque=3.0, load=60.0); e.run(slip=[0.3, 0.2], torque=[3.0, 2.0], load=60.0);"
        "print(*sorted({m.split('.')[0] for m in sys.modules}));"
        "print(*sorted(m for m in sys.modules if m.startswith('soilml.')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    loaded, own = (set(line.split()) for line in done.stdout.splitlines())
    assert {"numpy", "onnxruntime"} <= loaded
    for ground in ("scipy", "sklearn", "torch", "pandas", "pyarrow", "matplotlib", "onnx", "rich"):
        assert ground not in loaded
    for ground in ("datagen", "training", "argparse_completions"):
        assert ground not in loaded
    assert own == {
        "soilml.errors",
        "soilml.onboard",
        "soilml.onboard.common_errors",
        "soilml.onboard.estimate",
        "soilml.onboard.features",
        "soilml.onboard.gaussian_pooling",
        "soilml.onboard.fusion",
        "soilml.onboard.fusion.held_out_errors",
        "soilml.onboard.metadata",
        "soilml.onboard.metadata.fields",
        "soilml.onboard.metadata.pooling_entry",
        "soilml.onboard.model_file",
        "soilml.onboard.estimator",
        "soilml.onboard.memory",
        "soilml.onboard.probe",
        "soilml.onboard.row_estimates",
        "soilml.onboard.session",
        "soilml.onboard.set_estimate",
        "soilml.quantities",
        "soilml.onboard.set_contract",
        "soilml.onboard.set_posterior",
    }
