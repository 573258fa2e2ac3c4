"""The smooth remainder that a gap analysis learned beside soil and effects: [remainder].

What no parameter and no effect of a model explains, as a Gaussian process of slip and load for each
channel and gear, given the readings of the analysis.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from soilml.arrays import Floats
from soilml.io.declared_settings import Numbers, OneOf, settings_of, take_declared
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.numerics.smooth_process import SmoothFunctions, process_columns, squared_exponential
from soilml.parameters import Parameter
from soilml.physics.contact import Force
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark

FORMAT = 1  # Version of the table [remainder]
#: Most points of one part, and most columns of its factors: a file stays readable, and no analysis
#: needs more.
MOST_POINTS, MOST_PARTS = 60, 100
#: Squared distances of points from each other, as a fraction of the process's variance that is left
#: given the others, below which their factor cannot be computed.
LEAST_PIVOT = 1e-9
#: Rounding error that the length of a written factor may have.
TOLERANCE = 1e-6
#: Rows of an analysis that the remainder remembers, and hexadecimal digits of each: those with the
#: smallest digests, so that a large enough part of the rows has some of them too.
MOST_MARKS, MARK_DIGITS = 32, 8
#: Correlation lengths outside the range within which what was learned fades. Of 0.25, 0.5, 1 and
#: infinitely many, the longer the better under heavier loads; one that ends is nevertheless needed.
FADING_LENGTH = 2.0


@dataclass(frozen=True)
class _Rows:
    """A list of finite numbers (depth 1), or of such lists (depth 2)."""

    depth: int

    def take(self, settings: Settings, key: str, kind: str) -> tuple[Any, ...]:
        """The numbers as tuples."""
        needed = f"a list of {'lists of ' if self.depth > 1 else ''}finite numbers"
        value = settings.take(key, list, needed)
        rows = value if self.depth > 1 else [value]
        flat: list[Any] = [v for row in rows for v in (row if isinstance(row, list) else [None])]
        if not all(type(v) in (int, float) and math.isfinite(v) for v in flat):
            settings.fail(f"{key} must be {needed}")
        found = tuple(tuple(float(v) for v in row) for row in rows)
        return found if self.depth > 1 else found[0]


_SIZE = Parameter("1", 1e-300, 1e300, "above zero")
_RANGE = Numbers("[smallest, largest]", 2, ordered=True)
_LOADS = Numbers("[smallest, largest], above zero", 2, 1e-300, ordered=True)
_CHANNEL = OneOf(tuple(map(column, CHANNELS)))


@dataclass(frozen=True)
class RemainderPart:
    r"""The remainder of one channel of one gear, as one analysis learned it.

    .. math::
        \delta(x) = a \psi(x)^T w, \quad \psi(x) = L^{-1} k(Z, x), \quad L L^T = k(Z, Z), \quad
        w \sim N(\mu, I - F F^T)

    with points Z in slip and the logarithm of the load, over their correlation lengths, and
    :math:`k(x, x') = e^{-|x - x'|^2 / 2}`. Mean and variance at any slip and load, given soil and
    effects of the model:

    .. math:: E[\delta] = q a \psi^T \mu, \quad
        \operatorname{var}[\delta] = q^2 a^2 (1 - |F^T \psi|^2) + b^2 (1 - q^2), \quad
        q = e^{-d^2 / (2 \lambda^2)}

    Outside the range of the analysis, psi is that at the nearest point of it, and q makes the
    remainder fade with the distance d from the range, in correlation lengths: to a mean of zero,
    and to the standard deviation b, the larger of a and a model's usual error. What a process says
    beyond its readings is its own shape, which rings; what is known of a model there is nothing.

    References: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eqs. 2.25 and
    2.26; Kennedy and O'Hagan, J. R. Statist. Soc. B 63(3), 2001, section 4.2. Valid for smooth
    errors of slip and load alone: what changes with time, speed or pass is not in it.
    """

    column: Annotated[str, _CHANNEL]
    gear: str = field(default="", kw_only=True)  # "" where the model has one gear
    # Standard deviation a of the process, in the column's unit, and that of a model's usual error
    amplitude: Annotated[float, _SIZE]
    usual: Annotated[float, _SIZE]
    # Correlation lengths in slip and in the natural logarithm of the load
    slip_length: Annotated[float, _SIZE]
    log_load_length: Annotated[float, _SIZE]
    slip: Annotated[tuple[float, float], _RANGE]  # Range of the analysis
    load: Annotated[tuple[float, float], _LOADS]  # N
    points: Annotated[tuple[tuple[float, ...], ...], _Rows(2)]  # Slip and load (N), (k, 2)
    mean: Annotated[tuple[float, ...], _Rows(1)]  # Of the weights, (k,)
    # F, (k, r): what the readings told of the weights, given soil and effects
    known: Annotated[tuple[tuple[float, ...], ...], _Rows(2)]
    # G, (k, p): shifts of the weights with soil and effects, by one standard deviation of p
    # independent combinations of them. Where these are fitted anew, the covariance of the weights
    # is I - F F^T + G G^T
    shared: Annotated[tuple[tuple[float, ...], ...], _Rows(2)]

    def scaled(self, slip: Floats, load: Floats) -> Floats:
        """Slips and loads (n,) as points (n, 2) over the correlation lengths."""
        return np.column_stack([slip / self.slip_length, np.log(load) / self.log_load_length])

    @cached_property
    def factor(self) -> Floats:
        """Cholesky factor L (k, k) of the correlations of the points."""
        z = self.scaled(*np.asarray(self.points).T)
        return np.asarray(np.linalg.cholesky(squared_exponential(z, z)))

    def functions(self, slip: Floats, load: Floats) -> Floats:
        """The functions psi (n, k) at slips and loads (n,)."""
        z = self.scaled(*np.asarray(self.points).T)
        between = squared_exponential(z, self.scaled(slip, load))
        return np.asarray(np.linalg.solve(self.factor, between).T)

    def mean_and_std(self, slip: Floats, load: Floats) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n,) at slips and loads (n,), in the column's unit."""
        slip, load = np.asarray(slip, np.float64), np.asarray(load, np.float64)
        psi, share = self.functions(*self._within(slip, load)), self._share(slip, load)
        told = ((psi @ self._matrix("known")) ** 2).sum(axis=1)
        variance = (share * self.amplitude) ** 2 * np.maximum(1.0 - told, 0.0)
        std = np.sqrt(variance + self._std_beyond(slip, load) ** 2)
        return np.asarray(share * self.amplitude * (psi @ np.asarray(self.mean))), std

    def columns(self, slip: Floats, load: Floats, *, fitted_anew: bool) -> Floats:
        r"""Columns C (n, q), with C C^T the covariance (n, n) of the remainder at these rows.

        fitted_anew: Whether soil and effects are fitted anew, and the remainder is uncertain with
            them.
        """
        beyond = _smooth_columns(self.scaled(slip, load), self._std_beyond(slip, load))
        return np.column_stack([self._own_columns(slip, load, fitted_anew=fitted_anew), beyond])

    def _own_columns(self, slip: Floats, load: Floats, *, fitted_anew: bool) -> Floats:
        """The columns of the process itself, without what it has beyond its range."""
        share = self._share(slip, load)
        slip, load = self._within(slip, load)
        psi = self.functions(slip, load)
        inner = np.eye(len(self.mean)) - self._matrix("known") @ self._matrix("known").T
        if fitted_anew:
            inner += self._matrix("shared") @ self._matrix("shared").T
        value, vector = np.linalg.eigh(inner)
        within = psi @ (vector * np.sqrt(np.maximum(value, 0.0)))
        # what the points do not represent: a process that is zero at them, whatever the weights
        z, at = self.scaled(*np.asarray(self.points).T), self.scaled(slip, load)
        at_rows, at_points = np.split(process_columns(np.concatenate([at, z])), [len(at)])
        left = at_rows - psi @ np.linalg.solve(self.factor, at_points)
        return np.asarray(self.amplitude * share[:, None] * np.column_stack([within, left]))

    def error_functions(
        self, slip: tuple[float, float], load: tuple[float, float]
    ) -> SmoothFunctions:
        """The covariance of `columns` as functions of slip and load (N), soil fitted anew."""
        lengths = self.slip_length, self.log_load_length

        def own(slip: Floats, load: Floats) -> Floats:
            return self._own_columns(slip, load, fitted_anew=True)

        def unit(slip: Floats, load: Floats) -> Floats:
            return process_columns(self.scaled(slip, load))

        inside = SmoothFunctions.of(own, lengths, slip, load)
        outside = SmoothFunctions.of(unit, lengths, slip, load)
        return SmoothFunctions.joined([inside, outside.times(self._std_beyond)])

    def _matrix(self, name: str) -> Floats:
        return np.asarray(getattr(self, name), dtype=np.float64).reshape(len(self.mean), -1)

    def _within(self, slip: Floats, load: Floats) -> tuple[Floats, Floats]:
        """The nearest slips and loads (n,) of the range."""
        return np.clip(slip, *self.slip), np.clip(load, *self.load)

    def _share(self, slip: Floats, load: Floats) -> Floats:
        """Share (n,) of what was learned that is left at slips and loads (n,): 1 in the range."""
        apart = self.scaled(slip, load) - self.scaled(*self._within(slip, load))
        return np.asarray(np.exp(-0.5 * (apart**2).sum(axis=1) / FADING_LENGTH**2))

    def _std_beyond(self, slip: Floats, load: Floats) -> Floats:
        """Standard deviation (n,) of what was not learned: zero in the range."""
        lost = np.maximum(1.0 - self._share(slip, load) ** 2, 0.0)
        return np.asarray(max(self.usual, self.amplitude) * np.sqrt(lost))


