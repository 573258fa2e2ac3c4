"""From the forward model to a board that knows what its model lacked: what `make demo` runs."""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path

import numpy as np
from hidden_world import LaterSoils, later_soils, write_campaign
from story_picture import draw_story

from soilml import Estimator, adapt, read_case, read_table
from soilml.cli import main
from soilml.io.atomic_files import save_text
from soilml.io.table import Table
from soilml.io.text_tables import csv_text
from soilml.quantities import SHEAR, column
from soilml.report.aligned_text import format_table
from training.adaptation import AdaptReport

HERE = Path(__file__).parent.relative_to(Path.cwd())
OUT = Path("demo")
MODEL = str(HERE / "model.toml")
FILES = {spec: str(OUT / f"{spec}.onnx") for spec in ("fused", "lssvm", "mlp", "linear")}
MEASURED = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
CAMPAIGN, ADAPTED, ROWS = str(OUT / "campaign.csv"), str(OUT / "adapted"), 20_000
SHOWN = {
    "cohesion": (1e-3, "kPa"),
    "friction_angle": (57.29578, "deg"),
    "shear_modulus": (1e3, "mm"),
}


def title(text: str) -> None:
    """A heading on the terminal."""
    bold, plain = ("\033[1m", "\033[0m") if sys.stdout.isatty() else ("", "")
    print(f"\n\n{bold}{text}{plain}\n{'=' * len(text)}", flush=True)


def command(*words: str) -> None:
    """Run a command of soilml as if typed, and show it."""
    bold, plain = ("\033[1m", "\033[0m") if sys.stdout.isatty() else ("", "")
    print(f"\n{bold}$ soilml {shlex.join(words)}{plain}", flush=True)
    if main(words) != 0:
        sys.exit(1)


def train() -> None:
    """Forward model, synthetic data, and four model files that are trained on them."""
    title("1  Forward model, synthetic data, training, export")
    curve = str(OUT / "curve.csv")
    command("simulate", MODEL, "--slip", "0:0.6:13", "--load", "60", "--out", curve)
    data = str(OUT / "data.parquet")
    command("generate", "wheel", data)
    for spec, file in FILES.items():
        command("train", spec, data, file)


def compare() -> None:
    """Every method on soils that training has not seen, and on one drive."""
    title("2  On board, beside analytic identification")
    command("generate", str(HERE / "log.toml"), str(OUT / "log.parquet"))
    log = read_table(OUT / "log.parquet")
    drive = str(OUT / "log.csv")
    save_text(Path(drive), csv_text({name: log[name] for name in MEASURED}))
    command("estimate", FILES["fused"], drive, "--out", str(OUT / "rows.csv"))
    command("estimate", FILES["fused"], drive, "--by", "run", "--out", str(OUT / "run.csv"))
    for method in ("nonlinear", "linear", "newton"):
        out = str(OUT / f"{method}.json")
        command("identify", MODEL, drive, "--method", method, "--out", out)
    test = str(OUT / "test.parquet")
    command("generate", "wheel_test", test)
    command("compare", MODEL, test, *FILES.values(), "--out", str(OUT))
    print(f"\nThe drive of {len(log)} readings:\n\n{drive_table(log)}")


def drive_table(log: Table) -> str:
    """Truth, prior, one reading, all readings, and analytic identification of the drive."""
    estimator = Estimator.load(FILES["fused"])
    readings = {name: log[column(name)] for name in estimator.inputs}
    rows, joint = estimator(**readings), estimator.run(**readings)
    methods = ("nonlinear", "linear", "newton")
    found = [json.loads((OUT / f"{m}.json").read_text())["parameters"] for m in methods]
    lines = []
    for k, name in enumerate(estimator.names):
        factor, unit = SHOWN[name]
        pairs = [(e.mean[..., k].flat[0], e.std[..., k].flat[0]) for e in (rows, joint)]
        pairs.insert(0, (estimator.prior.mean[k], estimator.prior.std[k]))
        pairs += [
            (one[name]["value"], one[name]["std"]) if name in one else (np.nan, 0.0)
            for one in found
        ]
        cells = [f"{factor * v:.3g} +- {factor * s:.2g}" if v == v else "fixed" for v, s in pairs]
        true = f"{factor * log[column(name)][0]:.3g}"
        lines.append((f"{name.replace('_', ' ')} {unit}", true, *cells))
    header = ("", "truth", "prior", "first reading", f"all {len(log)} readings", *methods)
    return format_table(header, lines)


