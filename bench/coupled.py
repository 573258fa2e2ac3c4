"""LS-SVM with and without a shared part of its outputs: `python bench/coupled.py [CAMPAIGNS]`.

Each line is the mean over small campaigns of single readings, drawn from simulated rows; errors are
those on other rows. Strengths at three stresses are targets that go together; learned with errors,
each has an independent one of half its spread, as from tests in a laboratory.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml.io.text_tables import format_table
from training.dataset import read_dataset
from training.regressors.coupled_lssvm import CoupledLSSVM
from training.regressors.lssvm import LSSVM

Floats = NDArray[np.float64]

CAMPAIGNS, SEED, TEST = 10, 5, 3000
SIZES = (30, 60, 240)
STRESSES = (2e3, 1e4, 5e4)  # Pa, of the strengths c + sigma tan(phi)
#: Recipe, features and targets of each problem.
PROBLEMS = {
    "c, phi, K of a wheel": (
        "wheel", ("slip", "torque/load", "load"), ("cohesion", "friction_angle", "shear_modulus"),
    ),
    "strength at 2, 10, 50 kPa": (
        "wheel", ("slip", "torque/load", "load"), ("cohesion", "friction_angle"),
    ),
    "strength, learned with errors": (
        "wheel", ("slip", "torque/load", "load"), ("cohesion", "friction_angle"),
    ),
    "phi, stiffness of a wheel-leg": (
        "wheel_leg", ("slip", "torque/load", "load", "vibration", "sinkage"),
        ("friction_angle", "normal_stiffness"),
    ),
}  # fmt: skip


def rows_of(name: str, folder: Path) -> tuple[Floats, Floats]:
    """Features and targets of rows, each on a soil of its own."""
    recipe, features, targets = PROBLEMS[name]
    path = folder / f"{recipe}.parquet"
    if not path.exists():
        generate(read_recipe(recipe).sized(20000, SEED), path)
    data = read_dataset(path, features, targets)
    first = np.asarray([run[0] for run in data.runs()])
    x, y = data.features[first], data.targets[first]
    if name.startswith("strength"):
        y = y[:, :1] + np.asarray(STRESSES) * np.tan(y[:, 1:])
    return x, y


def score(model: LSSVM | CoupledLSSVM, x: Floats, y: Floats, spread: Floats) -> tuple[float, float]:
    """RMSE over the prior's standard deviation, and mean negative log density, over the outputs."""
    mean, std = model.predict(x, return_std=True)
    error, claimed = (mean - y) / spread, std / spread
    density = 0.5 * np.log(2.0 * np.pi * claimed**2) + 0.5 * (error / claimed) ** 2
    return float(np.sqrt(np.mean(error**2))), float(density.mean())


def run(campaigns: int) -> None:
    """Print the table."""
    lines = []
    with tempfile.TemporaryDirectory() as temporary:
        for name in PROBLEMS:
            x, y = rows_of(name, Path(temporary))
            rng, spread = np.random.default_rng(SEED), y.std(axis=0)
            for size in SIZES:
                found, shared = [], []
                for _ in range(campaigns):
                    order = rng.permutation(len(x))
                    own, other = order[:size], order[size : size + TEST]
                    z = y[own]
                    if name.endswith("errors"):
                        z = z + 0.5 * spread * rng.standard_normal(z.shape)
                    pair = [LSSVM().fit(x[own], z), CoupledLSSVM().fit(x[own], z)]
                    found.append([score(m, x[other], y[other], spread) for m in pair])
                    shared.append(float(pair[1].expansion_.solution.split()[2]))
                each = np.asarray(found)  # (campaigns, regressors, figures)
                change = each[:, 1, 0] - each[:, 0, 0]
                error = change.std(ddof=1) / np.sqrt(campaigns)
                mean = each.mean(axis=0)
                lines.append((
                    name, f"{size}", f"{mean[0, 0]:.3f}", f"{mean[1, 0]:.3f}",
                    f"{change.mean():+.3f} ± {error:.3f}", f"{mean[0, 1]:.2f}", f"{mean[1, 1]:.2f}",
                    f"{np.median(shared):g}",
                ))  # fmt: skip
    print(f"LS-SVM without and with a shared part of its outputs, {campaigns} campaigns a line:\n"
          "error over the prior's standard deviation, and -log p\n")  # fmt: skip
    head = ("targets", "rows", "own", "shared", "change", "-log p own", "shared", "coupling")
    print(format_table(head, lines))


if __name__ == "__main__":
    run(int(sys.argv[1]) if len(sys.argv) > 1 else CAMPAIGNS)
