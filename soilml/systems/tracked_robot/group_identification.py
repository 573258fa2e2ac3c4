"""Soil parameters from groups of pulls of a tracked robot, averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError
from soilml.identification import Fit, identify
from soilml.identification.fit import identifiability_remarks
from soilml.io.table import Table
from soilml.quantities import Z_90

#: Parameters that the source identifies from the pull alone, in its order.
PARAMETERS = ("n", "friction_angle", "kphi", "shear_modulus", "cohesion")


@dataclass(frozen=True)
class GroupFits:
    """One fit for each group of data, their average, and one of all rows where it was made.

    Raises `InputError` for fewer than two groups.
    """

    fits: tuple[Fit, ...]
    pooled: Fit | None = None

    def __post_init__(self) -> None:
        if len(self.fits) < 2:
            raise InputError(
                f"{len(self.fits)} groups of data are given; an average needs two or more"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that were free."""
        return self.fits[0].names

    @property
    def values(self) -> Floats:
        """Fitted values of each group, (groups, parameters)."""
        return np.stack([fit.values for fit in self.fits])

    @property
    def mean(self) -> Floats:
        """The average of the groups, (parameters,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def std(self) -> Floats:
        r"""Standard deviation of the average, (parameters,).

        .. math:: s^2 = \frac{v}{N} + \max(0, \bar{u} - v)

        with v the variance between the groups and u the variance that each fit reports: the part
        of u that does not appear as scatter is common to all groups and is not reduced by
        averaging.
        """
        between = self.values.var(axis=0, ddof=1)
        reported = np.mean([fit.std**2 for fit in self.fits], axis=0)
        return np.asarray(np.sqrt(between / len(self.fits) + np.maximum(reported - between, 0.0)))

    @property
    def remaining_fraction(self) -> dict[str, float]:
        """Remaining fraction of each prior's width, averaged over the groups."""
        each = [fit.remaining_fraction for fit in self.fits]
        names = (n for n in self.names if all(n in left for left in each))
        return {n: float(np.mean([left[n] for left in each])) for n in names}

    @property
    def average(self) -> Fit:
        """The average as a fit: its errors, what is left of the priors, and warnings by that.

        Its interval reaches no further than those of the groups, which know their priors.
        """
        first, left = self.fits[0], self.remaining_fraction
        low, high = (
            np.asarray(ends) for ends in zip(*(f.interval for f in self.fits), strict=True)
        )
        return Fit(
            method=f"mean of {len(self.fits)} fits, {first.method}",
            names=self.names,
            units=first.units,
            values=self.mean,
            covariance=np.diag(self.std**2),
            warnings=tuple(
                r for n, share in left.items() for r in identifiability_remarks(n, share)
            ),
            rows_used=sum(fit.rows_used for fit in self.fits),
            remaining_fraction=left,
            channels=first.channels,
            low=np.maximum(self.mean - Z_90 * self.std, low.min(axis=0)),
            high=np.minimum(self.mean + Z_90 * self.std, high.max(axis=0)),
        )


def identify_groups(
    case: Case, tables: Sequence[Table], free: Sequence[str] = PARAMETERS, method: str = "nonlinear"
) -> GroupFits:
    """Fit each table (`slip`, `load_N`, `drawbar_pull_N`), and all rows pooled.

    `method` is `nonlinear`, least squares as in the source, or `posterior`. Raises `InputError` for
    fewer than two groups, `FitError` for rows that cannot be fitted. References: Wang et al. 2018,
    section 4.2.
    """
    groups = GroupFits(tuple(identify(case, table, free, method) for table in tables))
    names = [name for name in tables[0].columns if all(name in table for table in tables)]
    rows = {name: np.concatenate([table[name] for table in tables]) for name in names}
    return replace(groups, pooled=identify(case, Table(rows), free, method))
