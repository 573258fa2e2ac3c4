"""The file that the Bayes limit of the benchmark is kept in."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilml.errors import InputError
from soilml.io.atomic_files import replacing
from soilml.io.parquet import read_parquet
from soilml.quantities import column
from training.benchmark.bayes_limit import FRACTIONS, ExactPosterior

Floats = NDArray[np.float64]

#: Columns that say which set a row is of.
KEYS = ("effect", "design", "set", "rows_hash")
#: Columns of one number for each set.
SINGLE = ("log_density", "denser", "flagged")
HINT = "compute it anew: soilml compare --limit FILE.parquet"


class Named(Protocol):
    """What a set is found by, and the hash of its rows."""

    @property
    def effect(self) -> str:
        """What the model lacks, blank where nothing."""
        ...

    @property
    def design(self) -> str:
        """How it was driven."""
        ...

    @property
    def number(self) -> int:
        """Which of the sets driven like this."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """What is estimated."""
        ...

    @property
    def hash(self) -> str:
        """Of its rows."""
        ...


@dataclass(frozen=True)
class BayesLimit:
    """Exact posteriors of some sets: mean (n, q), covariance (n, q, q), quantiles (n, 4, q), ..."""

    mean: Floats
    covariance: Floats
    quantiles: Floats
    density: Floats
    denser: Floats
    flagged: NDArray[np.bool_]

    def rows(self, part: slice) -> BayesLimit:
        """Those of some sets."""
        return BayesLimit(
            self.mean[part],
            self.covariance[part],
            self.quantiles[part],
            self.density[part],
            self.denser[part],
            self.flagged[part],
        )


def shipped() -> Path:
    """The file that comes with the package."""
    return Path(str(resources.files("training.benchmark").joinpath("benchmark_limit.parquet")))


def save(
    path: str | os.PathLike[str], jobs: Sequence[Named], found: Sequence[ExactPosterior]
) -> None:
    """Write one row for each set, as float32."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    keys = [[j.effect for j in jobs], [j.design for j in jobs], [j.number for j in jobs]]
    columns = dict(zip(KEYS, [*map(pa.array, keys), pa.array([j.hash for j in jobs])], strict=True))
    for name, values in _flat(jobs[0].names, found).items():
        columns[name] = pa.array(np.asarray(values, np.float32))
    with replacing(path) as part:
        pq.write_table(pa.table(columns), part, compression="zstd", write_page_checksum=True)


def load(path: str | os.PathLike[str], jobs: Sequence[Named], hint: str = HINT) -> BayesLimit:
    """The limit of these sets, in their order.

    Raises `InputError` where the file has none for a set, or one of other rows: it is stale.
    """
    file = Path(path)
    try:
        columns, _ = read_parquet(file)
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror}); {hint}") from None
    names = jobs[0].names
    missing = [name for name in (*KEYS, *_names(names)) if name not in columns]
    if missing:
        raise InputError(f"{file}: column {missing[0]} is missing; {hint}")
    listed = zip(*(columns[key].to_pylist() for key in KEYS), strict=True)
    places = {(e, d, n): (i, h) for i, (e, d, n, h) in enumerate(listed)}
    rows = []
    for job in jobs:
        place, kept = places.get((job.effect, job.design, job.number), (-1, ""))
        if kept != job.hash:
            stale = "is stale: it holds the limit of other rows than"
            what = "has no limit for" if place < 0 else stale
            driven = f" with {job.effect}" if job.effect else ""
            raise InputError(f"{file} {what} set {job.number} of {job.design}{driven}; {hint}")
        rows.append(place)
    flat = {n: columns[n].to_numpy().astype(float)[rows] for n in _names(names)}
    mean = np.stack([flat[column(n)] for n in names], axis=1)
    covariance = np.empty((len(rows), len(names), len(names)))
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            covariance[:, i, j] = flat[_pair(names, a, b)]
    quantiles = np.stack(
        [np.stack([flat[_fraction(n, f)] for n in names], axis=1) for f in FRACTIONS], axis=1
    )
    single = [flat[name] for name in SINGLE]
    return BayesLimit(mean, covariance, quantiles, single[0], single[1], single[2] > 0.5)


def _flat(names: Sequence[str], found: Sequence[ExactPosterior]) -> dict[str, Floats]:
    mean = np.stack([x.mean for x in found])
    covariance = np.stack([x.covariance for x in found])
    quantiles = np.stack([x.quantiles for x in found])
    flat = {column(n): mean[:, i] for i, n in enumerate(names)}
    for i, a in enumerate(names):
        flat |= {_fraction(a, f): quantiles[:, k, i] for k, f in enumerate(FRACTIONS)}
        flat |= {_pair(names, a, b): covariance[:, i, j] for j, b in enumerate(names) if j >= i}
    single = [(x.density, x.denser, x.flagged) for x in found]
    return flat | dict(zip(SINGLE, np.asarray(single, float).T, strict=True))


def _names(names: Sequence[str]) -> list[str]:
    pairs = {_pair(names, a, b) for a in names for b in names}
    fractions = [_fraction(n, f) for n in names for f in FRACTIONS]
    return [*map(column, names), *sorted(pairs), *fractions, *SINGLE]


def _fraction(name: str, fraction: float) -> str:
    return f"{column(name)}_p{round(100 * fraction):02d}"


def _pair(names: Sequence[str], a: str, b: str) -> str:
    first, second = sorted((a, b), key=list(names).index)
    return f"covariance_{column(first)}_{column(second)}"
