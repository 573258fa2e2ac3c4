"""Train the released models again: `make models`, or `python exported/make.py NAME ...`.

The same tree on the same machine and library versions gives the same bytes. With `--graphs`, only
the graphs of set posteriors are written anew, around the response of the wheel that each file has,
and their accuracy is measured again.
"""

from __future__ import annotations

import shlex
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from soilml.cli import main

HERE = Path(__file__).parent
KLS1 = str(HERE.parent / "examples" / "kls1" / "recipe.toml")

#: Recipe and spec of each released file that is trained from data.
RELEASED = {
    "wheel": ("wheel", "fused"),
    "wheel_small": ("wheel", "wheel_small"),
    "wheel_lssvm": ("wheel", "lssvm"),
    "wheel_mlp": ("wheel", "mlp"),
    "wheel_linear": ("wheel", "linear"),
    "kls1_wheel": (KLS1, "fused"),
    "slip_torque": ("wheel_leg", "slip_torque"),
    "slip_vibration": ("wheel_leg", "slip_vibration"),
    "slip_torque_known": ("wheel_leg_known", "slip_torque"),
    "slip_vibration_known": ("wheel_leg_known", "slip_vibration"),
    "slip_torque_paper": ("wheel_leg_paper", "slip_torque"),
    "slip_vibration_paper": ("wheel_leg_paper", "slip_vibration"),
}


#: Spec of each released file that is trained on simulated rows.
SIMULATED = {"any_wheel": "any_wheel", "any_wheel_small": "any_wheel_small"}


#: Released files with a set posterior.
WITH_SETS = ("wheel", "wheel_small", "kls1_wheel", "any_wheel", "any_wheel_small")


def write_graphs(names: Sequence[str]) -> None:
    """Write the set posteriors of all files, or of those named, around the response they have."""
    from stored_response import write_anew

    from soilml.cli.progress import stage_progress

    for name in names or WITH_SETS:
        print(f"{name}.onnx", flush=True)
        with stage_progress() as progress:
            write_anew(HERE / f"{name}.onnx", progress)


def run(names: Sequence[str]) -> None:
    """Generate each recipe's data once, and train every spec on it; all files, or those named."""
    if unknown := set(names) - {*RELEASED, *SIMULATED}:
        sys.exit(f"no file {', '.join(unknown)}; there are: {', '.join((*RELEASED, *SIMULATED))}")
    with tempfile.TemporaryDirectory() as folder:
        for name, (recipe, spec) in RELEASED.items():
            if names and name not in names:
                continue
            data = str(Path(folder) / f"{Path(recipe).stem}_{len(recipe)}.parquet")
            steps = [["train", spec, data, str(HERE / f"{name}.onnx")]]
            if not Path(data).exists():
                steps.insert(0, ["generate", recipe, data])
            for step in steps:
                _run_command(step)
    for name, spec in SIMULATED.items():
        if names and name not in names:
            continue
        _run_command(["train", spec, str(HERE / f"{name}.onnx")])


def _run_command(arguments: list[str]) -> None:
    """Print and run a command; exit where it fails."""
    print(f"\n$ soilml {shlex.join(arguments)}", flush=True)
    if main(arguments) != 0:
        sys.exit(1)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--graphs"]:
        write_graphs(sys.argv[2:])
    else:
        run(sys.argv[1:])