def slip() -> None:
    """Slip of a wheel-leg from torque and from vibration, fused by their variances."""
    title("3  Slip of a wheel-leg: two linear models, fused by their variances")
    data, test = str(OUT / "leg.parquet"), str(OUT / "leg_test.parquet")
    command("generate", "wheel_leg", data, "--rows", "12000")
    command("generate", "wheel_leg", test, "--rows", "1000", "--seed", "9")
    files = [str(OUT / f"{spec}.onnx") for spec in ("slip_torque", "slip_vibration")]
    for file in files:
        command("train", Path(file).stem, data, file)
    command("estimate", files[0], test, "--with", files[1], "--out", str(OUT / "slip.csv"))
    for file in files:
        command("estimate", file, test, "--out", str(Path(file).with_suffix(".csv")))
    rows = read_table(test)
    lines = []
    for name in ("slip_torque", "slip_vibration", "slip"):
        own = np.genfromtxt(OUT / f"{name}.csv", delimiter=",", names=True)
        off = own["slip"] - rows["slip"]
        inside = (own["slip_p05"] <= rows["slip"]) & (rows["slip"] <= own["slip_p95"])
        label = "fused" if name == "slip" else name.replace("_", " from ")
        known = np.isfinite(off)
        error = float(np.sqrt(np.mean(off[known] ** 2)))
        lines.append((label, f"{error:.3f}", f"{100 * np.mean(inside[known]):.0f} %"))
    print()
    print(format_table(("", "RMSE of slip", "in the 90 % interval"), lines))


def adapt_board(later: LaterSoils) -> AdaptReport:
    """A campaign on a wheel with an effect that the model lacks: the gap, and a better board."""
    title("4  A campaign disagrees: the missing effect, the gap, and a better board")
    old = FILES["fused"]
    command("identify", MODEL, CAMPAIGN, "--out", str(OUT / "campaign.json"))
    report = adapt(read_case(MODEL), read_table(CAMPAIGN), ADAPTED, against=old, rows=ROWS)
    print(report)
    lines = []
    files = {"before": Estimator.load(old), "adapted": Estimator.load(f"{ADAPTED}/adapted.onnx")}
    right = {"before, model taken as right": files["before"].on(model_error=0.0)}
    for label, estimator in (right | files).items():
        error, held = later.figures(estimator)
        cells = (f"{x * SHOWN[n][0]:.2g} {SHOWN[n][1]}" for n, x in zip(SHEAR, error, strict=True))
        lines.append((label, *cells, " / ".join(f"{100 * x:.0f} %" for x in held)))
    header = ("RMSE", "cohesion", "friction angle", "shear modulus", "in the 90 % intervals")
    print(f"\nThe board on {len(later.truth)} further soils, with the same hidden effect:\n")
    print(format_table(header, lines))
    return report


def run() -> None:
    """All steps in order."""
    started = time.perf_counter()
    OUT.mkdir(exist_ok=True)
    case = read_case(MODEL)
    write_campaign(case, Path(CAMPAIGN))
    later = later_soils(case)
    train()
    compare()
    slip()
    draw_story(OUT, adapt_board(later), later)
    print(f"\n{time.perf_counter() - started:.0f} s; the story in one picture: {OUT}/story.png")


if __name__ == "__main__":
    run()
