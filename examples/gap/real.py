"""Published single-wheel tests through the gap workflow: `make gap-real SOILML_DATA=...`."""

from __future__ import annotations

import csv
import json
import os
import runpy
import sys
from dataclasses import replace
from pathlib import Path

from soilml.cli import main
from soilml.config.case import read_case
from soilml.config.measurement_noise import Noise
from soilml.config.write_case import case_as_toml
from soilml.io.atomic_files import save_text

HERE = Path(__file__).parent
KLS1 = HERE.parent / "kls1" / "model.toml"
OUT = Path("demo/gap/real")


def run() -> None:
    """KLS-1: a smooth and a lugged wheel, singly and together. CMU: a smooth wheel, straight."""
    data = Path(os.environ.get("SOILML_DATA", ""))
    kls1 = data / "kls1_rashid1" / "single_wheel_tests.csv"
    cmu = data / "cmu_smooth_wheel" / "smooth_wheel_trials.csv"
    if not (kls1.is_file() and cmu.is_file()):
        sys.exit("set SOILML_DATA to the folder that contains kls1_rashid1 and cmu_smooth_wheel")
    OUT.mkdir(parents=True, exist_ok=True)
    smooth(kls1)
    lugged(kls1)
    together(kls1)
    straight(cmu, "driving", 0.0, 1.0)
    straight(cmu, "braking", -1.0, 0.0)
    straight(cmu, "all", -1.0, 1.0)
    with_plate_tests(cmu.parent)


def smooth(table: Path) -> None:
    """The smooth wheel alone, with the priors of its model file."""
    rows = _rows(table, lambda row: row["run"] == "kls1_smooth_w59")
    runs = OUT / "kls1_smooth.csv"
    _written(runs, rows)
    case = read_case(KLS1)
    case = replace(case, noise={**case.noise, "drawbar_pull_N": Noise(constant=0.5)})
    model = OUT / "kls1_prior.toml"
    save_text(model, case_as_toml(case, ["the model file of the wheel, with noise of the pull"]))
    _ran(["gap", str(model), str(runs), "--out", str(OUT / "kls1_smooth")])


def lugged(table: Path) -> None:
    """Identify the smooth wheel's soil, and look for what the lugs change."""
    smooth, found = OUT / "kls1_smooth.toml", OUT / "kls1_smooth.json"
    where = ["--where", "run=kls1_smooth_w59", "--out", str(found)]
    _ran(["identify", str(KLS1), str(table), *where])
    soil = json.loads(found.read_text())["parameters"]
    case = read_case(KLS1).with_values({name: entry["value"] for name, entry in soil.items()})
    case = replace(case, noise={**case.noise, "drawbar_pull_N": Noise(constant=0.5)})
    save_text(smooth, case_as_toml(case, ["soil identified from the smooth wheel"]))
    rows = _rows(table, lambda row: row["run"] == "kls1_lug10_w59")
    runs = OUT / "kls1_lugged.csv"
    _written(runs, rows)
    free = ["--free", "shear_modulus"]  # the soil is the smooth wheel's
    _ran(["gap", str(smooth), str(runs), *free, "--out", str(OUT / "kls1_lugged")])


def together(table: Path) -> None:
    """The smooth and the lugged wheel on one soil, distinguished by the column gear."""
    rows = _rows(table, lambda row: row["run"].startswith("kls1"))
    for row in rows:
        row["gear"] = "lugged" if float(row["grouser_height_m"]) > 0.0 else "smooth"
    runs = OUT / "kls1_together.csv"
    _written(runs, rows)
    model = str(KLS1.with_name("two_wheels.toml"))
    _ran(["gap", model, str(runs), "--out", str(OUT / "kls1_together")])


def straight(table: Path, name: str, lowest: float, highest: float) -> None:
    """The trials without slip angle between two slips, repeats of a slip in different runs."""
    rows = _rows(
        table,
        lambda row: float(row["slip_angle_rad"]) == 0.0 and lowest < float(row["slip"]) < highest,
    )
    seen: dict[str, int] = {}
    for row in rows:
        place = f"{float(row['slip']):.1f}"
        seen[place] = seen.get(place, 0) + 1
        row["run"] = f"repeat_{seen[place]}"
        row["torque_Nm"] = ""
        del row["side_force_N"], row["slip_angle_rad"], row["drawbar_pull_N_std"]
    runs = OUT / f"cmu_{name}.csv"
    _written(runs, rows)
    _ran(["gap", str(HERE / "cmu.toml"), str(runs), "--out", str(OUT / f"cmu_{name}")])


def with_plate_tests(folder: Path) -> None:
    """The trials again, with plate tests of the same sand as tests of the soil."""
    tests = runpy.run_path(str(HERE.parent / "bevameter" / "real.py"))
    tests["OUT"].mkdir(parents=True, exist_ok=True)
    tests["cmu"](folder)
    for name in ("driving", "braking"):
        runs, out = OUT / f"cmu_{name}.csv", OUT / f"cmu_{name}_plates"
        _ran(["gap", "demo/bevameter/cmu.toml", str(runs), "--out", str(out)])


def _ran(command: list[str]) -> None:
    print(f"\n$ soilml {' '.join(command)}", flush=True)
    if main(command) != 0:
        raise SystemExit(1)


def _rows(table: Path, wanted) -> list[dict[str, str]]:  # type: ignore[no-untyped-def]
    with table.open() as lines:
        return [dict(row) for row in csv.DictReader(lines) if wanted(row)]


def _written(path: Path, rows: list[dict[str, str]]) -> None:
    lines = [",".join(rows[0]), *[",".join(row.values()) for row in rows]]
    save_text(path, "\n".join(lines) + "\n")


if __name__ == "__main__":
    run()
