"""How well a design identifies each effect, and which effects it cannot distinguish."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.gap.statistics.signatures import Signature
from soilml.numerics.subspaces import project_out
from soilml.parameters import declared
from soilml.physics.effects import Effect

Floats = NDArray[np.float64]

#: Approximate 95 % quantile of the largest score of the catalogue in data without a gap.
DETECTION_THRESHOLD = 3.0
#: 80 % quantile of the standard normal distribution: the power at which an effect is detectable.
POWER_QUANTILE = 0.8416
#: Separation, in sigma, from which an effect can be named, and below which two effects are
#: indistinguishable.
NAMEABLE_SIGMA, SAME_CLASS_SIGMA = 3.0, 2.0
#: Rivals that are listed for each effect.
LISTED_RIVALS = 3


@dataclass(frozen=True)
class EffectIdentifiability:
    """How well a design identifies one effect at its reference size."""

    name: str
    kind: str
    size: float  # reference size, in `unit`
    unit: str
    signal: float  # norm of the signature, in sigma
    residual_signal: float  # norm that remains after the soil parameters have adapted, in sigma
    absorbed: float  # fraction of the squared norm that the soil parameters absorb
    rivals: tuple[tuple[str, float], ...]  # most similar effects, with their cosine
    separating_snr: float  # sigma, against the most similar effect
    detectable_size: float  # smallest size detected with a power of 80 %, in `unit`


def identifiability(
    signatures: Sequence[Signature],
    std: Floats,
    jacobian: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[EffectIdentifiability]:
    """Norms, cosines and separations of signatures on readings with independent noise.

    `jacobian`, (m + t, p), has the derivatives of the whitened readings by the soil, and behind
    them those of tests of the soil, which no effect changes.
    """
    if not signatures:
        return []
    columns = _whitened(signatures, std, len(jacobian))
    projected = project_out(columns, jacobian)
    signal, residual = np.linalg.norm(columns, axis=0), np.linalg.norm(projected, axis=0)
    unit = projected / np.maximum(residual, 1e-300)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    table = []
    for i, s in enumerate(signatures):
        nearest = np.argsort(-cosine[i])[:LISTED_RIVALS]
        about = effects[s.name].about
        size = about.reference[about.size]
        sine = np.sqrt(max(0.0, 1.0 - float(cosine[i].max(initial=0.0)) ** 2))
        detectable = float("inf")
        if residual[i] > 1e-6:
            detectable = float((DETECTION_THRESHOLD + POWER_QUANTILE) / residual[i] * size)
        table.append(
            EffectIdentifiability(
                name=s.name,
                kind=s.kind,
                size=size,
                unit=declared(effects[s.name])[about.size].unit,
                signal=float(signal[i]),
                residual_signal=float(residual[i]),
                absorbed=float(1.0 - (residual[i] / signal[i]) ** 2),
                rivals=tuple((signatures[j].name, float(cosine[i, j])) for j in nearest if j != i),
                separating_snr=float(residual[i] * sine),
                detectable_size=detectable,
            )
        )
    return table


def indistinguishable_classes(
    signatures: Sequence[Signature], std: Floats, jacobian: Floats
) -> tuple[tuple[str, ...], ...]:
    """Effects that this design cannot distinguish at their reference sizes."""
    if not signatures:
        return ()
    columns = _whitened(signatures, std, len(jacobian))
    projected = project_out(columns, jacobian)
    norm = np.linalg.norm(projected, axis=0)
    unit = projected / np.maximum(norm, 1e-300)
    sine = np.sqrt(np.maximum(0.0, 1.0 - (unit.T @ unit) ** 2))
    label = list(range(len(signatures)))
    for i in range(len(signatures)):
        for j in range(i):
            weaker = min(norm[i], norm[j])
            if weaker > SAME_CLASS_SIGMA and weaker * sine[i, j] < SAME_CLASS_SIGMA:
                old, new = label[i], label[j]
                label = [new if k == old else k for k in label]
    groups = [
        tuple(s.name for s, k in zip(signatures, label, strict=True) if k == g) for g in set(label)
    ]
    return tuple(sorted(g for g in groups if len(g) > 1))


def _whitened(signatures: Sequence[Signature], std: Floats, rows: int) -> Floats:
    """Whitened signatures (rows, k), zero behind the readings."""
    columns = np.zeros((rows, len(signatures)))
    columns[: len(std)] = np.stack([s.column for s in signatures], axis=1) / std[:, None]
    return columns
