"""What other learning tools make of the same rows and sets, in one run.

Single readings: the regressors of the project, of scikit-learn, and a mean-and-variance network of
torch, on the same rows. Sets: the released file beside a deep set of torch, which learns the
posterior from sets of the generator, with and without errors of sensors.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from runner import ROOT, Bench, Row, Sample, each, percent, rms, table
from wrong_worlds import World, simulate

from datagen.generate import generate
from datagen.recipe import read_recipe
from soilml import Estimator, Model, Operating
from soilml.quantities import SHEAR, Z_90
from training.dataset import Dataset, read_dataset
from training.regressors.gaussian_regressor import Standardisation
from training.spec import read_spec
from training.train import train

Floats = np.ndarray[Any, np.dtype[np.float64]]
Answer = tuple[Floats, Floats]

#: Rows learned from, of recipe `wheel`; seed of the test; rows of a quick look. Gaussian processes
#: learn from fewer rows: their time grows with the cube.
ROWS, TEST_SEED, QUICK_ROWS, GP_ROWS = 12_000, 99, 1500, 1500
FEATURES = ("slip", "torque/load", "load")
#: Sets of 16 readings: of the deep set's training, and of the test.
SET_ROWS, LEARNED_SETS, TEST_SETS, QUICK_SETS = 16, 50_000, 400, 2000
STEPS, BATCH = 4000, 256


def _sklearn(make: Callable[[], Any], rows: int = ROWS) -> Callable[..., Answer]:
    """A regressor for each output, with its own standard deviation or that of left-out rows."""

    def answer(x: Floats, z: Floats, test: Floats) -> Answer:
        from sklearn.base import clone
        from sklearn.model_selection import cross_val_predict

        x, z, found = x[:rows], z[:rows], []
        for one in z.T:
            model = make()
            if "GaussianProcess" in type(model).__name__:
                found.append(model.fit(x, one).predict(test, return_std=True))
                continue
            left = one - cross_val_predict(clone(model), x, one, cv=4)
            mean = model.fit(x, one).predict(test)
            found.append((mean, np.full(len(test), rms(left))))
        mean, std = (np.stack(part, axis=1) for part in zip(*found, strict=True))
        return mean, std

    return answer


def _torch_network(x: Floats, z: Floats, test: Floats) -> Answer:
    """Mean and log-variance by two tanh layers of 64 units and AdamW."""
    import torch

    torch.manual_seed(0)
    torch.set_num_threads(1)
    nn, q = torch.nn, z.shape[1]
    layers = [nn.Linear(x.shape[1], 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh()]
    network = nn.Sequential(*layers, nn.Linear(64, 2 * q))
    inputs, outputs = (torch.tensor(part, dtype=torch.float32) for part in (x, z))

    def loss(rows: Any) -> Any:
        return _loss(network(inputs[rows]), outputs[rows])

    _minimise(network, loss, len(x), 40 * -(-len(x) // BATCH), 4e-3)
    with torch.no_grad():
        return _gaussian(network(torch.tensor(test, dtype=torch.float32)))


def _loss(both: Any, truth: Any) -> Any:
    mean, log_variance = both.chunk(2, dim=-1)
    return 0.5 * (log_variance + (truth - mean) ** 2 * (-log_variance).exp()).mean()


def _gaussian(both: Any) -> Answer:
    mean, log_variance = (part.double().numpy() for part in both.chunk(2, dim=-1))
    return mean, np.exp(0.5 * log_variance)


def _minimise(
    network: Any, loss: Callable[[Any], Any], count: int, steps: int, rate: float
) -> None:
    """AdamW with a cosine schedule."""
    import torch

    optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=1e-4)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    order = torch.empty(0, dtype=torch.long)
    for _ in range(steps):
        if len(order) < BATCH:
            order = torch.cat([order, torch.randperm(count)])
        rows, order = order[:BATCH], order[BATCH:]
        optimiser.zero_grad()
        loss(rows).backward()
        optimiser.step()
        schedule.step()


def methods() -> dict[str, Callable[..., Answer]]:
    """Peers by name, on standardised rows."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel
    from sklearn.kernel_ridge import KernelRidge
    from sklearn.neural_network import MLPRegressor
    from sklearn.svm import SVR

    def process() -> Any:
        return GaussianProcessRegressor(RBF([2.0] * len(FEATURES)) + WhiteKernel(0.5))

    return {
        f"scikit-learn GaussianProcessRegressor, {GP_ROWS} rows": _sklearn(process, GP_ROWS),
        "scikit-learn SVR": _sklearn(lambda: SVR(C=1.0, gamma=0.3, epsilon=0.3)),
        "scikit-learn KernelRidge, 4000 rows": _sklearn(
            lambda: KernelRidge(kernel="rbf", alpha=1.0, gamma=0.1), 4000
        ),
        "scikit-learn MLPRegressor": _sklearn(
            lambda: MLPRegressor(hidden_layer_sizes=(64, 64), early_stopping=True, random_state=0)
        ),
        "torch mean and variance": _torch_network,
    }


