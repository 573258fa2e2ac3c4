"""Soil from the pull of a tracked robot, group of data by group, and what the average is worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.identification import Fit, identify
from soilml.identification.diagnostics import HARDLY
from soilml.io.table import Table
from soilml.physics.operating_point import Operating
from soilml.quantities import column

Floats = NDArray[np.float64]

#: What the source identifies from the pull alone, in its order.
FIVE = ("n", "friction_angle", "kphi", "shear_modulus", "cohesion")


@dataclass(frozen=True)
class Groups:
    """One fit for each group of data, their average, and one fit of all rows together."""

    fits: tuple[Fit, ...]
    joint: Fit

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that were free."""
        return self.joint.names

    @property
    def values(self) -> Floats:
        """What each group says, (groups, parameters)."""
        return np.stack([fit.values for fit in self.fits])

    @property
    def mean(self) -> Floats:
        """The average of the groups, (parameters,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def std(self) -> Floats:
        r"""Expected distance between the average and the truth, (parameters,).

        .. math:: s^2 = \frac{v}{N} + \max(0, \bar{u} - v)

        with v the scatter between the groups and u the squared standard deviation that each fit
        claims: what the fits do not know beyond what they differ by is common to them all, and
        averages out of none.
        """
        between = self.values.var(axis=0, ddof=1)
        claimed = np.mean([fit.std**2 for fit in self.fits], axis=0)
        return np.asarray(np.sqrt(between / len(self.fits) + np.maximum(claimed - between, 0.0)))

    @property
    def left(self) -> dict[str, float]:
        """Share of each prior that a group leaves open, in the mean; 1 where it tells nothing."""
        return {n: float(np.mean([fit.left[n] for fit in self.fits])) for n in self.names}

    @property
    def open(self) -> tuple[str, ...]:
        """Parameters of which the groups tell hardly anything: the average is mostly prior."""
        return tuple(name for name, share in self.left.items() if share > HARDLY)


def identified(
    case: Case, tables: Sequence[Table], free: Sequence[str] = FIVE, method: str = "nonlinear"
) -> Groups:
    """A fit of each table (`slip`, `load_N`, `drawbar_pull_N`), and one of all rows at once.

    `method` is `nonlinear`, least squares as the source has it, or `posterior`. References: Wang
    et al. 2018, section 4.2. Raises `InputError` for fewer than two groups, `FitError` where rows
    cannot be fitted.
    """
    if len(tables) < 2:
        raise InputError(f"{len(tables)} groups of data are given; an average needs two or more")
    fits = tuple(identify(case, table, free, method) for table in tables)
    names = [name for name in tables[0].columns if all(name in table for table in tables)]
    rows = {name: np.concatenate([table[name] for table in tables]) for name in names}
    return Groups(fits, identify(case, Table(rows), free, method))


def driven(case: Case, slips: Floats, load: float, rng: np.random.Generator) -> Table:
    """A group of data: the pull (N) at these slips (n,) with the case's declared noise."""
    force = case.model(case.soil, Operating(slip=slips, load=load))
    key = column("drawbar_pull")
    pull = np.asarray(force.drawbar_pull)
    if np.isnan(pull).any() or key not in case.noise:
        raise InputError(
            f"the soil must carry {load:g} N, and the case must declare noise of {key}"
        )
    noisy = pull + case.noise[key].std(pull) * rng.standard_normal(len(slips))
    return Table({"slip": slips, "load_N": np.full(len(slips), load), key: noisy})


def predicted(case: Case, fit: Fit, table: Table) -> Floats:
    """Pull (N) that a case with the fitted values predicts for the rows of a table, (n,)."""
    found = case.with_values(dict(zip(fit.names, fit.values.tolist(), strict=True)))
    at = Operating(slip=table["slip"], load=table["load_N"])
    return np.asarray(found.model(found.soil, at).drawbar_pull)
