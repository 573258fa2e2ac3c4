"""From the forward model to an estimate on board: what `make demo` runs, step by step."""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path

import numpy as np

from soilml import Estimator, read_table
from soilml.cli import main
from soilml.io.atomic_files import atomic_output, save_text
from soilml.io.table import Table
from soilml.io.text_tables import csv_text, format_table
from soilml.quantities import QUANTITIES, SHEAR, Z_90, column

HERE = Path(__file__).parent.relative_to(Path.cwd())
OUT = Path("demo")
MEASURED = ("run", "slip", "load_N", "torque_Nm", "drawbar_pull_N", "sinkage_m")
SHOWN = {
    "cohesion": (1e-3, "kPa"),
    "friction_angle": (57.29578, "deg"),
    "shear_modulus": (1e3, "mm"),
}


def command(*words: str) -> None:
    """Run a command of soilml as if typed, and show it."""
    bold, plain = ("\033[1m", "\033[0m") if sys.stdout.isatty() else ("", "")
    print(f"\n{bold}$ soilml {shlex.join(words)}{plain}", flush=True)
    if main(words) != 0:
        sys.exit(1)


def make_log() -> tuple[Table, dict[str, float]]:
    """A held-out drive: what was measured, and apart from it the truth."""
    command("generate", str(HERE / "log.toml"), str(OUT / "log.parquet"))
    log = read_table(OUT / "log.parquet")
    save_text(OUT / "log.csv", csv_text({name: log[name] for name in MEASURED}))
    return log, {name: float(log[column(name)][0]) for name in SHEAR}


def run() -> None:
    """All steps in order."""
    started = time.perf_counter()
    OUT.mkdir(exist_ok=True)
    model = str(HERE / "model.toml")
    data = str(OUT / "data.parquet")
    files = {spec: str(OUT / f"{spec}.onnx") for spec in ("fused", "lssvm", "mlp", "linear")}
    command(
        "simulate", model, "--slip", "0:0.6:13", "--load", "60", "--out", str(OUT / "curve.csv")
    )
    command("generate", "wheel", data)
    for spec, file in files.items():
        command("train", spec, data, file)
    log, truth = make_log()
    command("estimate", files["fused"], str(OUT / "log.csv"), "--out", str(OUT / "rows.csv"))
    command(
        "estimate",
        files["fused"],
        str(OUT / "log.csv"),
        "--by",
        "run",
        "--out",
        str(OUT / "run.csv"),
    )
    for method in ("nonlinear", "linear", "newton"):
        out = str(OUT / f"{method}.json")
        command("identify", model, str(OUT / "log.csv"), "--method", method, "--out", out)
    test = str(OUT / "test.parquet")
    command("generate", "wheel_test", test)
    command("compare", model, test, *files.values(), "--out", str(OUT), "--analytic-sets", "30")
    show(log, truth, Estimator.load(files["fused"]))
    print(f"\n{time.perf_counter() - started:.0f} s; pictures: {OUT}/log.png, {OUT}/compare.png")


def show(log: Table, truth: dict[str, float], estimator: Estimator) -> None:
    """The log's table and picture: truth, prior, one reading, all readings, analytic."""
    readings = {name: log[column(name)] for name in estimator.inputs}
    rows, joint = estimator(**readings), estimator.run(**readings)
    found = {
        m: json.loads((OUT / f"{m}.json").read_text())["parameters"]
        for m in ("nonlinear", "linear", "newton")
    }
    lines = []
    for k, name in enumerate(estimator.names):
        factor, unit = SHOWN[name]

        def cell(value: float, std: float, factor: float = factor) -> str:
            return f"{value * factor:.3g} +- {std * factor:.2g}"

        analytic = [
            cell(found[m][name]["value"], found[m][name]["std"]) if name in found[m] else "fixed"
            for m in found
        ]
        lines.append(
            (
                f"{name.replace('_', ' ')} {unit}",
                f"{truth[name] * factor:.3g}",
                cell(estimator.prior.mean[k], estimator.prior.std[k]),
                cell(rows.mean[0, k], rows.std[0, k]),
                cell(joint.mean[k], joint.std[k]),
                *analytic,
            )
        )
    header = (
        "",
        "truth",
        "prior",
        "first reading",
        f"all {len(log)} readings",
        "nonlinear",
        "linear",
        "newton",
    )
    print(
        f"\nThe drive of {len(log)} readings, never seen in training:\n\n"
        f"{format_table(header, lines)}"
    )
    draw(rows, joint, truth, found["nonlinear"], estimator)


def draw(rows, joint, truth, nonlinear, estimator) -> None:  # type: ignore[no-untyped-def]
    """Estimates along the drive with their 90 % intervals, beside the truth and the prior."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.8), layout="constrained")
    for k, (axis, name) in enumerate(zip(figure.subplots(1, 3), estimator.names, strict=True)):
        factor, unit = SHOWN[name]
        x = np.arange(1, len(rows.mean) + 1)
        axis.axhspan(
            estimator.prior.lower[k] * factor,
            estimator.prior.upper[k] * factor,
            color="0.93",
            label="prior",
        )
        axis.axhline(truth[name] * factor, color="k", lw=1, label="truth")
        spread = [(rows.mean - rows.low)[:, k] * factor, (rows.high - rows.mean)[:, k] * factor]
        axis.errorbar(
            x,
            rows.mean[:, k] * factor,
            spread,
            fmt="o",
            color="C0",
            ms=4,
            lw=1,
            label="one reading alone",
        )
        end = x[-1] + 2.5
        both = [[(joint.mean - joint.low)[k] * factor], [(joint.high - joint.mean)[k] * factor]]
        axis.errorbar(
            [end],
            [joint.mean[k] * factor],
            both,
            fmt="D",
            color="C3",
            ms=7,
            lw=2,
            label="all, trained model",
        )
        std = Z_90 * nonlinear[name]["std"] * factor
        axis.errorbar(
            [end + 2],
            [nonlinear[name]["value"] * factor],
            [[std], [std]],
            fmt="s",
            color="C2",
            ms=7,
            lw=2,
            label="all, least squares",
        )
        axis.set_title(f"{name.replace('_', ' ')} ({QUANTITIES[name].symbol}), {unit}")
        axis.set_xlabel("reading")
        axis.set_xticks([1, 6, 12, 18])
    figure.axes[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.suptitle(
        "What one reading of slip, torque and load tells of the soil, and what 18 tell (90 % bars)",
        fontsize=10,
    )
    with atomic_output(OUT / "log.png") as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})


if __name__ == "__main__":
    run()
