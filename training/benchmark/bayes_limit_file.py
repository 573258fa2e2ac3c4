"""Summaries of exact posteriors, and the Parquet file that stores them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.errors import InputError
from soilml.io.atomic_files import atomic_output
from soilml.io.parquet import read_parquet
from soilml.quantities import column

#: Quantiles that are stored: ends of the 90 % and of the 50 % interval.
FRACTIONS = (0.05, 0.25, 0.75, 0.95)
HPD_DRAWS = 200  # Posterior draws that estimate the HPD level of the truth: its resolution is 1/200


@dataclass(frozen=True)
class PosteriorSummary:
    r"""The posterior of one set: mean (q,), covariance (q, q), quantiles (4, q), and diagnostics.

    `log_density` is the logarithm of the posterior density at the truth, of the parameters as
    fractions of their priors, exact but for the Monte Carlo error of the evidence:

    .. math:: \log p(\theta^* | y) = \log p(y | \theta^*) - \log \int p(y | \theta) d\theta

    `hpd_level` is the share of the posterior with a higher density than the truth: the truth lies
    in the 90 % highest-posterior-density region where it is below 0.9. `flagged`: the residuals at
    the best sample exceed what noise produces once in a thousand sets, or sampling failed.
    """

    mean: Floats
    covariance: Floats
    quantiles: Floats
    log_density: float
    hpd_level: float
    flagged: bool


KEY_COLUMNS = ("effect", "design", "set", "rows_hash")  # Columns that identify the set of a row
#: Columns of one number per set: log density at the truth, HPD level of the truth, flag.
SCALAR_COLUMNS = ("log_density", "denser", "flagged")
HINT = "compute it again: soilml compare --limit FILE.parquet"


class StoredSet(Protocol):
    """What identifies a set whose posterior is stored.

    The unmodelled effect, blank where none; the key of the design and the number within it; the
    estimated parameters; and a hash of the rows.
    """

    @property
    def effect(self) -> str: ...
    @property
    def design(self) -> str: ...
    @property
    def number(self) -> int: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def hash(self) -> str: ...


@dataclass(frozen=True)
class BayesLimit:
    """Exact posteriors of n sets: `PosteriorSummary`, stacked.

    mean (n, q), covariance (n, q, q), quantiles (n, 4, q), and (n,) each of the rest.
    """

    mean: Floats
    covariance: Floats
    quantiles: Floats
    log_densities: Floats
    hpd_levels: Floats
    flagged: NDArray[np.bool_]

    def subset(self, part: slice) -> BayesLimit:
        """The posteriors of some sets."""
        return BayesLimit(**{f.name: getattr(self, f.name)[part] for f in fields(self)})


def packaged_limit() -> Path:
    """The file that comes with the package."""
    return Path(str(resources.files("training.benchmark").joinpath("benchmark_limit.parquet")))


def save_limit(
    path: str | os.PathLike[str], sets: Sequence[StoredSet], summaries: Sequence[PosteriorSummary]
) -> None:
    """Write one row per set, as float32; the file is replaced atomically."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    keys = [
        pa.array([s.effect for s in sets]),
        pa.array([s.design for s in sets]),
        pa.array([s.number for s in sets]),
        pa.array([s.hash for s in sets]),
    ]
    columns = dict(zip(KEY_COLUMNS, keys, strict=True))
    for name, values in _to_columns(sets[0].names, summaries).items():
        columns[name] = pa.array(np.asarray(values, np.float32))
    with atomic_output(path) as part:
        pq.write_table(pa.table(columns), part, compression="zstd", write_page_checksum=True)


def load_limit(
    path: str | os.PathLike[str], sets: Sequence[StoredSet], hint: str = HINT
) -> BayesLimit:
    """The stored posteriors of these sets, in their order.

    Raises `InputError` where the file cannot be read, has no posterior of a set, or is stale: it
    stores the posterior of other rows under the same key. `hint` ends the message.
    """
    file = Path(path)
    try:
        columns, _ = read_parquet(file)
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror}); {hint}") from None
    names = sets[0].names
    missing = [name for name in (*KEY_COLUMNS, *_column_names(names)) if name not in columns]
    if missing:
        raise InputError(f"{file}: column {missing[0]} is missing; {hint}")
    listed = zip(*(columns[key].to_pylist() for key in KEY_COLUMNS), strict=True)
    stored = {(e, d, n): (i, h) for i, (e, d, n, h) in enumerate(listed)}
    rows = []
    for one in sets:
        row, stored_hash = stored.get((one.effect, one.design, one.number), (-1, ""))
        if stored_hash != one.hash:
            stale = "is stale: it stores the posterior of other rows than those of"
            problem = "has no posterior of" if row < 0 else stale
            effect = f" with {one.effect}" if one.effect else ""
            raise InputError(f"{file} {problem} set {one.number} of {one.design}{effect}; {hint}")
        rows.append(row)
    flat = {n: columns[n].to_numpy().astype(float)[rows] for n in _column_names(names)}
    return _from_columns(names, flat)


def _from_columns(names: Sequence[str], flat: dict[str, Floats]) -> BayesLimit:
    mean = np.stack([flat[column(n)] for n in names], axis=1)
    covariance = np.empty((len(mean), len(names), len(names)))
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            covariance[:, i, j] = flat[_covariance_column(names, a, b)]
    quantiles = np.stack(
        [np.stack([flat[_quantile_column(n, f)] for n in names], axis=1) for f in FRACTIONS], axis=1
    )
    log_densities, hpd_levels, flags = (flat[name] for name in SCALAR_COLUMNS)
    return BayesLimit(
        mean=mean,
        covariance=covariance,
        quantiles=quantiles,
        log_densities=log_densities,
        hpd_levels=hpd_levels,
        flagged=flags > 0.5,
    )


def _to_columns(names: Sequence[str], summaries: Sequence[PosteriorSummary]) -> dict[str, Floats]:
    mean = np.stack([s.mean for s in summaries])
    covariance = np.stack([s.covariance for s in summaries])
    quantiles = np.stack([s.quantiles for s in summaries])
    flat = {column(n): mean[:, i] for i, n in enumerate(names)}
    for i, a in enumerate(names):
        flat |= {_quantile_column(a, f): quantiles[:, k, i] for k, f in enumerate(FRACTIONS)}
        flat |= {
            _covariance_column(names, a, b): covariance[:, i, j]
            for j, b in enumerate(names)
            if j >= i
        }
    scalars = [(s.log_density, s.hpd_level, s.flagged) for s in summaries]
    return flat | dict(zip(SCALAR_COLUMNS, np.asarray(scalars, float).T, strict=True))


def _column_names(names: Sequence[str]) -> list[str]:
    covariances = {_covariance_column(names, a, b) for a in names for b in names}
    quantiles = [_quantile_column(n, f) for n in names for f in FRACTIONS]
    return [*map(column, names), *sorted(covariances), *quantiles, *SCALAR_COLUMNS]


def _quantile_column(name: str, fraction: float) -> str:
    return f"{column(name)}_p{round(100 * fraction):02d}"


def _covariance_column(names: Sequence[str], a: str, b: str) -> str:
    first, second = sorted((a, b), key=list(names).index)
    return f"covariance_{column(first)}_{column(second)}"
