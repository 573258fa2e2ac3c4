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
    for ground in ("datagen", "training"):
        assert ground not in loaded
    rooms = {".".join(name.split(".")[:2]) for name in own}
    assert rooms == {"soilml.errors", "soilml.onboard", "soilml.quantities", "soilml.results"}
    assert not {name for name in own if "track" in name or "slip" in name or "fusion" in name}