OWN = ("fused", "mlp", "lssvm", "linear")


def row_cases(sample: Sample) -> list[Row]:
    """Specs of the project, and peers."""
    names = [*(f"soilml {name}" for name in OWN), *methods()]
    return [{"method": name, "rows": QUICK_ROWS if sample.quick else ROWS} for name in names]


def _data(folder: str, rows: int) -> tuple[Dataset, Dataset]:
    found = []
    for name, count, seed in (("train", rows, None), ("test", 4 * rows, TEST_SEED)):
        file = Path(folder) / f"{name}.parquet"
        generate(read_recipe("wheel").sized(count, seed), file)
        found.append(read_dataset(file, FEATURES, SHEAR))
    return found[0], found[1]


def of_rows(case: Row) -> Row:
    """Errors, log density and coverage of single readings, and processor time."""
    with tempfile.TemporaryDirectory() as folder:
        data, test = _data(folder, case["rows"])
    began, name = time.process_time(), case["method"]
    if name.startswith("soilml "):
        spec = replace(read_spec(name.removeprefix("soilml ")), set_posterior=None)
        mean, std, _ = train(spec, data).predict(test.features)
    else:
        x, y = Standardisation.of(data.features), Standardisation.of(data.targets)
        order = np.random.default_rng(0).permutation(len(data))
        rows = x.apply(data.features)[order], y.apply(data.targets)[order]
        mean, std = methods()[name](*rows, x.apply(test.features))
        mean, std = np.clip(y.undo(mean), data.lower, data.upper), std * y.scale
    spent = time.process_time() - began
    return {"processor": spent} | scores(test.targets, mean, std, data.targets.std(axis=0))


def scores(truth: Floats, mean: Floats, std: Floats, prior: Floats) -> Row:
    """Of estimates (n, q): error and log density over the prior's deviation, and coverage."""
    z = (truth - mean) / std
    density = 0.5 * z**2 + np.log(std / prior * np.sqrt(2.0 * np.pi))
    return {
        "error": rms((truth - mean) / prior, axis=0),
        "density": density.mean(axis=0),
        "covered": np.mean(np.abs(z) <= Z_90, axis=0),
    }


COLUMNS = {
    "RMSE of c, phi, K": each("error", ".3f"),
    "-log p": each("density", ".3f"),
    "90 %": percent("covered", 1),
    "processor time, s": each("processor", ".0f"),
}


def set_cases(sample: Sample) -> list[Row]:
    """Deep sets that learn without and with errors of sensors, and the answers of the file."""
    sets = QUICK_SETS if sample.quick else LEARNED_SETS
    own = [{"method": f"wheel.onnx, {mode}"} for mode in FED]
    return own + [{"method": f"deep set, {name} sensors", "sets": sets} for name in ERRORS]


FED: dict[str, dict[str, float]] = {"own answer": {}, "model without error": {"model_error": 0.0}}
ERRORS = {"exact": 0.0, "usual": 1.0}
USUAL = {"slip": 0.015, "load": 0.01, "torque": 0.03}


def _learned(sets: int, size: float) -> tuple[Floats, Floats]:
    """Sets (n, rows, 3) of slip, log torque over load and load, and soils (n, 3)."""
    recipe, rng = read_recipe("wheel"), np.random.default_rng(7)
    truth = np.stack([recipe.case.prior[name].at(rng.random(sets)) for name in SHEAR], axis=1)
    slip = recipe.slip.at(rng.random((sets, SET_ROWS)))
    load = rng.choice((40.0, 70.0, 100.0), (sets, SET_ROWS))
    error = {k: size * std * rng.standard_normal((sets, 1)) for k, std in USUAL.items()}
    at = Operating(
        slip=np.maximum(slip - error["slip"], 0.003).ravel(),
        load=(load / (1 + error["load"])).ravel(),
    )
    soils = dict(zip(SHEAR, np.repeat(truth, SET_ROWS, axis=0).T, strict=True))
    model: Model = recipe.case.model
    force = model(replace(recipe.case.soil, **soils), at)
    torque = np.asarray(force.torque).reshape(slip.shape) * (1.0 + error["torque"])
    torque = torque * (1.0 + 0.02 * rng.standard_normal(slip.shape))
    good = np.isfinite(torque).all(axis=1)
    return _inputs(slip[good], torque[good], load[good]), truth[good]


