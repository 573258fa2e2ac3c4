"""A response surface as arrays of one file, so that workers of the tests share it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from training.regressors.gaussian_regressor import Standardisation
from training.set_posterior.response_surface import Response


def save_response(file: Path, response: Response) -> None:
    """Write a surface, and that of the changes by another contact if it has one."""
    np.savez(file, **dict(_arrays(response, "")))


def load_response(file: Path) -> Response:
    """The surface of a file that `save_response` wrote."""
    with np.load(file, allow_pickle=False) as kept:
        arrays = dict(kept)
    contact = _response(arrays, "contact.") if "contact.terms" in arrays else None
    return _response(arrays, "", contact)


def _arrays(response: Response, prefix: str) -> Iterator[tuple[str, np.ndarray]]:
    yield f"{prefix}terms", np.asarray(response.terms)
    yield f"{prefix}mean", response.scaling.mean
    yield f"{prefix}scale", response.scaling.scale
    for name in ("lower", "upper", "error"):
        yield prefix + name, getattr(response, name)
    for i, layer in enumerate(response.layers):
        yield f"{prefix}layer{i}", layer
    if response.contact is not None:
        yield from _arrays(response.contact, "contact.")


def _response(
    arrays: dict[str, np.ndarray], prefix: str, contact: Response | None = None
) -> Response:
    count = sum(name.startswith(f"{prefix}layer") for name in arrays)
    return Response(
        terms=tuple(tuple(int(k) for k in term) for term in arrays[f"{prefix}terms"]),
        scaling=Standardisation(arrays[f"{prefix}mean"], arrays[f"{prefix}scale"]),
        layers=tuple(arrays[f"{prefix}layer{i}"] for i in range(count)),
        lower=arrays[f"{prefix}lower"],
        upper=arrays[f"{prefix}upper"],
        error=arrays[f"{prefix}error"],
        contact=contact,
    )
