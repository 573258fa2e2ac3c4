"""Fusion of the estimates of several model files as C: rules by the correlation of their errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from soilml import __version__
from soilml.errors import InputError
from soilml.onboard.estimator import Estimator
from soilml.onboard.fusion_rules import RIDGE
from soilml.onboard.joint_errors import (
    BINS,
    DISAGREEMENT,
    JointErrors,
    are_comparable,
    joint_errors,
)
from soilml.onboard.multi_sensor import CONTRADICTION, SAME_LOAD, fuse_estimates
from soilml.onboard.set_contract import Floats
from soilml.quantities import Z_90
from training.export_c.c_file import template_environment

#: Standard deviations over that of the prior with which an estimate is fused, and the largest
#: distance from the prior's mean: float holds the squares of all, and of what is divided by them.
SOUND_LEAST, SOUND_MOST = 1e-6, 1e6
MOST_FILES = 4  # Files that are fused at most: rules are kept for every subset of them


@dataclass(frozen=True)
class FusionRule:
    """The rule for one quantity and one choice of files, for all files in a row.

    A choice of files is a number whose bits are the files.

    rule: As measured on the held-out rows that the chosen files have in common.
    alone: The file that is better alone than the combination; -1 where there is none.
    correlation (m, m): Correlation of the errors; 0 for files that are not chosen.
    inverse (2^m, m, m): By choice of files that have a weight: inverse of their correlation with
        its ridge.
    """

    rule: JointErrors
    alone: int
    correlation: Floats
    inverse: Floats


def write_fusion(
    estimators: Sequence[Estimator], files: Sequence[str], name: str
) -> tuple[str, str]:
    """Texts of the C file and of its header.

    estimators: Of the files, 2 to `MOST_FILES`, each another one.
    files: Prefix of the C names of each, as `soilml export c` writes them.
    name: Prefix of the C names of the fusion.

    Raises `InputError` for files that cannot be fused: of different quantities or priors, or that
    do not state their errors on common rows.
    """
    _check(estimators, files, name)
    first, chosen = estimators[0], range(2 ** len(files))
    values: dict[str, Any] = {
        "name": name,
        "NAME": name.upper(),
        "version": __version__,
        "files": [
            {"name": file, "load": "load" in e.inputs, "sha": e.metadata["graph_sha256"]}
            for file, e in zip(files, estimators, strict=True)
        ],
        "quantities": list(zip(first.names, first.units, strict=True)),
        "prior": first.prior,
        "rules": {choice: _rules_of(estimators, choice) for choice in chosen},
        "bins": BINS,
        "contradiction": CONTRADICTION,
        "disagreement": DISAGREEMENT,
        "same_load": SAME_LOAD,
        "z90": Z_90,
        "sound_least": SOUND_LEAST,
        "sound_most": SOUND_MOST,
    }
    environment = template_environment()
    source, header = (
        environment.get_template(f"fusion.{part}.j2").render(values) for part in ("c", "h")
    )
    return source, header


def _check(estimators: Sequence[Estimator], files: Sequence[str], name: str) -> None:
    if not 2 <= len(files) <= MOST_FILES:
        raise InputError(f"{len(files)} model files given; needed are 2 to {MOST_FILES}")
    if len({*files, name}) != len(files) + 1:
        raise InputError(
            f"{', '.join(files)} and {name}: each needs another name, with which its C names begin"
        )
    if any(estimator.errors is None for estimator in estimators):
        without = next(e.path for e in estimators if e.errors is None)
        raise InputError(
            f"{without} does not state its errors on held-out rows, which fusion in C needs; "
            "files that estimate slip do"
        )
    fuse_estimates([estimator.prior_estimate() for estimator in estimators])
    if not are_comparable([estimator.errors for estimator in estimators]):
        raise InputError(
            f"{' and '.join(estimator.path for estimator in estimators)} do not state their errors "
            "on common rows: train them from one data file"
        )


def _rules_of(estimators: Sequence[Estimator], choice: int) -> list[FusionRule]:
    """The rule of each quantity for a choice of files; none for fewer than two."""
    members = [i for i in range(len(estimators)) if choice >> i & 1]
    if len(members) < 2:
        return []
    held_out = [estimators[i].errors for i in members]
    rules = joint_errors(tuple(errors for errors in held_out if errors is not None))
    if rules is None:
        names = ", ".join(estimators[i].path for i in members)
        raise InputError(f"{names} have too few held-out rows in common to be fused")
    return [_among_all(rule, members, len(estimators)) for rule in rules]


def _among_all(rule: JointErrors, members: Sequence[int], count: int) -> FusionRule:
    """A rule of some files with places for all."""
    correlation, inverse = np.zeros((count, count)), np.zeros((2**count, count, count))
    correlation[np.ix_(members, members)] = rule.correlation
    for size in range(1, len(members) + 1):
        for own in combinations(range(len(members)), size):
            at = [members[i] for i in own]
            block = rule.correlation[np.ix_(own, own)] + RIDGE * np.eye(size)
            inverse[sum(1 << i for i in at)][np.ix_(at, at)] = np.linalg.inv(block)
    alone = -1 if rule.alone is None else members[rule.alone]
    return FusionRule(rule, alone, correlation, inverse)
