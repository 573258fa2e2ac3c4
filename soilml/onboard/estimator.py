"""The onboard runtime: one ONNX file in, estimates out. Needs only numpy and onnxruntime."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from soilml.errors import InputError, ModelFileError
from soilml.onboard.estimate import Estimate, PriorSummary
from soilml.onboard.features import flatten_readings
from soilml.onboard.gaussian_pooling import PoolingCalibration, pool_run
from soilml.onboard.model_file import open_model, read_fields, read_prior, read_probe
from soilml.onboard.set_posterior import Memory, SetPosterior, without_copies

Floats = NDArray[np.float64]

#: Largest deviation of mean or std from the file's own probe, in prior standard deviations.
PROBE_TOLERANCE = 1e-4
#: The same for sets: a rounding difference can change which samples are drawn.
SET_PROBE_TOLERANCE = 0.05
#: Outputs of the graph for single readings.
ROW_OUTPUTS = ("mean", "std", "covariance", "in_range")


@final
@dataclass(frozen=True)
class Estimator:
    """A trained model: soil parameters, or slip, from readings of a wheel.

    Call it for readings each by itself; use `run` for all readings of one soil, and `start` and
    `step` for readings as they come.

    Attributes
    ----------
    inputs : tuple of str
        Quantities that a call reads.
    names, units : tuple of str
        Estimated quantities and their SI units.
    per_row : tuple of str
        Those of `names` that differ between rows of a run (slip); they cannot be pooled.
    metadata : dict of str to str
        Provenance, validity and figures of the file.
    prior : PriorSummary
        Prior of the estimated quantities.
    pooling : PoolingCalibration
        Calibration of Gaussian pooling, for files without a set posterior.
    sets : SetPosterior or None
        Posterior of several readings by their exact joint likelihood.
    """

    path: str
    inputs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    per_row: tuple[str, ...]
    metadata: dict[str, str]
    prior: PriorSummary
    pooling: PoolingCalibration
    sets: SetPosterior | None
    session: ort.InferenceSession

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Estimator:
        """Read and verify a model file.

        The checksums are compared, and the file's probe is run: readings with their known answers,
        which also tests the ONNX runtime of this machine.

        Raises `ModelFileError` for a file of another origin, a damaged one, or a failing probe.

        Examples
        --------
        >>> from soilml.onboard import Estimator
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> dict(zip(estimator.names, estimator.units))
        {'cohesion': 'Pa', 'friction_angle': 'rad', 'shear_modulus': 'm'}
        """
        file = Path(path)
        session, metadata = open_model(file)
        try:
            fields, probe = read_fields(metadata), read_probe(metadata)
            estimator = Estimator(str(file), metadata=metadata, session=session, **fields)
            passed = all(estimator._reproduces(**entry) for entry in probe)
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{file}: its metadata is damaged ({error})") from None
        except Exception as error:  # onnxruntime raises many kinds, none with a public base
            raise ModelFileError(f"{file} cannot be run: {error}") from None
        if not passed:
            raise ModelFileError(f"{file} fails its own probe on this machine: do not use it")
        return estimator

    def on(
        self, noise: Mapping[str, tuple[float, float]] | None = None, **given: float
    ) -> Estimator:
        """The same estimator for one wheel and bearing, where the file serves many wheels.

        Parameters
        ----------
        noise : mapping of str to (float, float), optional
            Replaces the file's own noise for sets: channel, or ``torque_bias``, to its constant
            part in SI units and its share of the reading.
        **given : float
            Wheel, bearing and ends of the prior in SI units, by the names of the file's card.

        Raises `InputError` for a name that the file does not take, or a value out of its range.
        """
        sets = (self.sets or SetPosterior(0, {}, {}, {}, False)).with_context(given, noise or {})
        return replace(self, sets=sets, prior=read_prior(self.metadata, sets.context_values))

    def __call__(self, **measured: Any) -> Estimate:
        """Estimates from readings, each by itself, with the broadcast shape of the readings.

        Parameters
        ----------
        **measured : float or array_like
            Every quantity in `inputs`, in SI units; arrays broadcast.

        Raises
        ------
        InputError
            For a reading that is missing, unknown, not finite or impossible.

        Examples
        --------
        >>> from soilml.onboard import Estimator
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> estimate = estimator(slip=[0.1, 0.3], torque=[1.2, 2.1], load=60.0)
        >>> estimate.mean.shape, estimate.covariance.shape
        ((2, 3), (2, 3, 3))
        >>> estimate.in_range
        array([ True,  True])
        """
        if self.sets is not None and self.sets.sets_only:
            return self._rows_as_sets(self.sets, measured)
        flat, shape = flatten_readings(self.inputs, measured)
        with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
            feed = {n: a.astype(np.float32) for n, a in zip(self.inputs, flat, strict=True)}
        mean, std, covariance, in_range = self.session.run(ROW_OUTPUTS, feed)
        q = len(self.names)
        return Estimate.gaussian(
            self.names,
            self.units,
            self.prior,
            mean.astype(np.float64).reshape(*shape, q),
            covariance.astype(np.float64).reshape(*shape, q, q),
            std.astype(np.float64).reshape(*shape, q),
            in_range.reshape(shape),
            self.pooling.single_row_coverage_factor,
        )

    def run(self, **measured: Any) -> Estimate:
        """One estimate from all readings (rows,) of one soil.

        Uses the set posterior where the file has one, otherwise `pooled`. Rows that repeat another
        in every reading count once. Rows out of range are left out, up to a tenth of them; where
        there are more, or where no soil of the prior is consistent with all rows, `in_range` is
        false and the estimate is the prior.

        Parameters
        ----------
        **measured : array_like, shape (rows,)
            Every quantity in `inputs`, in SI units. A set posterior also takes ``sinkage`` and
            ``drawbar_pull``, NaN in rows without them, and ``torque_std``, ``sinkage_std`` and
            ``drawbar_pull_std`` where the noise differs from that of the file.

        Raises
        ------
        InputError
            As for a call; also without any row, and where a target differs between rows (slip).

        Examples
        --------
        >>> from soilml.onboard import Estimator
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> estimate = estimator.run(
        ...     slip=[0.1, 0.2, 0.3, 0.5], torque=[1.6, 2.3, 2.7, 3.2], load=[60.0] * 4
        ... )
        >>> mean, std = estimate["friction_angle"]
        >>> f"{mean:.2f} +- {std:.2f} rad"
        '0.46 +- 0.02 rad'
        """
        if self.sets is not None:
            rows = without_copies(self._configured_sets.rows(measured))
            if rows["slip"].size == 0:
                raise InputError("no reading given; needed is one or more")
            return self._set_estimate(rows, self.start())[0]
        return self.pooled(**measured)

    def pooled(self, **measured: Any) -> Estimate:
        """The estimates of single readings (rows,) of one soil, pooled as Gaussians.

        This is what `run` gives for a file without a set posterior. It is far less certain than
        the exact joint likelihood of many readings.

        Raises `InputError` as `run` does, and for a file without estimates of single readings.
        """
        if self.sets is not None and self.sets.sets_only:
            raise InputError(f"{self.path} has no estimates of single readings to pool; use run")
        if self.per_row:
            raise InputError(
                f"{self.path} estimates {self.per_row[0]}, which differs from row to row: rows of "
                "a run cannot be pooled; estimate each by itself"
            )
        flat, _ = flatten_readings(self.inputs, measured)
        if flat[0].size == 0:
            raise InputError("no reading given; needed is one or more")
        rows = dict(zip(self.inputs, flat, strict=True))
        estimate = pool_run(self(**rows), rows, self.pooling)
        return self.prior_estimate() if estimate is None else estimate

    def rows_in_range(self, **measured: Any) -> NDArray[np.bool_]:
        """Whether each reading of a run lies in the training domain, (rows,)."""
        if self.sets is None:
            return np.atleast_1d(self(**measured).in_range)
        rows = self._configured_sets.rows(measured)
        return self.sets.rows_in_range(self.session, rows)

    def start(self) -> Memory:
        """The memory of a soil before its first reading; see `step`."""
        return self._configured_sets.start()

    def step(self, memory: Memory, **measured: Any) -> tuple[Estimate, Memory]:
        """The estimate from all readings so far, after one or more new ones, and the new memory.

        The order of the readings does not matter, and the memory does not grow with their number.

        Parameters
        ----------
        memory : Memory
            From `start`, or from the step before. One of another file raises `InputError`.
        **measured : float or array_like
            As for `run`.

        Examples
        --------
        >>> from soilml.onboard import Estimator
        >>> estimator = Estimator.load("exported/wheel.onnx")
        >>> memory = estimator.start()
        >>> for slip, torque in [(0.1, 1.6), (0.3, 2.7), (0.5, 3.2)]:
        ...     estimate, memory = estimator.step(memory, slip=slip, torque=torque, load=60.0)
        >>> memory.rows
        3
        """
        sets = self._configured_sets
        if not (isinstance(memory, Memory) and memory.system.shape[1] == sets.terms + 1):
            raise InputError("this memory is not of this file: begin with estimator.start()")
        return self._set_estimate(sets.rows(measured), memory)

    def prior_estimate(self, *shape: int) -> Estimate:
        """The prior as an estimate (*shape, q), flagged as out of range."""
        return Estimate.from_prior(self.names, self.units, self.prior, shape)

    @property
    def _configured_sets(self) -> SetPosterior:
        """The set posterior; raises `InputError` where it is missing or the wheel is not set."""
        if self.sets is None:
            raise InputError(f"{self.path} has no set posterior; train it with [set_posterior]")
        if missing := self.sets.missing_context:
            raise InputError(
                f"{self.path} is for many wheels: give {', '.join(missing)} first, by "
                "estimator.on(...)"
            )
        return self.sets

    def _set_estimate(self, rows: Mapping[str, Floats], memory: Memory) -> tuple[Estimate, Memory]:
        """Estimate and memory after these rows (m,)."""
        found, memory = self._configured_sets.update(self.session, rows, memory)
        mean, std, covariance, low, high = (np.asarray(x, np.float64) for x in found[:5])
        in_range = np.asarray(bool(found[5][0]))
        parts = (mean, std, covariance, low, high, in_range)
        return Estimate(self.names, self.units, *parts, self.prior), memory

    def _rows_as_sets(self, sets: SetPosterior, measured: Mapping[str, Any]) -> Estimate:
        """Every row as a set of its own."""
        rows = self._configured_sets.rows(measured)
        shape = np.broadcast_shapes(*(np.shape(value) for value in measured.values()))
        single = [{k: v[i : i + 1] for k, v in rows.items()} for i in range(rows["slip"].size)]
        return Estimate.stack([self._set_estimate(row, sets.start())[0] for row in single], shape)

    def _reproduces(
        self, readings: Any, mean: Any, std: Any, in_range: Any, given: Any = None
    ) -> bool:
        """Whether the answers to a probe agree with those stored in the file."""
        if given is None:
            answer, tolerance = self(**readings), PROBE_TOLERANCE
        else:
            answer, tolerance = self.on(**given).run(**readings), SET_PROBE_TOLERANCE
        deviations = np.abs(answer.mean - np.asarray(mean)), np.abs(answer.std - np.asarray(std))
        agree = all(bool(np.all(part < tolerance * answer.prior_std)) for part in deviations)
        return np.array_equal(answer.in_range, in_range) and agree
