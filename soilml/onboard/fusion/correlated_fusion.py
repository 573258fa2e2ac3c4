"""Fusion of readings whose errors are correlated: of several files, and repeated ones of a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.onboard.fusion.held_out_errors import HeldOutErrors
from soilml.onboard.fusion.joint_errors import joint_errors

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FusedRows:
    """Mean, standard deviation, ends of the 90 % interval, and disagreement, each (n, q).

    The disagreement is the largest difference between two files, in standard deviations of that
    difference; 0 for readings of one file.
    """

    mean: Floats
    std: Floats
    low: Floats
    high: Floats
    disagreement: Floats


def fuse_rows(mean: Floats, std: Floats, files: Sequence[HeldOutErrors]) -> FusedRows:
    """Fuse m readings by variance and the correlation of their errors.

    Readings of the same file are averaged first: what they have in common of their error, which
    the file carries, does not average out. The averages of different files are then fused by
    `JointErrors`.

    Parameters
    ----------
    mean, std : ndarray, shape (m, n, q)
        Estimates of the m readings.
    files : sequence of HeldOutErrors
        Of the file that each reading was estimated by, (m,); `are_comparable` must hold.

    Raises
    ------
    ValueError
        Where the files have too few held-out rows in common.
    """
    distinct = tuple(dict.fromkeys(files))
    members = [[i for i, other in enumerate(files) if other == file] for file in distinct]
    repeated = [file.repeated(len(m)) for file, m in zip(distinct, members, strict=True)]
    ratio = np.stack([r for r, _ in repeated])  # (files, q)
    means = np.stack([mean[m].mean(axis=0) for m in members])
    stds = np.stack([std[m].mean(axis=0) for m in members]) * ratio[:, None, :]
    if len(distinct) == 1:
        half = repeated[0][1] * stds[0]
        return FusedRows(means[0], stds[0], means[0] - half, means[0] + half, 0.0 * half)
    rules = joint_errors(distinct)
    if rules is None:
        raise ValueError("the files have too few held-out rows in common")
    count = float(np.exp(np.mean([np.log(len(m)) for m in members])))
    columns = []
    for k, rule in enumerate(rules):
        fused, spread, disagreement = rule.fuse(means[..., k], stds[..., k], ratio[:, k], count)
        columns.append((fused, spread, *rule.interval(fused, spread, count), disagreement))
    return FusedRows(*(np.stack(column, axis=-1) for column in zip(*columns, strict=True)))
