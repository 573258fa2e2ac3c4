"""The chains of the source papers, each one command on a simulated log, with its picture.

python examples/papers/chains.py            all, into demo/papers
python examples/papers/chains.py track      one
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from soilml.cli import main

OUT = Path("demo/papers")
#: By name of the example: the command on its files, and what was put in.
CHAINS = {
    "sensor-wheel": (
        "model.toml runs.csv --readings readings.csv --picture {out}/sensor-wheel.png",
        "k_x 7.2 mm, M 1.43; slopes are those climbed",
    ),
    "climb": (
        "rover.toml runs.csv --stress stress.csv --report {out}/climb/report",
        "k_x 7.2 mm, steepest slope 13.2 degrees",
    ),
    "wheel-leg": (
        "strides.csv --by run --picture {out}/wheel-leg.png",
        "SSC-1: 42.3 degrees, 11.3 kPa, efficiency 49 %; ES-3: 35.8 degrees, 22 kPa, 54 %",
    ),
    "track": (
        "model.toml log.csv --mass 130 --spacing 0.6 --grousers 0.05,0.01,0.58,0.135 "
        "--picture {out}/track.png",
        "friction angle 25 degrees, shear modulus 45.1 mm",
    ),
}


def run() -> None:
    """Write the files of each example, run its command, and say what was put in."""
    for name in sys.argv[1:] or CHAINS:
        folder = OUT / name
        shutil.rmtree(folder, ignore_errors=True)
        print()
        if main(["example", name, str(folder), "--quiet"]) != 0:
            raise SystemExit(2)
        words, truth = CHAINS[name]
        print(f"\n{name}: put in were {truth}", flush=True)
        files = [
            str(folder / word) if "." in word and (folder / word).exists() else word
            for word in words.format(out=OUT).split()
        ]
        if main(["paper", name, *files, "--format", "table"]) != 0:
            raise SystemExit(2)


if __name__ == "__main__":
    run()
