"""Published plate and shear tests through `soilml bevameter`.

Run it as `SOILML_DATA=/path/to/data .venv/bin/python examples/bevameter/real.py`. The columns of
the published tables are renamed and brought to SI units first.
"""

from __future__ import annotations

import csv
import os
import sys
from collections.abc import Callable
from pathlib import Path

from soilml.cli import main
from soilml.io.atomic_files import save_text

OUT = Path("demo/bevameter")
#: Area of the round plate of the Cullinan tests (m^2), and their one normal stress (Pa).
CULLINAN_PLATE, CULLINAN_STRESS = 0.018, 93e3

Row = dict[str, str]
Columns = dict[str, Callable[[Row], str]]


def run() -> None:
    """A simulated bevameter, a measured sand at five densities, and a sand under three plates."""
    data = Path(os.environ.get("SOILML_DATA", ""))
    if not (data / "crm_bevameter").is_dir():
        sys.exit("set SOILML_DATA to the folder that contains crm_bevameter")
    OUT.mkdir(parents=True, exist_ok=True)
    simulated(data / "crm_bevameter")
    cullinan(data / "cullinan_sand")
    cmu(data / "cmu_smooth_wheel")


def simulated(folder: Path) -> None:
    """Two plates and a ring under eight loads, in a continuum simulation."""
    plates: Columns = {
        "test": lambda row: row["run"],
        "plate_radius_m": lambda row: row["plate_radius_m"],
        "sinkage_m": lambda row: row["sinkage_m"],
        "load_N": lambda row: row["force_N"],
    }
    ring: Columns = {
        "test": lambda row: row["run"],
        "inner_radius_m": lambda row: "0.15",
        "outer_radius_m": lambda row: "0.20",
        "angle_rad": lambda row: (
            str(float(row["shear_displacement_m"]) / 0.175) if row["shear_displacement_m"] else ""
        ),
        "torque_Nm": lambda row: row["torque_Nm"],
        "load_N": lambda row: row["load_N"],
    }
    _bevameter(
        "crm",
        _converted(folder / "plate_sinkage.csv", "crm_plates", plates),
        _converted(folder / "annulus_shear.csv", "crm_ring", ring),
    )


def cullinan(folder: Path) -> None:
    """One plate in beds of five densities, and shear tests at one normal stress."""
    plates: Columns = {
        "test": lambda row: row["run"],
        "plate_area_m2": lambda row: str(CULLINAN_PLATE),
        "sinkage_m": lambda row: str(1e-3 * float(row["sinkage"])),
        "pressure_Pa": lambda row: str(1e3 * float(row["pressure"])),
    }
    shear: Columns = {
        "test": lambda row: row["run"],
        "normal_stress_Pa": lambda row: str(CULLINAN_STRESS),
        "shear_displacement_m": lambda row: str(1e-3 * float(row["Displacement"])),
        "shear_stress_Pa": lambda row: str(1e3 * float(row["shear_stress"])),
    }
    curves = _converted(folder / "shear.csv", "cullinan_shear", shear)
    for method in "12345":
        names = (f"method_{method}_", f"method_Method {method}_")
        own = _converted(
            folder / "plate_sinkage.csv",
            f"cullinan_{method}_plates",
            plates,
            lambda row, names=names: row["run"].startswith(names),  # type: ignore[misc]
        )
        _bevameter(f"cullinan_{method}", own)
    _bevameter("cullinan_shear", curves)


def cmu(folder: Path) -> None:
    """Three plates in the sand of the wheel trials, in two boxes."""
    plates: Columns = {
        "test": lambda row: f"{row['box']} {row['test']}",
        "plate_radius_m": lambda row: str(0.5e-3 * float(row["plate_diameter_mm"])),
        "sinkage_m": lambda row: row["sinkage_m"],
        "load_N": lambda row: row["force_N"],
    }
    table = _converted(
        folder / "plate_tests.csv", "cmu_plates", plates, lambda row: row["body"] == "plate"
    )
    model = str(Path(__file__).parents[1] / "gap" / "cmu.toml")
    _bevameter("cmu", table, "--model", model)


def _bevameter(name: str, *words: str) -> None:
    command = ["bevameter", *words]
    command += ["--out", str(OUT / f"{name}.toml"), "--picture", str(OUT / f"{name}.png")]
    print(f"\n$ soilml {' '.join(command)}", flush=True)
    if main(command) != 0:
        raise SystemExit(1)


def _converted(
    table: Path, name: str, columns: Columns, wanted: Callable[[Row], bool] = lambda row: True
) -> str:
    """A table with these columns, from the rows that are wanted; returns its path."""
    with table.open() as lines:
        rows = [row for row in csv.DictReader(lines) if wanted(row)]
    text = [",".join(columns)]
    text += [",".join(value(row) for value in columns.values()) for row in rows]
    path = OUT / f"{name}.csv"
    save_text(path, "\n".join(text) + "\n")
    return str(path)


if __name__ == "__main__":
    run()
