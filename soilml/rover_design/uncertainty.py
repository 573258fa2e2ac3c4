"""Which uncertainty a design's margin comes from, and which test would reduce it most."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from soilml.arrays import Floats, Integers
from soilml.report.numbers import parameter_name
from soilml.rover_design.performance import Outcomes
from soilml.rover_design.worlds import DrawnWorlds

#: Draws for the shares: those of a few per cent have a standard error of about one per cent.
DRAWS = 4000
ORDER, GROUP_ORDER = 3, 2  # Orders of the polynomials of one input, and of several
#: Quantiles of the margin beyond which values count as these: a few extreme errors would otherwise
#: make up most of a variance.
ENDS = (0.01, 0.99)
LEAST_SHARE = 0.005  # Smaller shares are not listed
#: Names of inputs, beside the soil's parameters, in words.
WORDS = {
    "soil": "which of the soils",
    "bearing": "error of the bearing modulus",
    "bearing_by_slip": "bearing that falls with slip",
    "bearing_by_load": "bearing that changes with load",
    "contact": "where the contact ends",
    "drawbar_pull": "other errors of the pull",
    "effect": "another law, or a missing effect",
    "lug_shearing": "how far out lugs shear",
}
_SHEAR = ("cohesion", "friction_angle", "shear_modulus")
_BEARING = ("kc", "kphi", "n", "bearing", "bearing_by_load")
#: Tests, what each would determine, and the command that reads it.
TESTS = {
    "shear and plate tests of the soil that is driven on": (
        ("soil", *_SHEAR, *_BEARING),
        "soilml bevameter",
    ),
    "shear tests under the wheel's normal stress, at several loads": (_SHEAR, "soilml bevameter"),
    "plate-sinkage tests with two plates of the wheel's size": (_BEARING, "soilml bevameter"),
    "a single wheel's drawbar pull against slip, at two loads": (
        ("contact", "bearing_by_slip", "bearing_by_load", "drawbar_pull", "effect"),
        "soilml import, then soilml gap",
    ),
    "the same wheel with lugs and without": (("lug_shearing",), "soilml gap"),
}


@dataclass(frozen=True)
class VarianceShare:
    """Share of the variance of a margin that inputs explain: one alone, or those of a test.

    text: The input in words, or the test.
    command: What reads the test; "" for an input.
    """

    text: str
    inputs: tuple[str, ...]
    share: float
    command: str = ""

    @property
    def left(self) -> float:
        """Standard deviation that would be left without them, over that of now."""
        return float(np.sqrt(max(1.0 - self.share, 0.0)))


def variance_shares(worlds: DrawnWorlds, outcome: Outcomes) -> list[VarianceShare]:
    r"""First-order shares of the variance of a design's margin, the largest first.

    .. math:: S_i = \frac{\operatorname{var} E[M | x_i]}{\operatorname{var} M}

    of margins M within their central 98 %, by polynomials of each input through the draws, with the
    adjusted coefficient of determination.
    Of several published soils, a parameter counts by how it deviates from the mean of its soil, and
    the rest is in which of the soils it is. Parameters of a posterior depend on each other: their
    shares overlap and may add up to more than one.

    outcome: Of one design, (1, n).

    References: Sobol, Math. Comput. Simul. 55, 2001; from given draws, Plischke, Borgonovo and
    Smith, Eur. J. Oper. Res. 226(3), 2013.
    """
    inputs, margin = _inputs(worlds, outcome), _finite(outcome.margin[0])
    return _largest(
        VarianceShare(
            WORDS.get(name, parameter_name(name)), (name,), _explained([columns], margin, ORDER)
        )
        for name, columns in inputs.items()
    )


def possible_tests(worlds: DrawnWorlds, outcome: Outcomes) -> list[VarianceShare]:
    """Tests by the share of the margin's variance that each would remove at most, largest first.

    It would do so if it determined its inputs exactly. Tests of nothing that is uncertain are left
    out. Which of several soils it is, is found by both tests of the soil together.
    """
    inputs, margin = _inputs(worlds, outcome), _finite(outcome.margin[0])
    found = []
    for text, (names, command) in TESTS.items():
        own = [name for name in names if name in inputs]
        if "soil" in names and "soil" not in inputs:
            continue  # of one soil, each test counts for itself
        share = _explained([inputs[name] for name in own], margin, GROUP_ORDER) if own else 0.0
        found.append(VarianceShare(text, tuple(own), share, command))
    return _largest(found)


def _largest(shares: Iterable[VarianceShare]) -> list[VarianceShare]:
    """Shares of at least `LEAST_SHARE`, the largest first."""
    kept = [one for one in shares if one.share >= LEAST_SHARE]
    return sorted(kept, key=lambda one: -one.share)


def _inputs(worlds: DrawnWorlds, outcome: Outcomes) -> dict[str, Floats]:
    """Inputs that vary, (n, columns) each: one column of a number, one for each kind or effect.

    Parameters are taken by what they deviate from the mean of their kind of soil.
    """
    inputs: dict[str, Floats] = {}
    if len(worlds.kinds) > 1:
        kinds = np.unique(worlds.kind)[1:]  # a column for each kind but the first
        inputs["soil"] = np.stack([worlds.kind == k for k in kinds], axis=1).astype(np.float64)
    soil = {n: v - _mean_of_kind(v, worlds.kind) for n, v in worlds.soil.items()}
    numbers: dict[str, Floats] = {**soil, **worlds.errors}
    numbers["lug_shearing"] = worlds.lug_shearing
    numbers["drawbar_pull"] = outcome.pull_error[0]
    for name, values in numbers.items():
        size = float(np.abs(worlds.soil.get(name, values)).max())
        if (name in WORDS or name in soil) and np.ptp(values) > 1e-9 * size:
            inputs[name] = ((values - values.mean()) / values.std())[:, None]
    if worlds.lacking:
        sizes = np.stack([getattr(e, e.about.size) for e in worlds.lacking], axis=1) * worlds.acts
        inputs["effect"] = sizes / np.maximum(np.abs(sizes).max(axis=0), 1e-300)
    return inputs


def _mean_of_kind(values: Floats, kind: Integers) -> Floats:
    sums, counts = np.bincount(kind, values), np.bincount(kind)
    return np.asarray((sums / np.maximum(counts, 1))[kind])


def _finite(margin: Floats) -> Floats:
    """Margins (n,), those beyond `ENDS`, and of wheels that are not carried, moved to the ends."""
    known = margin[np.isfinite(margin)]
    if not known.size:
        return np.zeros(len(margin))
    return np.asarray(np.clip(margin, *np.quantile(known, ENDS)))


def _explained(parts: Sequence[Floats], y: Floats, order: int) -> float:
    """Adjusted share of the variance of y that polynomials of the columns explain; 0 at least."""
    total = float(np.var(y))
    if total <= 0.0:
        return 0.0
    columns = [np.ones(len(y))]
    single = [part[:, 0] for part in parts if part.shape[1] == 1]
    for power in range(1, order + 1):
        for chosen in combinations_with_replacement(range(len(single)), power):
            columns.append(np.prod([single[i] for i in chosen], axis=0))
    columns += [part[:, i] for part in parts if part.shape[1] > 1 for i in range(part.shape[1])]
    basis = np.stack(columns, axis=1)
    fitted, _, rank, _ = np.linalg.lstsq(basis, y, rcond=1e-10)
    left = float(np.mean((y - basis @ fitted) ** 2)) * len(y) / max(len(y) - int(rank), 1)
    return max(1.0 - left / (total * len(y) / (len(y) - 1)), 0.0)
