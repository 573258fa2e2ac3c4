"""Shear parameters of loose lunar soil along a sweep of slip, learned by an LS-SVM.

The system of Xue et al. 2016: (slip, torque, load) to (cohesion, friction angle, shear modulus),
trained on the simplified wheel of their eqs. 2-8, and drawbar pull from the estimate. The bearing
of the soil is unknown. A set posterior answers for all readings of a soil.
"""

from __future__ import annotations

import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from lunar.bearing import show_bearing, write_known
from lunar.evaluation import show_evaluation
from lunar.exact import posterior
from lunar.figures import SHOWN, PosteriorPanel, Sweep, draw_posteriors, draw_sweep
from lunar.pull import mean_and_interval, pull_interval, repeat_over_slips
from lunar.sweep import Floats, add_torque_noise, bounds, soils, table, three_loads, wheel_forces

from soilml import Case, Estimator, identify, read_case
from soilml.cli import main
from soilml.quantities import SHEAR
from soilml.report.aligned_text import format_table

HERE = Path(__file__).parent.relative_to(Path.cwd()) / "lunar"
OUT = Path("demo/papers")
LOAD = 50.0
SLIPS = 81
#: Position of the soil of the figures within the prior of each parameter.
FRACTIONS = (1.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0)
SEED = 50


def command(*words: str) -> None:
    """Print and run a command of soilml."""
    print(f"\n$ soilml {shlex.join(words)}", flush=True)
    if main(words) != 0:
        sys.exit(1)


def run() -> None:
    """Train, simulate a sweep, evaluate, and draw."""
    started = time.perf_counter()
    OUT.mkdir(parents=True, exist_ok=True)
    data, model = str(OUT / "lunar.parquet"), str(OUT / "lunar.onnx")
    command("generate", str(HERE / "recipe.toml"), data)
    command("train", str(HERE / "spec.toml"), data, model)
    case, estimator = read_case(HERE / "model.toml"), Estimator.load(model)
    rng = np.random.default_rng(SEED)
    truth = np.asarray([case.prior[n].at(f) for n, f in zip(SHEAR, FRACTIONS, strict=True)])
    truth = np.append(truth, case.soil.kphi)
    show_sweep(case, estimator, truth, rng)
    show_evaluation(case, estimator, LOAD, SEED + 1)
    with TemporaryDirectory() as folder:
        recipe, spec = write_known(HERE / "recipe.toml", HERE / "spec.toml", Path(folder))
        data, model = (str(Path(folder) / name) for name in ("known.parquet", "known.onnx"))
        command("generate", recipe, data)
        command("train", spec, data, model)
        known = Estimator.load(model)
        show_bearing(case, estimator, known, LOAD, SEED + 2)
        of_known = replace(case, prior={name: case.prior[name] for name in SHEAR})
        show_information(of_known, known, truth[:3], np.random.default_rng(SEED))
    print(
        f"\n{time.perf_counter() - started:.0f} s; {OUT}/lunar_lssvm.png, lunar_single_triple.png"
    )