#: Where `Case.without_remainder_of` leaves one out.
SAME_ROWS = Remark(
    "same-rows",
    "[remainder] was learned from rows of this table, which would count twice: it is left out. "
    "The intervals of the analysis that learned it are in its gap.json (soil_after)",
)


@dataclass(frozen=True)
class Remainder:
    """The remainders of all channels and gears; parts of one channel and gear add up.

    A further analysis of a model with a remainder adds what it finds beside it.

    rows: Digests of rows that it was learned from; none where they are not known.
    """

    parts: tuple[RemainderPart, ...]
    rows: tuple[str, ...] = ()

    def learned_from(self, table: Table) -> bool:
        """Whether it was learned from rows of a table: mean and rows then say the same twice."""
        return bool(self.rows) and not set(self.rows).isdisjoint(_marks(table))

    def of_rows(self, table: Table) -> Remainder:
        """The same, learned from the rows of a table too."""
        return replace(self, rows=(*self.rows, *sorted(_marks(table))[:MOST_MARKS]))

    def of(self, channel: str, gear: str = "") -> list[RemainderPart]:
        """The parts of a channel (`torque`) of one gear."""
        return [p for p in self.parts if p.column == column(channel) and p.gear == gear]

    def of_gear(self, gear: str) -> Remainder | None:
        """The remainder of one of several gears, as of a model with this gear alone."""
        own = tuple(replace(part, gear="") for part in self.parts if part.gear == gear)
        return replace(self, parts=own) if own else None

    @property
    def columns(self) -> list[str]:
        """Columns that have a remainder, each once."""
        return list(dict.fromkeys(part.column for part in self.parts))

    def as_settings(self) -> dict[str, Any]:
        """The table [remainder]; `take_remainder` reads the same back."""
        rows = {"rows": list(self.rows)} if self.rows else {}
        return {"format": FORMAT, **rows, "part": [settings_of(part) for part in self.parts]}

    def mean_and_std(
        self, channel: str, slip: Any, load: Any, gear: str = ""
    ) -> tuple[Floats, Floats]:
        """Mean and standard deviation (n,), in the channel's unit, at slips and loads (n,), N.

        Zero for a channel without a remainder. Parts are taken as independent.

        Examples
        --------
        >>> import numpy as np
        >>> part = RemainderPart(
        ...     "torque_Nm", 0.2, 0.1, 0.3, 0.6, (0.2, 0.2), (60.0, 60.0),
        ...     ((0.2, 60.0),), (1.5,), ((0.8,),), ((0.0,),))
        >>> mean, std = Remainder((part,)).mean_and_std("torque", [0.2, 0.5, 5.0], 60.0)
        >>> print(mean.round(3), std.round(3))
        [0.3   0.265 0.   ] [0.12  0.142 0.2  ]
        """
        slip, load = np.broadcast_arrays(np.asarray(slip, float), np.asarray(load, float))
        mean, variance = np.zeros(slip.shape), np.zeros(slip.shape)
        for part in self.of(channel, gear):
            own = part.mean_and_std(slip.ravel(), load.ravel())
            mean = mean + own[0].reshape(slip.shape)
            variance = variance + own[1].reshape(slip.shape) ** 2
        return mean, np.sqrt(variance)

    def process_columns(
        self, channel: str, slip: Floats, load: Floats, gear: str = "", *, fitted_anew: bool
    ) -> Floats:
        """Columns (n, q) whose products are the covariance at slips and loads (n,)."""
        own = [p.columns(slip, load, fitted_anew=fitted_anew) for p in self.of(channel, gear)]
        return np.concatenate([np.zeros((len(slip), 0)), *own], axis=1)

    def error_functions(
        self, channel: str, slip: tuple[float, float], load: tuple[float, float], gear: str = ""
    ) -> SmoothFunctions:
        """The error about the mean in these ranges (N), where soil and effects are fitted anew.

        Raises `ValueError` for a channel and gear without a remainder.
        """
        parts = [part.error_functions(slip, load) for part in self.of(channel, gear)]
        return SmoothFunctions.joined(parts)

    def added_to(self, force: Force, slip: Any, load: Any) -> Force:
        """Forces with the mean added to torque, drawbar pull and sinkage, of one gear."""
        slip, load = np.asarray(slip, dtype=np.float64), np.asarray(load, dtype=np.float64)
        mean = {n: self.mean_and_std(n, slip, load)[0] for n in CHANNELS if self.of(n)}
        return replace(force, **{n: getattr(force, n) + own for n, own in mean.items()})


