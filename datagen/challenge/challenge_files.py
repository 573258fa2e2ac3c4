"""The files of a challenge: what is public, what is sealed, and entries, each checked as read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.errors import InputError, did_you_mean
from soilml.io.bounds import JSON_BYTES
from soilml.quantities import CHANNELS, column

#: Written to every file, so that another kind of JSON file is refused.
FORMAT = "soilml-challenge-1"
CHALLENGE_FILE = "challenge.json"
#: Answers beside the names of the catalogue: nothing is missing; something that is not listed.
NONE, UNKNOWN = "none", "unknown"
#: Smallest probability of a cause in an entry: the logarithmic score of zero is infinite. Within
#: this bound the score stays strictly proper.
LEAST_PROBABILITY = 1e-4
#: Largest difference of the sum of probabilities from one: they may be rounded to six digits.
SUM_TOLERANCE = 1e-4
LEAST_DRAWS = 20
COLUMNS = tuple(column(name) for name in CHANNELS)


def digest(content: bytes) -> str:
    """SHA-256 of a file's bytes, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def read_json(path: Path, what: str) -> tuple[dict[str, Any], bytes]:
    """A JSON object of `FORMAT`, and the bytes of its file; raises `InputError`."""
    try:
        JSON_BYTES.check(path, path.stat().st_size)
        content = path.read_bytes()
        found = json.loads(content)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; needed is {what}") from None
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not JSON ({error}); needed is {what}") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(f'{path} has no "format": "{FORMAT}"; needed is {what}')
    return found, content


@dataclass(frozen=True)
class Challenge:
    """What entrants get: a folder for each set, and `challenge.json`.

    `name` are the first digits of the SHA-256 of the truth, which `truth_sha256` publishes.
    `causes` are all answers that may be given a probability; `rows` the number of rows kept back,
    by set.
    """

    folder: Path
    name: str
    truth_sha256: str
    causes: tuple[str, ...]
    rows: Mapping[str, int]

    @staticmethod
    def read(folder: Path) -> Challenge:
        """Read `challenge.json` of a folder; raises `InputError`."""
        path = folder / CHALLENGE_FILE
        content, _ = read_json(path, "the folder that `soilml challenge make` wrote")
        try:
            rows = {str(name): int(own["rows"]) for name, own in content["sets"].items()}
            sha256, causes = str(content["truth_sha256"]), tuple(map(str, content["causes"]))
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path} lacks an entry or has a wrong one: {error}") from None
        return Challenge(folder, sha256[:16], sha256, causes, rows)


@dataclass(frozen=True)
class Truth:
    """What is sealed: the answer, the readings kept back and the noise, of each set.

    `answer` is a member of `Challenge.causes`; `readings` (rows, channels) in the order of
    `COLUMNS`; `noise` (channels,) the unit of predictive scores, the median of the declared
    standard deviations of the runs.
    """

    answer: Mapping[str, str]
    readings: Mapping[str, Floats]
    noise: Mapping[str, Floats]

    @staticmethod
    def read(path: Path, challenge: Challenge) -> Truth:
        """Read the truth of a challenge; raises `InputError` where it or the sets were changed."""
        content, raw = read_json(path, "the file that `soilml challenge make --truth` wrote")
        if digest(raw) != challenge.truth_sha256:
            raise InputError(
                f"{path} is not the truth of {challenge.folder}: its SHA-256 is "
                f"{digest(raw)[:16]}..., published is {challenge.truth_sha256[:16]}...; it was "
                "changed, or belongs to another challenge"
            )
        for name, known in content["files"].items():
            file = challenge.folder / name
            if not file.is_file() or digest(file.read_bytes()) != known:
                raise InputError(f"{file} is missing or was changed since the challenge was made")
        if tuple(content["causes"]) != challenge.causes or set(content["sets"]) != set(
            challenge.rows
        ):
            raise InputError(f"{challenge.folder / CHALLENGE_FILE} was changed: causes or sets")
        sets = content["sets"].items()
        return Truth(
            {name: own["answer"] for name, own in sets},
            {n: np.column_stack([own["readings"][c] for c in COLUMNS]) for n, own in sets},
            {n: np.asarray([own["noise"][c] for c in COLUMNS]) for n, own in sets},
        )


