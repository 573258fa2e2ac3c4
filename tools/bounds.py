"""Peak memory and time of commands at large tables, for docs/concepts/limits.md: `make bounds`."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from soilml import Model, Operating, Wheel, soil  # noqa: E402
from soilml.io.text_tables import csv_blocks  # noqa: E402

MODEL = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.3, 0.8]
shear_modulus = [0.005, 0.04]
[noise]
torque_Nm = "2 %"
drawbar_pull_N = "2 % + 0.2"
sinkage_m = "2 %"
"""
LSSVM, WHEEL = (f"{ROOT}/exported/{name}.onnx" for name in ("wheel_lssvm", "wheel"))
#: Title, words of the command, and rows of `runs.csv` with six in a run.
CASES = (
    ("simulate", "simulate m.toml --slip 0.05:0.6:1000 --load 30:120:1000 --out o.csv", 0),
    ("generate", "generate wheel o.parquet --rows 1000000 --workers 1", 0),
    ("estimate, rows", f"estimate {LSSVM} runs.csv --out o.csv", 10**6),
    ("estimate --by all", f"estimate {WHEEL} runs.csv --by all --out o.csv", 10**6),
    ("estimate --by run", f"estimate {WHEEL} runs.csv --by run --out o.csv", 10**5),
    ("identify", "identify m.toml runs.csv --out o.json", 10**5),
    ("identify, 5000", "identify m.toml runs.csv --out o.json", 5000),
    ("identify, many", "identify m.toml runs.csv --out o.json", 10**6),
    ("identify, linear", "identify m.toml runs.csv --method linear --out o.json", 10**5),
    ("posterior", "identify m.toml runs.csv --method posterior --out o.json", 10**5),
    ("posterior, 5000", "identify m.toml runs.csv --method posterior --out o.json", 5000),
    ("plan next", "plan next m.toml runs.csv --out o.csv", 10**6),
    ("pull", "pull m.toml runs.csv --out o.csv", 10**6),
    ("plan effects", "plan effects m.toml runs.csv --out o.json", 12000),
    ("gap", "gap m.toml runs.csv --out found", 1200),
    ("gap, refused", "gap m.toml runs.csv --out found", 12000),
)  # fmt: skip


def write_runs(path: Path, rows: int) -> None:
    """Rows of a wheel on dry sand with 2 % noise, six in a run, sinkage growing with slip."""
    rng = np.random.default_rng(0)
    slip, load = rng.uniform(0.05, 0.6, rows), rng.uniform(30.0, 120.0, rows)
    force = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=slip, load=load)
    )
    noise = 1.0 + 0.02 * rng.normal(size=(2, rows))
    columns = {
        "run": [f"run_{i // 6}" for i in range(rows)],
        "slip": slip,
        "load_N": load,
        "torque_Nm": force.torque * noise[0],
        "drawbar_pull_N": force.drawbar_pull + 0.5 * rng.normal(size=rows),
        "sinkage_m": force.sinkage * noise[1] * (1.0 + 0.5 * slip),
    }
    with path.open("w", encoding="utf-8") as opened:
        opened.writelines(csv_blocks(columns))


def main() -> None:
    """Print a line for each command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("titles", nargs="*", help="only these")
    titles = parser.parse_args().titles
    print("| command | rows | peak memory | processor time | exit status |\n|---|---|---|---|---|")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for title, words, rows in CASES:
        if titles and title not in titles:
            continue
        with TemporaryDirectory() as folder:
            (Path(folder) / "m.toml").write_text(MODEL)
            if rows:
                write_runs(Path(folder) / "runs.csv", rows)
            process = subprocess.Popen(
                [sys.executable, "-m", "soilml", *words.split()],
                cwd=folder,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            _, status, usage = os.wait4(process.pid, 0)
        memory, seconds = usage.ru_maxrss / 1e6, usage.ru_utime + usage.ru_stime
        code = os.waitstatus_to_exitcode(status)
        print(
            f"| {title} | {rows or 10**6} | {memory:.2f} GB | {seconds:.0f} s | {code} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
