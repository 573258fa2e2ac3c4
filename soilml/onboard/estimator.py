"""The onboard runtime: one ONNX file in, estimates out. Needs numpy and onnxruntime, no more."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from soilml.errors import InputError, ModelFileError
from soilml.onboard.estimate import Estimate, PoolingCalibration, PriorSummary
from soilml.onboard.features import readings
from soilml.onboard.gaussian_pooling import pooled_run
from soilml.onboard.model_file import check_origin, numbers, opened, together_of
from soilml.onboard.set_posterior import Memory, SetPosterior, without_copies

Floats = NDArray[np.float64]

#: Half-width of the 90 % interval of an answer that is the prior, in its standard deviations.
GAUSSIAN_90 = 1.645
#: Answers to the file's own probe may differ by this share of the prior.
PROBE_TOLERANCE = 1e-4
#: The same of a set: its samples are drawn anew where a rounding tips the scales.
SET_TOLERANCE = 0.05
#: What the graph answers for single readings.
ROW_OUTPUTS = ("mean", "std", "covariance", "in_range")


@final
@dataclass(frozen=True)
class Estimator:
    """A trained model, loaded and checked.

    estimator = Estimator.load("exported/wheel.onnx")
    estimate = estimator(slip=0.3, torque=2.1, load=60.0)
    estimate.mean, estimate.std, estimate.covariance, estimate.in_range
    """

    path: str
    inputs: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    per_row: tuple[str, ...]  # those of the names that differ from row to row of a run
    metadata: dict[str, str]
    prior: PriorSummary
    together: PoolingCalibration
    sets: SetPosterior | None
    session: ort.InferenceSession

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Estimator:
        """Read and check a model file; raises `ModelFileError` for one that is not ours or damaged.

        Its checksums are compared, and its probe, readings with the answers that they must give, is
        run: that tests the runtime of this machine as well.
        """
        file = Path(path)
        session, metadata = opened(file)
        try:
            inputs = json.loads(metadata["inputs"])
            outputs = json.loads(metadata["outputs"])
            probe = json.loads(metadata["probe"])
            check_origin(metadata)
            estimator = Estimator(
                path=str(file),
                inputs=tuple(entry["name"] for entry in inputs),
                names=tuple(entry["name"] for entry in outputs),
                units=tuple(entry["unit"] for entry in outputs),
                per_row=tuple(e["name"] for e in outputs if e.get("per_row", False)),
                metadata=metadata,
                prior=PriorSummary(
                    *(numbers(outputs, k) for k in ("prior_mean", "prior_std", "lower", "upper"))
                ),
                together=together_of(json.loads(metadata["together"])),
                sets=SetPosterior.of(json.loads(metadata["set"])) if "set" in metadata else None,
                session=session,
            )
            if not (isinstance(probe, list) and probe):
                raise ValueError("no probe")
            sound = all(estimator._holds(**entry) for entry in probe)
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{file}: its metadata is damaged ({error})") from None
        except Exception as error:  # onnxruntime raises many kinds, none with a public base
            raise ModelFileError(f"{file} cannot be run: {error}") from None
        if not sound:
            raise ModelFileError(f"{file} fails its own probe on this machine: do not use it")
        return estimator

    def on(
        self, noise: Mapping[str, tuple[float, float]] | None = None, **given: float
    ) -> Estimator:
        """The same for one wheel on one kind of ground, where the file serves many.

        `noise` replaces the file's own for sets: channel, or torque_bias, -> its constant part and
        its share of the reading. Raises `InputError` for what the file does not take, or is not
        for.
        """
        sets = (self.sets or SetPosterior(0, {}, {}, {}, False)).with_context(given, noise or {})
        outputs = json.loads(self.metadata["outputs"])
        scale = np.asarray(
            [sets.context_values.get(entry.get("scale", ""), 1.0) for entry in outputs]
        )
        unit = [numbers(outputs, k) for k in ("prior_mean", "prior_std", "lower", "upper")]
        return replace(self, sets=sets, prior=PriorSummary(*(scale * end for end in unit)))

    def __call__(self, **measured: Any) -> Estimate:
        """Estimates from readings, each on its own; numbers or arrays that broadcast.

        Raises `InputError` for a reading that is missing, not finite or impossible.
        """
        if self.sets is not None and self.sets.sets_only:
            return self._one_by_one(self.sets, measured)
        flat, shape = readings(self.inputs, measured)
        with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
            feed = {n: a.astype(np.float32) for n, a in zip(self.inputs, flat, strict=True)}
        mean, std, covariance, in_range = self.session.run(ROW_OUTPUTS, feed)
        q = len(self.names)
        return self.estimate(
            mean.astype(np.float64).reshape(*shape, q),
            covariance.astype(np.float64).reshape(*shape, q, q),
            std.astype(np.float64).reshape(*shape, q),
            in_range.reshape(shape),
            self.together.alone,
        )

    def run(self, **measured: Any) -> Estimate:
        """One estimate from all readings together: rows driven on one soil, arrays (rows,).

        Beside slip, torque and load, sinkage and drawbar_pull may be given, NaN in rows that lack
        them, and torque_std, sinkage_std, drawbar_pull_std where the file's own noise does not
        hold. Rows that repeat another in every reading count once. Rows out of range are left out,
        up to a tenth of them; where there are more, or where no soil explains the rows together,
        `in_range` is false and the answer is the prior. Raises `InputError` as a call does, where
        there is no row, and where the rows of a run have no one value: slip.
        """
        if self.sets is not None:
            rows = without_copies(self._ready.rows(measured))
            if rows["slip"].size == 0:
                raise InputError("no reading given; needed is one or more")
            return self._answered(rows, self.start())[0]
        return self.joined(**measured)

    def joined(self, **measured: Any) -> Estimate:
        """The estimates of single readings, joined as Gaussians: what `run` is without sets.

        Far from the best that many readings allow. Raises `InputError` as `run` does, and for a
        file that has no estimates of single readings.
        """
        if self.sets is not None and self.sets.sets_only:
            raise InputError(f"{self.path} has no estimates of single readings to join; take run")
        if self.per_row:
            raise InputError(
                f"{self.path} estimates {self.per_row[0]}, which differs from row to row: rows of "
                "a run cannot be joined; estimate each by itself"
            )
        flat, _ = readings(self.inputs, measured)
        if flat[0].size == 0:
            raise InputError("no reading given; needed is one or more")
        return pooled_run(self, dict(zip(self.inputs, flat, strict=True)))

    def inside(self, **measured: Any) -> NDArray[np.bool_]:
        """Which of the readings of a run, (rows,), lie where the file was trained."""
        if self.sets is None:
            return np.atleast_1d(self(**measured).in_range)
        rows = self._ready.rows(measured)
        return self.sets.rows_in_range(self.session, rows)

    def start(self) -> Memory:
        """The memory of a soil of which nothing was measured yet."""
        return self._ready.start()

    def step(self, memory: Memory, **measured: Any) -> tuple[Estimate, Memory]:
        """The estimate after one more reading, or several, and the memory to go on with.

        The order of readings changes nothing, and the memory does not grow with their number.
        Raises `InputError` as `run` does.
        """
        sets = self._ready
        if not (isinstance(memory, Memory) and memory.system.shape[1] == sets.terms + 1):
            raise InputError("this memory is not of this file: begin with estimator.start()")
        return self._answered(sets.rows(measured), memory)

    @property
    def _ready(self) -> SetPosterior:
        if self.sets is None:
            raise InputError(f"{self.path} has no set posterior; train it with [set_posterior]")
        if missing := self.sets.missing_context:
            raise InputError(
                f"{self.path} is for many wheels: give {', '.join(missing)} first, by "
                "estimator.on(...)"
            )
        return self.sets

    def _answered(self, rows: Mapping[str, Floats], memory: Memory) -> tuple[Estimate, Memory]:
        """Estimate and memory after these rows (m,)."""
        found, memory = self._ready.update(self.session, rows, memory)
        mean, std, covariance, low, high = (np.asarray(x, np.float64) for x in found[:5])
        sound = np.asarray(bool(found[5][0]))
        parts = (mean, std, covariance, low, high, sound)
        return Estimate(self.names, self.units, *parts, self.prior), memory

    def _one_by_one(self, sets: SetPosterior, measured: Mapping[str, Any]) -> Estimate:
        """Every row as a set of its own."""
        rows = self._ready.rows(measured)
        shape = np.broadcast_shapes(*(np.shape(value) for value in measured.values()))
        single = [{k: v[i : i + 1] for k, v in rows.items()} for i in range(rows["slip"].size)]
        found = [self._answered(row, sets.start())[0] for row in single]
        parts = {
            key: np.reshape(
                [getattr(e, key) for e in found], (*shape, *getattr(found[0], key).shape)
            )
            for key in ("mean", "std", "covariance", "low", "high", "in_range")
        }
        return Estimate(names=self.names, units=self.units, prior=self.prior, **parts)

    def _holds(self, readings: Any, mean: Any, std: Any, in_range: Any, given: Any = None) -> bool:
        """Whether the readings of a probe are answered as they were where the file was made."""
        if given is None:
            answer, most = self(**readings), PROBE_TOLERANCE
        else:
            answer, most = self.on(**given).run(**readings), SET_TOLERANCE
        off = np.abs(answer.mean - np.asarray(mean)), np.abs(answer.std - np.asarray(std))
        same = np.array_equal(answer.in_range, in_range)
        return same and all(bool(np.all(part < most * answer.prior_std)) for part in off)

    def unknown(self, *shape: int) -> Estimate:
        """What is known where nothing was measured: the prior, flagged as out of range."""
        prior, q = self.prior, len(self.names)
        mean, std = (np.broadcast_to(x, (*shape, q)).copy() for x in (prior.mean, prior.std))
        covariance = np.broadcast_to(np.diag(prior.std**2), (*shape, q, q)).copy()
        flag = np.zeros(shape, dtype=bool)
        return self.estimate(mean, covariance, std, flag, self.together.alone)

    def estimate(
        self,
        mean: Floats,
        covariance: Floats,
        std: Floats,
        in_range: NDArray[np.bool_],
        reach: Floats,
    ) -> Estimate:
        """An Estimate whose interval reaches so many standard deviations, inside the prior."""
        half = np.where(in_range[..., None], reach, GAUSSIAN_90) * std
        return Estimate(
            names=self.names,
            units=self.units,
            mean=mean,
            std=std,
            covariance=covariance,
            low=np.clip(mean - half, self.prior.lower, self.prior.upper),
            high=np.clip(mean + half, self.prior.lower, self.prior.upper),
            in_range=in_range,
            prior=self.prior,
        )
