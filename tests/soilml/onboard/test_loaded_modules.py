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
    for ground in ("scipy", "sklearn", "torch", "pandas", "pyarrow", "matplotlib", "onnx"):
        assert ground not in loaded
    for ground in ("datagen", "training", "argparse_completions"):
        assert ground not in loaded
    assert own == {
        "soilml.errors",
        "soilml.onboard",
        "soilml.onboard.estimate",
        "soilml.onboard.estimator",
        "soilml.onboard.exact_check",
        "soilml.onboard.features",
        "soilml.onboard.gaussian_product",
        "soilml.onboard.held_out_errors",
        "soilml.onboard.memory",
        "soilml.onboard.metadata",
        "soilml.onboard.model_file",
        "soilml.onboard.narrower_prior",
        "soilml.onboard.set_contract",
        "soilml.onboard.set_posterior",
        "soilml.onboard.state_checksum",
        "soilml.quantities",
        "soilml.results",
    }
