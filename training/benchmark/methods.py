"""The methods compared: each maps the rows of one soil to an estimate with intervals."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import FitError
from soilml.identification import CLOSED_FORM, identify
from soilml.io.table import Table
from soilml.numerics.prior import Prior
from soilml.onboard.estimator import Estimator
from soilml.processes import FORKS, process_map
from soilml.quantities import CHANNELS, column

#: Label of the method that is the Bayes limit where the model that simulated the sets is given.
LIMIT = "analytic posterior"
LEAST = 8  # Fewest sets of a design that a slow method is scored on


@dataclass(frozen=True)
class Method:
    """A method: label, description of its inputs, and the channels that it reads.

    `estimate` maps the rows of one soil to (3, q): mean, ends of the 90 % interval; NaN where a
    parameter is not estimated. It raises `FitError` where it fails.
    """

    label: str
    inputs: str
    channels: tuple[str, ...]
    estimate: Callable[[Table], Floats]
    analytic: bool = False

    def estimate_sets(
        self,
        sets: Sequence[Table],
        q: int,
        progress: Callable[[int, int], None],
        seconds: float = np.inf,
    ) -> tuple[Floats, float]:
        """Estimates (n, 3, q) of the sets, NaN where it fails, and the mean seconds of one.

        Each is one call, as on board. Analytic methods, which are slow, run on all cores. After so
        many seconds further sets are left out, except of the first `LEAST`.
        """
        found, spent, started = [], 0.0, time.monotonic()
        workers = None if self.analytic and FORKS else 1
        with process_map(self._timed, sets, workers) as results:
            for estimate, duration in results:
                found.append(np.full((3, q), np.nan) if estimate is None else estimate)
                spent += duration
                progress(len(found), len(sets))
                if len(found) >= LEAST and time.monotonic() - started > seconds:
                    break
        return np.stack(found), spent / len(found)

    def _timed(self, rows: Table) -> tuple[Floats | None, float]:
        started = time.perf_counter()
        try:
            estimate = self.estimate(rows)
        except FitError:
            estimate = None
        return estimate, time.perf_counter() - started


def prior_method(priors: Sequence[Prior]) -> Method:
    """The prior alone, whatever is measured."""
    ends = np.stack([p.at(np.asarray([0.5, 0.05, 0.95])) for p in priors], axis=1)
    return Method("prior", "-", (), lambda rows: ends)


def model_file_method(label: str, estimator: Estimator) -> Method:
    """A model file by `Estimator.run`, and without a set posterior single rows by a plain call."""
    plain = estimator.sets is None or estimator.sets.sets_only

    def estimate(rows: Table) -> Floats:
        readings = {name: rows[column(name)] for name in estimator.inputs}
        if plain and len(rows) == 1:
            found = estimator(**{n: v[0] for n, v in readings.items()})
        else:
            found = estimator.run(**readings)
        return np.stack([found.mean, found.low, found.high])

    channels = tuple(n for n in estimator.inputs if n not in ("slip", "load"))
    return Method(label, ", ".join(estimator.inputs), channels, estimate)


def analytic_method(case: Case, name: str, names: Sequence[str]) -> Method:
    """An identification method; it reads sinkage only where its equations need it."""
    channels = ("torque", "sinkage") if name in CLOSED_FORM else ("torque",)
    hidden = {column(c) for c in CHANNELS if c not in channels}

    def estimate(rows: Table) -> Floats:
        seen = replace(rows, columns={k: v for k, v in rows.columns.items() if k not in hidden})
        fit = identify(case, seen, list(names), name)
        found = np.stack([fit.values, *fit.interval])
        found = np.where(np.isnan(found[0]), np.nan, found)
        missing = np.full(3, np.nan)
        columns = [found[:, fit.names.index(n)] if n in fit.names else missing for n in names]
        return np.stack(columns, axis=1)

    fixed = {"linear": "; K fixed", "newton": "; c fixed"}.get(name, "")
    inputs = ", ".join(["slip", "load", *channels]) + fixed
    return Method(f"analytic {name}", inputs, channels, estimate, analytic=True)
