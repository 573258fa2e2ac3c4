"""The onboard runtime: one ONNX file in, estimates out. Needs only numpy and onnxruntime."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NoReturn, final

import numpy as np

from soilml.errors import InputError
from soilml.onboard.estimate import Estimate
from soilml.onboard.exact_check import with_exact_check
from soilml.onboard.features import flatten_readings, without_copies
from soilml.onboard.gaussian_product import PriorSummary, gaussian_product
from soilml.onboard.held_out_errors import HeldOutErrors
from soilml.onboard.memory import Memory, check_memory, memory_identity
from soilml.onboard.metadata import read_fields, read_prior, read_probe
from soilml.onboard.model_file import Session, find_model, open_model, verified
from soilml.onboard.set_contract import (
    LEAST_SHARE_IN_RANGE,
    OPTIONAL_READINGS,
    REQUIRED_READINGS,
    Floats,
)
from soilml.onboard.set_posterior import SetPosterior, of_reason
from soilml.quantities import Z_90

NoiseModels = Mapping[str, tuple[float, float]]

READINGS = (*REQUIRED_READINGS, *OPTIONAL_READINGS)
ROW_OUTPUTS = ("mean", "std", "covariance", "in_range")  # Outputs of the graph for single readings
#: Rows fed to the graph at a time: bounds its working memory, which the runtime keeps.
ROWS_PER_CALL = 4096
#: Correlation of the errors of two rows of one soil. 90 % intervals of 4 to 40 rows of wheel_lssvm
#: and wheel_mlp then cover 85 (steady) to 97 % (varied) of 200 runs each. With 0.3 they cover from
#: 83 %; with 0.5 they cover from 85 % too, and the error of K from 12 varied rows is 7 % larger.
CORRELATION = 0.4
#: Largest deviation of mean or std from the file's own probe, in prior standard deviations.
PROBE_TOLERANCE = 1e-4
#: The same for sets: a rounding difference can change which samples are drawn.
SET_PROBE_TOLERANCE = 0.05


@final
@dataclass(frozen=True)
class Estimator:
    """A trained model: soil parameters, or slip, from readings of a wheel.

    Call it for readings each by itself; use `run` for all readings of one soil, and `start` and
    `step` for readings as they come. Tables and data frames are for `soilml.estimate`.

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
    coverage_factor : ndarray, shape (q,)
        Half-width of the 90 % interval of a single row, in its standard deviations.
    errors : HeldOutErrors or None
        Errors on rows that the file was not trained on, of a file of slip.
    sets : SetPosterior or None
        Posterior of several readings by their exact joint likelihood.
    """

    path: str
    inputs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    per_row: tuple[str, ...]
    metadata: dict[str, str] = field(repr=False)
    prior: PriorSummary
    coverage_factor: Floats = field(repr=False)
    errors: HeldOutErrors | None = field(repr=False)
    sets: SetPosterior | None = field(repr=False)
    session: Session = field(repr=False)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Estimator:
        """Read and verify a model file, by its path or the short name of a released one.

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
        if not isinstance(path, str | os.PathLike):
            raise InputError(f"path is a {type(path).__name__}; needed is the name of a model file")
        file = find_model(path)
        session, metadata = open_model(file)
        return verified(
            file,
            lambda: Estimator(str(file), session=session, **read_fields(metadata)),
            lambda found: all(found._reproduces(**entry) for entry in read_probe(metadata)),
        )

    def on(self, noise: NoiseModels | None = None, **given: float) -> Estimator:
        """The same estimator for one wheel and bearing, where the file serves many wheels.

        Parameters
        ----------
        noise : mapping of str to (float, float), optional
            Replaces the file's own noise for sets: channel, or ``torque_bias``, to its constant
            part in SI units and its share of the reading. Readings of torque with a constant part
            are corrected for it where the file takes their logarithm.
        **given : float
            Wheel, bearing and ends of the prior in SI units, by the names of the file's card; and
            standard deviations of errors that all readings share, by `COMMON_ERROR_INPUTS`.

        Raises `InputError` for a name that the file does not take, or a value out of its range.
        """
        if self.sets is None:
            raise InputError(f"{self.path} has no set posterior: it takes no wheel and no noise")
        sets = self.sets.with_context(given, {} if noise is None else noise)
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
            sets = self._configured_sets  # every row is a set of its own
            rows = sets.rows(measured)
            shape = np.broadcast_shapes(*map(np.shape, measured.values()))
            single = ({k: v[i : i + 1] for k, v in rows.items()} for i in range(rows["slip"].size))
            each = (self._set_estimate(row, sets.start())[0] for row in single)
            return Estimate.stack(each, shape)
        flat, shape = flatten_readings(self.inputs, measured)
        with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
            feed = dict(zip(self.inputs, np.array(flat, np.float32), strict=True))
        pieces = []
        for first in range(0, max(len(flat[0]), 1), ROWS_PER_CALL):
            part = {name: values[first : first + ROWS_PER_CALL] for name, values in feed.items()}
            pieces.append(self.session.run(ROW_OUTPUTS, part))
        joined = pieces[0] if len(pieces) == 1 else map(np.concatenate, zip(*pieces, strict=True))
        mean, std, covariance, in_range = joined
        q, load = len(self.names), dict(zip(self.inputs, flat, strict=True)).get("load")
        return Estimate.gaussian(
            self.names,
            self.units,
            self.prior,
            mean.astype(np.float64).reshape(*shape, q),
            covariance.astype(np.float64).reshape(*shape, q, q),
            std.astype(np.float64).reshape(*shape, q),
            in_range.reshape(shape),
            self.coverage_factor,
            self.errors,
            None if load is None else load.reshape(shape),
        )

    def run(self, **measured: Any) -> Estimate:
        """One estimate from all readings (rows,) of one soil.

        Uses the set posterior where the file has one; where no soil of the prior is consistent with
        all rows, `in_range` is false and the estimate is widened. Other files multiply their
        estimates of single rows as correlated Gaussians, which is far less certain than the joint
        likelihood of many rows. Rows that repeat another in every reading count once. Rows out of
        range are set aside (`rows_set_aside`); where they are more than half of the rows,
        `in_range` is false and the estimate is the prior.

        Parameters
        ----------
        **measured : array_like, shape (rows,)
            Every quantity in `inputs`, in SI units. A set posterior also takes ``sinkage`` and
            ``drawbar_pull``, NaN in rows without them, and ``torque_std``, ``sinkage_std`` and
            ``drawbar_pull_std`` where the noise is not the file's, ``slip_std`` and ``load_std``.
            A standard deviation of torque is taken as a share of the reading, from which it is to
            be computed. For a sensor whose noise has a constant part, give ``on`` the noise.

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
        '0.51 +- 0.07 rad'
        """
        if self.sets is not None:
            rows = self._configured_sets.rows(measured)
            rows = without_copies(rows, READINGS)
            if rows["slip"].size == 0:
                raise InputError("no reading given; needed is one or more")
            return self._set_estimate(rows, self.start())[0]
        if self.per_row:
            raise InputError(
                f"{self.path} estimates {self.per_row[0]}, which differs from row to row: rows of "
                "a run cannot be pooled; estimate each by itself"
            )
        flat, _ = flatten_readings(self.inputs, measured)
        rows = dict(zip(self.inputs, flat, strict=True))
        if flat[0].size == 0:
            raise InputError("no reading given; needed is one or more")
        return _product_of_rows(self(**without_copies(rows, self.inputs)))

    def start(self) -> Memory:
        """The memory of a soil before its first reading; see `step`."""
        return self._configured_sets.start(self.memory_id).sealed()

    @cached_property
    def memory_id(self) -> str:
        """Identity of its memories: file, wheel, bearing, prior and sensors' common errors."""
        of_set = {} if self.sets is None else self.sets.context_values | self.sets.common_errors
        return memory_identity(self.metadata, of_set)

    def step(self, memory: Memory, **measured: Any) -> tuple[Estimate, Memory]:
        """The estimate from all readings so far, after one or more new ones, and the new memory.

        The memory does not grow with the number of readings, and their order matters little. Errors
        of model and sensors are linear at the soil that is known when a row arrives.

        Parameters
        ----------
        memory : Memory
            From `start`, or from the step before. One of another file, wheel or prior, or one that
            has changed since, raises `InputError`.
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
        before = check_memory(memory, sets.columns, self.memory_id, self.path)
        estimate, memory = self._set_estimate(sets.rows(measured), before)
        return estimate, memory.packed(len(before.system)).sealed()

    def prior_estimate(self, *shape: int) -> Estimate:
        """The prior as an estimate of shape `shape` + (q,), flagged as out of range."""
        return Estimate.from_prior(self.names, self.units, self.prior, shape, self.errors)

    @cached_property
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
        """Estimate and memory after these rows (m,), with the check against the exact model."""
        estimate, memory = self.joint_estimate(rows, memory)
        return with_exact_check(estimate, self._configured_sets, self.session, memory), memory

    def joint_estimate(self, rows: Mapping[str, Floats], memory: Memory) -> tuple[Estimate, Memory]:
        """Estimate after row inputs of the graph (m,), and the memory, neither packed nor sealed.

        Raises `InputError` for a file without a set posterior.
        """
        sets = self._configured_sets
        found, memory = sets.update(self.session, rows, memory)
        mean, std, covariance, low, high = (x.astype(np.float64) for x in found[:5])
        in_range, (_, count, used) = bool(found[5][0]), memory.counts.tolist()
        estimate = Estimate(
            *(self.names, self.units, mean, std, covariance, low, high, np.asarray(in_range)),
            self.prior,
            misfit=np.asarray(float(found[6][0])),
            rows_used=np.asarray(int(used)),
            rows_set_aside=np.asarray(int(count - used)),
            reason=np.asarray(int(of_reason(in_range, memory, sets.least_share_in_range))),
        )
        return estimate, memory

    def __deepcopy__(self, memo: object = None) -> Estimator:
        """The estimator itself, which nothing changes."""
        return self

    __copy__ = __deepcopy__

    def __reduce__(self) -> NoReturn:
        """Raise `InputError`: the session of the runtime belongs to this process."""
        raise InputError(
            "an Estimator cannot be pickled: hand over its path, and load it by Estimator.load"
        )

    def _reproduces(
        self, readings: Any, mean: Any, std: Any, in_range: Any, given: Any = None
    ) -> bool:
        """Whether the answers to readings agree with those stored in the file.

        With context inputs `given`, which may be none, the readings are a set.
        """
        if given is None:
            answer, tolerance = self(**readings), PROBE_TOLERANCE
        else:
            configured = self.on(**given) if given else self
            answer, tolerance = configured.run(**readings), SET_PROBE_TOLERANCE
        deviations = np.abs(answer.mean - np.asarray(mean)), np.abs(answer.std - np.asarray(std))
        agree = all(bool(np.all(part < tolerance * answer.prior_std)) for part in deviations)
        return np.array_equal(answer.in_range, in_range) and agree


def _product_of_rows(single: Estimate) -> Estimate:
    r"""One estimate from those of the m rows of a soil, each by itself, (m,).

    Rows whose errors have the correlation :math:`\rho` are worth
    :math:`m / (1 + (m - 1) \rho)` independent ones. The answer is the prior where more than half of
    the rows are out of range.
    """
    valid, prior = single.in_range, single.prior
    if valid.size == 1:
        return single.at(0)
    used, head = int(valid.sum()), (single.names, single.units, prior)
    found = Estimate.from_prior(*head)
    if used >= LEAST_SHARE_IN_RANGE * valid.size:
        weight = 1.0 / (1.0 + (used - 1) * CORRELATION)
        mean, covariance = gaussian_product(
            single.mean[valid], single.covariance[valid], prior, weight
        )
        std, factor = np.sqrt(np.diag(covariance)), np.full(len(prior.std), Z_90)
        mean = np.clip(mean, prior.lower, prior.upper)
        found = Estimate.gaussian(*head, mean, covariance, std, np.asarray(True), factor)
    aside = np.asarray(valid.size - used)
    return replace(found, rows_used=np.asarray(used), rows_set_aside=aside)