def show_sweep(case: Case, estimator: Estimator, truth: Floats, rng: np.random.Generator) -> None:
    """One soil of the prior, swept at one load: estimates and drawbar pull."""
    slip, load = np.linspace(0.2, 0.6, SLIPS), np.full(SLIPS, LOAD)
    force = wheel_forces(case, truth, slip, LOAD)
    torque = add_torque_noise(case, force.torque, rng)
    single = estimator(slip=slip, torque=torque, load=LOAD)
    joint = estimator.run(slip=slip, torque=torque, load=load)
    least = identify(case, table(slip, torque, load), method="nonlinear")
    exact = posterior(case, slip, torque, load, rng, 2000)
    header = (
        "",
        "truth",
        "prior",
        "one, LS-SVM",
        "all, set posterior",
        "all, least squares",
        "all, exact",
    )
    middle, lines = SLIPS // 2, []
    for k, name in enumerate(SHEAR):
        factor, unit = SHOWN[k]
        cells = (
            (estimator.prior.mean[k], estimator.prior.std[k]),
            (single.mean[middle, k], single.std[middle, k]),
            (joint.mean[k], joint.std[k]),
            (least.values[k], least.std[k]),
            (exact[:, k].mean(), exact[:, k].std()),
        )
        said = [f"{value * factor:.3g} +- {std * factor:.2g}" for value, std in cells]
        lines.append((f"{name.replace('_', ' ')} {unit}", f"{truth[k] * factor:.3g}", *said))
    print(f"\nA soil of the prior, slip swept from 0.2 to 0.6 at {LOAD:g} N in {SLIPS} readings;")
    print("one of them, at slip 0.4, and all:\n")
    print(format_table(header, lines))
    width = ", ".join(f"{100 * w:.0f} %" for w in joint.std / joint.prior_std)
    print("\nAll have one load: cohesion and friction angle are confounded. The set posterior")
    print(f"leaves {width} of the prior's widths, and")
    print(f"least squares reports: {'; '.join(map(str, least.warnings)) or 'no warning'}")
    found = {
        "prior": mean_and_interval(
            wheel_forces(case, soils(case, 1000, rng)[:, None, :], slip, LOAD).drawbar_pull
        ),
        "one": pull_interval(case, single.mean, single.covariance, slip, LOAD, rng),
        "all": pull_interval(
            case, *repeat_over_slips(joint.mean, joint.covariance, SLIPS), slip, LOAD, rng
        ),
        "least": pull_interval(
            case, *repeat_over_slips(least.values, least.covariance, SLIPS), slip, LOAD, rng
        ),
        "exact": mean_and_interval(
            wheel_forces(case, exact[:1000, None, :], slip, LOAD).drawbar_pull
        ),
    }
    lines = []
    for name, said in (
        ("prior", "prior"),
        ("one", "each reading alone, LS-SVM"),
        ("all", "all readings, set posterior"),
        ("least", "all readings, least squares"),
        ("exact", "all readings, exact posterior"),
    ):
        mean, low, high = found[name]
        error = np.sqrt(np.mean((mean - force.drawbar_pull) ** 2))
        lines.append((said, f"{error:.2f}", f"{np.mean(high - low):.2f}"))
    print("\nDrawbar pull along the sweep, predicted from the estimates:\n")
    print(format_table(("from", "RMS error N", "90 % interval N"), lines))
    sweep = Sweep(
        slip, single, joint, (least.values, least.std), exact, truth, bounds(case),
        force.drawbar_pull, found,
    )  # fmt: skip
    draw_sweep(sweep, OUT / "lunar_lssvm.png")


def show_information(
    case: Case, estimator: Estimator, truth: Floats, rng: np.random.Generator
) -> None:
    """Posterior from one reading, eight at one load and eighteen at three loads; bearing known."""
    drives = (
        ("one reading: a surface", np.asarray([0.4]), np.asarray([LOAD])),
        ("8 slips at one load: a ridge", np.linspace(0.2, 0.6, 8), np.full(8, LOAD)),
        ("6 slips at each of 3 loads: a spot", *three_loads()),
    )
    told, lines = [], []
    for title, slip, load in drives:
        torque = add_torque_noise(case, wheel_forces(case, truth, slip, load).torque, rng)
        draws = posterior(case, slip, torque, load, rng, 3000)
        found = estimator.run(slip=slip, torque=torque, load=load)
        told.append(PosteriorPanel(title, draws[:, :3], found.mean, found.covariance))
        left = np.concatenate([draws[:, :3].std(axis=0), found.std]) / np.tile(found.prior_std, 2)
        lines.append((title.split(":")[0], *(f"{100 * share:.0f} %" for share in left)))
    print(
        "\nOne reading is one equation for three unknowns; other slips determine K, loads the rest."
    )
    print("Remaining prior width if the bearing is known, by the exact posterior and the LS-SVM:\n")
    print(format_table(("", "c exact", "phi exact", "K exact", "c", "phi", "K"), lines))
    draw_posteriors(told, truth, bounds(case), OUT / "lunar_single_triple.png")


if __name__ == "__main__":
    run()
