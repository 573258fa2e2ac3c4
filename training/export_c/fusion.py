"""Fusion of the estimates of two model files as C, by the correlation of their errors."""

from __future__ import annotations

from collections.abc import Sequence

from soilml import __version__
from soilml.errors import InputError
from soilml.onboard.estimator import Estimator
from soilml.onboard.joint_errors import BINS, DISAGREEMENT, are_comparable, joint_errors
from soilml.onboard.multi_sensor import CONTRADICTION, SAME_LOAD, fuse_estimates
from soilml.quantities import Z_90
from training.export_c.c_file import template_environment

#: Standard deviations over that of the prior with which an estimate is fused, and the largest
#: distance from the prior's mean: float holds the squares of all, and of what is divided by them.
SOUND_LEAST, SOUND_MOST = 1e-6, 1e6


def write_fusion(
    estimators: Sequence[Estimator], files: Sequence[str], name: str
) -> tuple[str, str]:
    """Texts of the C file and of its header.

    estimators: Of the two files.
    files: Prefix of the C names of each, as `soilml export c` writes them.
    name: Prefix of the C names of the fusion.

    Raises `InputError` for files that cannot be fused: of different quantities or priors, or that
    do not state their errors on common rows.
    """
    if len({*files, name}) != 3:
        raise InputError(
            f"{', '.join(files)} and {name}: each needs another name, with which its C names begin"
        )
    for estimator in estimators:
        if estimator.errors is None:
            raise InputError(
                f"{estimator.path} does not state its errors on held-out rows, which fusion in C "
                "needs; files that estimate slip do"
            )
    fuse_estimates([estimator.prior_estimate() for estimator in estimators])
    errors = tuple(estimator.errors for estimator in estimators if estimator.errors)
    rules = joint_errors(errors)
    if rules is None or not are_comparable(errors):
        raise InputError(
            f"{' and '.join(estimator.path for estimator in estimators)} do not state their errors "
            "on common rows: train them from one data file"
        )
    first = estimators[0]
    values = {
        "name": name,
        "NAME": name.upper(),
        "version": __version__,
        "files": [
            {"name": file, "load": "load" in e.inputs, "sha": e.metadata["graph_sha256"]}
            for file, e in zip(files, estimators, strict=True)
        ],
        "quantities": list(zip(first.names, first.units, strict=True)),
        "prior": first.prior,
        "rules": rules,
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