def take_remainder(settings: Settings, gears: Iterable[str]) -> Remainder:
    """Read the table [remainder] of a model with these gears; none where there is one gear.

    Raises `InputError` for another version, an unknown column or gear, a number that is not finite,
    and for sizes that do not fit together.
    """
    version = settings.count("format")
    if version != FORMAT:
        settings.fail(f"format is {version}; this version of soilml reads {FORMAT}")
    parts = settings.tables("part")
    if not 1 <= len(parts) <= MOST_PARTS:
        settings.fail(f"{len(parts)} parts [[remainder.part]]; needed are 1 to {MOST_PARTS}")
    found = tuple(_take_part(part, tuple(gears)) for part in parts)
    rows = settings.take("rows", list, "a list of texts", [])
    if not all(isinstance(row, str) for row in rows):
        settings.fail("rows must be a list of texts")
    settings.finish()
    return Remainder(found, tuple(rows))


def _take_part(settings: Settings, gears: Sequence[str]) -> RemainderPart:
    part = take_declared(RemainderPart, settings)
    if part.gear not in (gears or ("",)):
        of = f"there are: {', '.join(gears)}" if gears else "this file has one, without a name"
        settings.fail(f"gear is {part.gear!r}; {of}")
    count = len(part.points)
    if not 1 <= count <= MOST_POINTS or any(len(p) != 2 or p[1] <= 0.0 for p in part.points):
        settings.fail(f"points must be 1 to {MOST_POINTS} pairs [slip, load_N]")
    for key in ("mean", "known", "shared"):
        rows: tuple[Any, ...] = getattr(part, key)
        if len(rows) != count:
            settings.fail(f"{key} has {len(rows)} rows; needed is one for each of {count} points")
        if key != "mean" and len({len(row) for row in rows}) > 1:
            settings.fail(f"the rows of {key} differ in length")
    if part._matrix("known").size and np.linalg.norm(part._matrix("known"), 2) > 1.0 + TOLERANCE:
        settings.fail("known is larger than 1: the variance would be negative")
    z = part.scaled(*np.asarray(part.points).T)
    if np.linalg.eigvalsh(squared_exponential(z, z))[0] < LEAST_PIVOT:
        settings.fail("points contains points that are too near each other")
    return part


def _marks(table: Table) -> set[str]:
    """Digests of the rows of a table, by slip, load and the readings of the channels."""
    names = [n for n in ("slip", "load_N", *map(column, CHANNELS)) if n in table]
    rows = zip(*(table[name] for name in names), strict=True)
    texts = (",".join(f"{v:.6g}" for v in row if math.isfinite(v)) for row in rows)
    return {hashlib.sha256(text.encode()).hexdigest()[:MARK_DIGITS] for text in texts}


def _smooth_columns(points: Floats, std: Floats) -> Floats:
    """Columns of a process of these standard deviations (n,); none where all are negligible."""
    if not np.any(std > TOLERANCE * max(float(std.max(initial=0.0)), 1e-300)):
        return np.zeros((len(points), 0))
    return process_columns(points, std)
