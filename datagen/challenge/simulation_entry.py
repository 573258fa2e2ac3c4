"""An entry by simulation-based inference, with the library `sbi` (extra `sbi`) on torch."""

from __future__ import annotations

import contextlib
import logging
import os
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from datagen.challenge.challenge_files import COLUMNS, NONE, UNKNOWN
from datagen.challenge.house_entries import DRAWS, Answer, SetData
from soilml.arrays import Floats, Integers
from soilml.errors import InputError
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import Coordinate, select_free, size_coordinate
from soilml.fitting.covariance import discrepancy_process
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.predictions import PredictionRequest, predict_many
from soilml.optional_imports import need
from soilml.physics.effects import EFFECTS

#: Simulated campaigns of each cause, and of `none` and `unknown`, for which there is more to learn.
OF_CAUSE, OF_OTHERS = 80, 400
#: Size of an effect, in reference sizes, uniform in its logarithm; amplitude of the smooth error,
#: in usual ones: 2 % of a channel's range.
SIZE, ERROR, ERROR_ALONE = (0.3, 3.0), (0.0, 2.0), (0.3, 2.0)
#: Principal components of the readings of the runs, and of those kept back.
SEEN, PREDICTED = 24, 8
#: Most epochs of training, of each network.
RATIO_EPOCHS, FLOW_EPOCHS = 150, 150


@dataclass(frozen=True)
class Simulations:
    """Simulated campaigns: number of the cause (s,), readings of the runs, rows kept back.

    `seen` (s, m) has noise; `held` (s, m_h) has none.
    """

    cause: Integers
    names: tuple[str, ...]
    seen: Floats
    held: Floats


def simulation_entry(data: SetData, seed: int) -> Answer:
    """Neural ratio estimation of the cause, and neural posterior estimation of rows kept back.

    Soil, cause, its size and a smooth error of the model are drawn from their priors, and the
    model of this package simulates the rows of the set. A classifier learns the ratio p(cause,
    readings) / p(cause) p(readings); a normalizing flow learns the density of rows kept back given
    the readings. Both see principal components.

    References: Hermans, Begy and Louppe, ICML 2020 (ratio estimation); Greenberg, Nonnenmacher and
    Macke, ICML 2019 (posterior estimation); Boelts et al., sbi reloaded, JOSS 10, 2025.

    Raises `MissingLibraryError` without `sbi`.
    """
    need("sbi", "challenge enter --method sbi", "sbi")
    import torch

    rng = np.random.default_rng(seed)
    done = simulated(data, rng)
    measured = np.concatenate([data.runs[name] for name in COLUMNS])
    seen, held = Components.of(done.seen, SEEN), Components.of(done.held, PREDICTED)
    x, theta = seen.coordinates(done.seen), held.coordinates(done.held)
    # a network has learned nothing beyond the simulations: what lies there is moved to their edge
    observed = np.clip(seen.coordinates(measured), x.min(axis=0), x.max(axis=0))
    with _quiet(), torch.random.fork_rng():
        torch.manual_seed(seed)
        log_ratio = _log_ratios(np.eye(len(done.names))[done.cause], x, observed)
        expected = held.values(_posterior_draws(theta, x, observed))
    counts = np.bincount(done.cause, minlength=len(done.names))  # in proportion to the prior
    weights = counts * np.exp(log_ratio - log_ratio.max())
    parts = np.split(expected, len(COLUMNS), axis=1)
    std = [data.case.noise[c].std(p) for c, p in zip(COLUMNS, parts, strict=True)]
    noisy = expected + np.concatenate(std, axis=1) * rng.standard_normal(expected.shape)
    return Answer(dict(zip(done.names, weights, strict=True)), data.by_row(noisy))


def simulated(data: SetData, rng: np.random.Generator) -> Simulations:
    """Campaigns with the operating points of a set; those without equilibrium are left out."""
    case = data.case
    readings, runs = data.joined(case)
    soil = select_free(case, None)
    process = discrepancy_process(readings, {}).columns
    effects = {name: EFFECTS[name] for name in data.causes if name in EFFECTS}
    known, _ = effect_signatures(case, readings, effects)
    names = (NONE, UNKNOWN, *(s.name for s in known))
    requests, errors = [], []
    for name in names:
        own, count = case, OF_OTHERS
        coordinates, x = list(soil), rng.uniform(size=(count, len(soil)))
        if name in EFFECTS:
            own, count = with_effect(case, EFFECTS[name]), OF_CAUSE
            size = size_coordinate(EFFECTS[name], None)
            coordinates, x = [*soil, size], np.column_stack([x[:count], _sizes(size, count, rng)])
        requests.append(PredictionRequest(own, coordinates, x, readings))
        ends = {NONE: (0.0, 0.0), UNKNOWN: ERROR_ALONE}.get(name, ERROR)
        amplitude = rng.uniform(*ends, size=(count, 1))
        errors.append(amplitude * rng.standard_normal((count, process.shape[1])) @ process.T)
    found = predict_many(requests)
    kept = [(i, y + errors[i]) for i, y in enumerate(found) if not isinstance(y, InputError)]
    cause = np.concatenate([np.full(len(y), i) for i, y in kept])
    values = np.concatenate([y for _, y in kept])
    solved = np.isfinite(values).all(axis=1)
    cause, values = cause[solved], values[solved]
    std = np.empty_like(values)
    for i, name in enumerate(COLUMNS):
        of = readings.channel == i
        std[:, of] = case.noise[name].std(values[:, of])
    noisy = values + std * rng.standard_normal(values.shape)
    return Simulations(cause, names, noisy[:, runs], values[:, ~runs])


