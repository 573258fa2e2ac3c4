"""The KLS-1 wheel tests through simulate, identify and estimate: `make kls1 SOILML_DATA=...`."""

from __future__ import annotations

import os
import shlex
import sys
from pathlib import Path

from soilml.cli import main

HERE = Path(__file__).parent.relative_to(Path.cwd())


def run() -> None:
    """All commands of the page beside this file."""
    folder = os.environ.get("SOILML_DATA", "")
    runs = Path(folder) / "kls1_rashid1" / "single_wheel_tests.csv"
    if not folder or not runs.is_file():
        sys.exit("set SOILML_DATA to the folder that holds kls1_rashid1/single_wheel_tests.csv")
    Path("demo").mkdir(exist_ok=True)
    model, smooth = str(HERE / "model.toml"), ["--where", "run=kls1_smooth_w59"]
    fit = [*smooth, "--method", "nonlinear"]
    sinking, published = str(HERE / "model_slip_sinkage.toml"), "demo/kls1_published.json"
    released = "exported/kls1_wheel.onnx"
    for command in (
        ["simulate", model, "--slip", "0.1:0.5:5", "--load", "58.86"],
        ["identify", model, str(runs), *fit, "--out", "demo/kls1.json"],
        ["identify", model, str(runs), *fit, "--free", "shear_modulus,kphi", "--out", published],
        ["identify", sinking, str(runs), *fit, "--out", "demo/kls1_slip_sinkage.json"],
        ["estimate", released, str(runs), *smooth],
        ["estimate", released, str(runs), *smooth, "--by", "run"],
    ):
        shown = shlex.join(command).replace(folder, "$SOILML_DATA")
        print(f"\n$ soilml {shown}", flush=True)
        if main(command) != 0:
            sys.exit(1)


if __name__ == "__main__":
    run()