def _inputs(slip: Floats, torque: Floats, load: Floats) -> Floats:
    return np.stack([np.log(slip), np.log(np.maximum(torque, 1e-3) / load), load / 70.0], axis=-1)


def _deep_set(x: Floats, y: Floats, test: Floats) -> Answer:
    """Zaheer et al., NeurIPS 30, 2017: a network of the mean of a network of each row."""
    import torch

    torch.manual_seed(0)
    torch.set_num_threads(1)
    nn, inputs = torch.nn, Standardisation.of(x.reshape(-1, x.shape[-1]))
    first = nn.Sequential(nn.Linear(3, 96), nn.GELU(), nn.Linear(96, 96), nn.GELU())
    second = nn.Sequential(nn.Linear(96, 96), nn.GELU(), nn.Linear(96, 6))
    outputs = Standardisation.of(y)
    rows, truth = (
        torch.tensor(part, dtype=torch.float32) for part in (inputs.apply(x), outputs.apply(y))
    )

    def answer(sets: Any) -> Any:
        return second(first(sets).mean(dim=1))

    both = nn.ModuleList([first, second])
    _minimise(both, lambda k: _loss(answer(rows[k]), truth[k]), len(x), STEPS, 2e-3)
    with torch.no_grad():
        mean, std = _gaussian(answer(torch.tensor(inputs.apply(test), dtype=torch.float32)))
    return outputs.undo(mean), std * outputs.scale


def of_sets(case: Row) -> list[Row]:
    """Scores on sets of a sound world, with exact sensors and with usual errors of sensors."""
    found, name, began = [], case["method"], time.process_time()
    learned = _learned(case["sets"], ERRORS[name.split()[2]]) if "sets" in case else None
    prior = read_recipe("wheel").case.prior
    std = np.asarray([prior[key].std for key in SHEAR])
    for world, size in ERRORS.items():
        drives = simulate(World("nothing"), TEST_SETS, SET_ROWS, 3)
        rng, r = np.random.default_rng(5), drives.readings
        off = {k: size * s * rng.standard_normal((TEST_SETS, 1)) for k, s in USUAL.items()}
        read = {
            "slip": np.maximum(r["slip"] + off["slip"], 0.003),
            "load": r["load"] * (1.0 + off["load"]),
            "torque": r["torque"] * (1.0 + off["torque"]),
        }
        if learned is not None:
            test = _inputs(read["slip"], read["torque"], read["load"])
            mean, own = _deep_set(*learned, test)
            covered = np.mean(np.abs(drives.truth - mean) <= Z_90 * own, axis=0)
        else:
            file = Estimator.load(ROOT / "exported" / "wheel.onnx")
            told: dict[str, Any] = dict(FED[name.removeprefix("wheel.onnx, ")])
            file = file.on(**told)
            answers = [file.run(**{k: v[i] for k, v in read.items()}) for i in range(TEST_SETS)]
            mean, own = (np.stack([getattr(a, k) for a in answers]) for k in ("mean", "std"))
            ends = [
                (a.low <= t) & (t <= a.high) for a, t in zip(answers, drives.truth, strict=True)
            ]
            covered = np.mean(ends, axis=0)
        of_world = scores(drives.truth, mean, own, std) | {"covered": covered}
        found.append({"sensors": world, "processor": time.process_time() - began} | of_world)
    return found


PEERS = Bench(
    "peers",
    "Single readings: the project's regressors beside other learning tools",
    f"Recipe `wheel`, {ROWS} rows to learn from, {4 * ROWS} of another seed to test. RMSE and "
    "-log p are over the prior's standard deviation. Peers without a standard deviation have that "
    "of rows left out by four fits.",
    row_cases,
    of_rows,
    lambda rows: table(rows, {"method": "method"}, COLUMNS),
    timed=True,
    long=True,
)
SET_PEERS = Bench(
    "set-peers",
    "Sets of 16 readings of torque: the released file beside a deep set",
    f"{TEST_SETS} sets of a sound wheel, with exact sensors and with usual errors of sensors. A "
    f"deep set learns from {LEARNED_SETS} sets of the generator.",
    set_cases,
    of_sets,
    lambda rows: table(rows, {"method": "method", "sensors": "sensors"}, COLUMNS),
    timed=True,
    long=True,
)