def _sizes(size: Coordinate, count: int, rng: np.random.Generator) -> Floats:
    """Sizes (count,) in reference sizes, of either sign where both are possible."""
    low, high = np.log(SIZE)
    drawn = np.exp(rng.uniform(float(low), float(high), size=count))
    negative = rng.uniform(size=count) < 0.5
    both = size.lower < 0.0 < size.upper
    sign = np.where(negative, -1.0, 1.0) if both else -1.0 if size.upper <= 0.0 else 1.0
    return np.asarray(np.clip(sign * drawn, size.lower, size.upper))


@dataclass(frozen=True)
class Components:
    """Principal components of simulated readings (s, m), which are divided by their spread."""

    mean: Floats  # (m,)
    spread: Floats  # (m,)
    basis: Floats  # (k, m), by components of a standard deviation of one

    @staticmethod
    def of(values: Floats, count: int) -> Components:
        """The first components of values (s, m)."""
        mean, spread = values.mean(axis=0), values.std(axis=0)
        _, size, basis = np.linalg.svd((values - mean) / spread, full_matrices=False)
        scale = size[:count] / np.sqrt(len(values))
        return Components(mean, spread, basis[:count] * scale[:, None])

    def coordinates(self, values: Floats) -> Floats:
        """Components (..., k) of values (..., m)."""
        white = (values - self.mean) / self.spread
        return np.asarray(white @ np.linalg.pinv(self.basis))

    def values(self, coordinates: Floats) -> Floats:
        """Values (..., m) of components (..., k)."""
        return np.asarray(self.mean + self.spread * (coordinates @ self.basis))


def _log_ratios(theta: Floats, x: Floats, observed: Floats) -> Floats:
    """Log ratios (k,) of the k columns of one-hot causes theta (s, k), at what was observed."""
    import torch
    from sbi.inference import NRE_B

    inference = NRE_B(tracker=_Untracked(), show_progress_bars=False)
    inference.append_simulations(_tensor(theta), _tensor(x))
    estimator = inference.train(max_num_epochs=RATIO_EPOCHS)
    every = torch.eye(theta.shape[1])
    with torch.no_grad():
        found = estimator(every, _tensor(observed).expand(theta.shape[1], -1))
    return np.asarray(found.reshape(-1).double())


def _posterior_draws(theta: Floats, x: Floats, observed: Floats) -> Floats:
    """Draws (d, p) of theta given what was observed."""
    import torch
    from sbi.inference import NPE

    inference = NPE(tracker=_Untracked(), show_progress_bars=False)
    inference.append_simulations(_tensor(theta), _tensor(x))
    estimator = inference.train(max_num_epochs=FLOW_EPOCHS)
    with torch.no_grad():
        found = estimator.sample((DRAWS,), condition=_tensor(observed)[None])
    return np.asarray(found.reshape(DRAWS, -1).double())


def _tensor(values: Floats) -> Any:
    import torch

    return torch.as_tensor(np.asarray(values), dtype=torch.float32)


class _Untracked:
    """In place of the library's tracker, which writes a folder into the current one."""

    log_dir = None

    def log_metric(self, name: str, value: float, step: int | None = None) -> None:
        """Keep nothing."""

    def log_metrics(self, metrics: dict[str, float], step: int | None = None) -> None:
        """Keep nothing."""

    def log_params(self, params: dict[str, Any]) -> None:
        """Keep nothing."""

    def add_figure(self, name: str, figure: Any, step: int | None = None) -> None:
        """Keep nothing."""

    def flush(self) -> None:
        """Nothing is kept."""


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """The library prints how its training goes; one thread, since its networks are small."""
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    with (
        Path(os.devnull).open("w") as nowhere,
        contextlib.redirect_stdout(nowhere),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        logging.disable(logging.WARNING)
        try:
            yield
        finally:
            logging.disable(logging.NOTSET)
            torch.set_num_threads(threads)