@dataclass(frozen=True)
class Entry:
    """An entry: probabilities of all causes, and draws (d, rows, channels) of the rows kept back.

    Both by set; probabilities in the order of `Challenge.causes`, channels in that of `COLUMNS`.
    """

    name: str
    probabilities: Mapping[str, Floats]
    draws: Mapping[str, Floats]

    @staticmethod
    def read(path: Path, challenge: Challenge) -> Entry:
        """Read and check an entry; raises `InputError` with set, entry and what is needed."""
        content, _ = read_json(path, "an entry as README.md of the challenge describes it")
        if content.get("challenge") != challenge.name:
            raise InputError(
                f"{path} is for challenge {content.get('challenge')!r}; that of "
                f"{challenge.folder} is {challenge.name!r}"
            )
        sets = _members(content.get("sets"), list(challenge.rows), f'{path}: "sets"')
        probabilities, draws = {}, {}
        for name, rows in challenge.rows.items():
            where = f"{path}, set {name}"
            own = _members(sets[name], ["causes", "draws"], where)
            probabilities[name] = _probabilities(own["causes"], challenge.causes, where)
            draws[name] = _draws(own["draws"], rows, where)
        return Entry(str(content.get("name") or path.stem), probabilities, draws)

    def as_json(self, challenge: Challenge) -> dict[str, Any]:
        """The content of the entry's file; draws have six digits, which noise exceeds by far."""
        return {
            "format": FORMAT,
            "challenge": challenge.name,
            "name": self.name,
            "sets": {
                name: {
                    "causes": dict(zip(challenge.causes, p.round(9).tolist(), strict=True)),
                    "draws": {
                        c: [[float(f"{x:.6g}") for x in one] for one in self.draws[name][..., i]]
                        for i, c in enumerate(COLUMNS)
                    },
                }
                for name, p in self.probabilities.items()
            },
        }


def _members(value: Any, needed: Sequence[str], where: str) -> dict[str, Any]:
    """An object with exactly these members."""
    if not isinstance(value, dict):
        raise InputError(f"{where} is no object; needed is one with {', '.join(needed)}")
    for name in needed:
        if name not in value:
            raise InputError(f"{where}: {name} is missing")
    for name in value:
        if name not in needed:
            hint = did_you_mean(name, needed)
            raise InputError(f"{where}: no {name!r} is known; {hint}needed are {', '.join(needed)}")
    return value


def _probabilities(value: Any, causes: Sequence[str], where: str) -> Floats:
    named = _members(value, causes, f"{where}: causes")
    found = _numbers([named[cause] for cause in causes], f"{where}: causes")
    low = int(np.argmin(found))
    if found[low] < LEAST_PROBABILITY:
        raise InputError(
            f"{where}: the probability of {causes[low]} is {found[low]:.3g}; needed is at least "
            f"{LEAST_PROBABILITY:g}, since the logarithm of zero has no score"
        )
    if abs(found.sum() - 1.0) > SUM_TOLERANCE:
        raise InputError(f"{where}: the probabilities of causes sum to {found.sum():.6g}, not to 1")
    return np.asarray(found / found.sum())


def _draws(value: Any, rows: int, where: str) -> Floats:
    named = _members(value, COLUMNS, f"{where}: draws")
    shape = f"needed are {LEAST_DRAWS} or more draws of {rows} rows"
    parts: list[Floats] = []
    for name in COLUMNS:
        part = _numbers(named[name], f"{where}: {name}")
        if part.ndim != 2 or part.shape[1] != rows or part.shape[0] < LEAST_DRAWS:
            raise InputError(f"{where}: {name} has the shape {part.shape}; {shape}")
        if parts and part.shape != parts[0].shape:
            raise InputError(f"{where}: {name} has another number of draws than {COLUMNS[0]}")
        parts.append(part)
    return np.stack(parts, axis=-1)


def _numbers(value: Any, where: str) -> Floats:
    """Finite numbers of equal rows; raises `InputError`."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise InputError(f"{where}: the draws differ in their number of rows") from None
    if array.dtype.kind not in "if":
        raise InputError(f"{where}: something is not a number")
    if not np.isfinite(array).all():
        raise InputError(f"{where}: a value is NaN or infinite; needed are finite numbers")
    return array.astype(np.float64)
