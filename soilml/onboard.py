"""The onboard runtime: one ONNX file in, estimates out. Needs numpy and onnxruntime, no more."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from soilml.errors import InputError, ModelFileError
from soilml.estimate import Driven, Estimate, Kind, Known, Together, answered
from soilml.features import readings

Floats = NDArray[np.float64]

#: Version of the file's contract: input and output names, metadata keys.
FORMAT = "2"
#: Keys of what the metadata says of what is driven, and of joining rows in each kind of run.
DRIVEN = ("lower", "upper", "std")
KIND = ("rows", "worth", "widening", "reach")
#: Half-width of the 90 % interval of an answer that is the prior, in its standard deviations.
GAUSSIAN_90 = 1.645
#: A run of which less than this share is in range is not estimated.
LEAST_SOUND = 0.9
#: Answers to the file's own probe may differ by this share of the prior.
PROBE_TOLERANCE = 1e-4


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
    prior: Known
    together: Together
    session: ort.InferenceSession

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Estimator:
        """Read and check a model file; raises `ModelFileError` for one that is not ours or damaged.

        Its checksums are compared, and its probe, readings with the answers that they must give, is
        run: that tests the runtime of this machine as well.
        """
        file = Path(path)
        content = _content(file)
        session, metadata = _session(file, content)
        if "soilml_format" not in metadata:
            raise ModelFileError(f"{file} is an ONNX model, but none that soilml train wrote")
        if metadata["soilml_format"] != FORMAT:
            raise ModelFileError(
                f"{file} has format {metadata['soilml_format']}, this soilml reads {FORMAT}"
            )
        if not _whole(content, metadata):
            raise ModelFileError(f"{file} is damaged: its checksum does not hold; export it again")
        try:
            inputs = json.loads(metadata["inputs"])
            outputs = json.loads(metadata["outputs"])
            probe = json.loads(metadata["probe"])
            _check_origin(metadata)
            estimator = Estimator(
                path=str(file),
                inputs=tuple(entry["name"] for entry in inputs),
                names=tuple(entry["name"] for entry in outputs),
                units=tuple(entry["unit"] for entry in outputs),
                per_row=tuple(e["name"] for e in outputs if e.get("per_row", False)),
                metadata=metadata,
                prior=Known(
                    *(_column(outputs, k) for k in ("prior_mean", "prior_std", "lower", "upper"))
                ),
                together=_together(json.loads(metadata["together"])),
                session=session,
            )
            answer = estimator(**probe["readings"])
            off = np.abs(answer.mean - np.asarray(probe["mean"])) / estimator.prior.std
            off = np.maximum(off, np.abs(answer.std - np.asarray(probe["std"])) / answer.prior_std)
            same = np.array_equal(answer.in_range, probe["in_range"])
        except (KeyError, TypeError, ValueError) as error:
            raise ModelFileError(f"{file}: its metadata is damaged ({error})") from None
        except Exception as error:  # onnxruntime raises many kinds, none with a public base
            raise ModelFileError(f"{file} cannot be run: {error}") from None
        if not (same and bool(np.all(off < PROBE_TOLERANCE))):
            raise ModelFileError(f"{file} fails its own probe on this machine: do not use it")
        return estimator

    def __call__(self, **measured: Any) -> Estimate:
        """Estimates from readings, each on its own; numbers or arrays that broadcast.

        Raises `InputError` for a reading that is missing, not finite or impossible.
        """
        flat, shape = readings(self.inputs, measured)
        with np.errstate(over="ignore", under="ignore"):  # beyond float32 is out of range
            feed = {n: a.astype(np.float32) for n, a in zip(self.inputs, flat, strict=True)}
        mean, std, covariance, in_range = self.session.run(
            ("mean", "std", "covariance", "in_range"), feed
        )
        q = len(self.names)
        return self._estimate(
            mean.astype(np.float64).reshape(*shape, q),
            covariance.astype(np.float64).reshape(*shape, q, q),
            std.astype(np.float64).reshape(*shape, q),
            in_range.reshape(shape),
            self.together.alone,
        )

    def run(self, **measured: Any) -> Estimate:
        """One estimate from all readings together: rows driven on one soil, arrays (rows,).

        Rows of nearly the same slip and load count as one. Rows out of range are left out, up to a
        tenth of them. Where there are more, or where the rows contradict each other as rows of one
        soil hardly ever do, `in_range` is false and the answer is the prior. Raises `InputError` as
        a call does, where there is no row, and where the rows of a run have no one value: slip.
        """
        if self.per_row:
            raise InputError(
                f"{self.path} estimates {self.per_row[0]}, which differs from row to row: rows of "
                "a run cannot be joined; estimate each by itself"
            )
        flat, _ = readings(self.inputs, measured)
        if flat[0].size == 0:
            raise InputError("no reading given; needed is one or more")
        measured = dict(zip(self.inputs, flat, strict=True))
        single = self(**measured)
        sound = single.in_range
        if sound.size == 1:
            parts = (single.mean[0], single.covariance[0], single.std[0], sound[0])
            return self._estimate(*parts, self.together.alone)
        if sound.sum() < LEAST_SOUND * sound.size:
            return self.unknown()
        rule = self.together.rule({name: values[sound] for name, values in measured.items()})
        joint = answered(single.mean[sound], single.covariance[sound], self.prior, rule)
        if bool((joint.doubt > self.together.doubt).any()):
            return self.unknown()
        std = np.sqrt(np.diag(joint.covariance))
        return self._estimate(joint.mean, joint.covariance, std, np.asarray(True), rule.reach)

    def unknown(self, *shape: int) -> Estimate:
        """What is known where nothing was measured: the prior, flagged as out of range."""
        prior, q = self.prior, len(self.names)
        mean, std = (np.broadcast_to(x, (*shape, q)).copy() for x in (prior.mean, prior.std))
        covariance = np.broadcast_to(np.diag(prior.std**2), (*shape, q, q)).copy()
        flag = np.zeros(shape, dtype=bool)
        return self._estimate(mean, covariance, std, flag, self.together.alone)

    def _estimate(
        self,
        mean: Floats,
        covariance: Floats,
        std: Floats,
        in_range: NDArray[np.bool_],
        reach: Floats,
    ) -> Estimate:
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


def checksum(metadata: Mapping[str, str]) -> str:
    """Hash of all metadata but the hash itself."""
    entries = sorted((k, v) for k, v in metadata.items() if k != "metadata_sha256")
    return hashlib.sha256(json.dumps(entries).encode()).hexdigest()


def behind(metadata: Mapping[str, str]) -> bytes:
    """The metadata as it stands behind the graph in the file: entries of field 14, by key."""
    found = b""
    for key, value in sorted(metadata.items()):
        entry = _field(1, key.encode()) + _field(2, value.encode())
        found += _field(14, entry)
    return found


def _field(number: int, content: bytes) -> bytes:
    """A field of a protobuf message: its number and wire type 2, its length, its content."""
    size, length = len(content), bytearray()
    while size > 127:
        length.append(size & 127 | 128)
        size >>= 7
    return bytes((number << 3 | 2, *length, size)) + content


def _whole(content: bytes, metadata: Mapping[str, str]) -> bool:
    """Whether the file is the graph and the metadata that were written, and not a byte more."""
    told = behind(metadata)
    graph = content.removesuffix(told)
    return (
        len(graph) + len(told) == len(content)
        and hashlib.sha256(graph).hexdigest() == metadata.get("graph_sha256")
        and checksum(metadata) == metadata.get("metadata_sha256")
    )


def _check_origin(metadata: Mapping[str, str]) -> None:
    """Raise where gear and recipe, which commands look into, are not as they are written."""
    gear, recipe = json.loads(metadata["gear"]), json.loads(metadata["recipe"])
    sizes = [float(gear[name]) for name in ("radius", "width") if name in gear]
    names = [str(effect["name"]) for effect in recipe.get("effect", [])]
    if not (isinstance(gear, dict) and all(size > 0.0 for size in sizes) and all(names)):
        raise ValueError("gear or recipe")


def _content(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise ModelFileError(f"{file}: there is no such file") from None
    except OSError as error:
        raise ModelFileError(f"{file} cannot be read: {error.strerror}") from None


def _session(file: Path, content: bytes) -> tuple[ort.InferenceSession, dict[str, str]]:
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = ort.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        return session, dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # onnxruntime raises many kinds, none with a public base
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(f"{file} is not a whole ONNX model: {first[:160]}") from None


def _together(said: dict[str, Any]) -> Together:
    driven = Driven(tuple(said["over"]), *(np.asarray(said[key], float) for key in DRIVEN))
    return Together(
        driven,
        tuple(
            Kind(tuple(kind["varies"]), *(np.asarray(kind[key], float) for key in KIND))
            for kind in said["kinds"]
        ),
        np.asarray(said["alone"], float),
        np.asarray(said["doubt"], float),
    )


def _column(entries: list[dict[str, Any]], key: str) -> Floats:
    return np.asarray([entry[key] for entry in entries], dtype=np.float64)
