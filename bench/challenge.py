"""A challenge of blind sets: name their hidden causes, and predict rows that were kept back.

    python bench/challenge.py make FOLDER TRUTH.json           sets for entrants, and their truth
    python bench/challenge.py score FOLDER TRUTH.json ENTRY.json ...

The truth has a random salt, and its SHA-256 is in the folder, so that nobody finds it by trial, and
nobody changes it later. An entry is a JSON file: for each set `causes`, a probability of each cause
in `challenge.json`, and `draws` of the rows in `held_out.csv`, by channel.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from runner import Row, table, with_error

from datagen.blind_sets import BlindSet, Plan, csv_text, draw_blind_set
from datagen.blind_sets.plans import TIERS_WITHOUT_MECHANISM, benchmark_plans
from datagen.blind_sets.reading_errors import Sensor
from datagen.blind_sets.soil_families import RADIUS, WIDTH
from soilml.errors import InputError
from soilml.physics.effects import EFFECTS
from soilml.physics.gears import Wheel
from soilml.quantities import CHANNELS, column

COLUMNS = tuple(column(name) for name in CHANNELS)
#: Answers beside the names of the catalogue: nothing is missing; something that is not listed.
NONE, UNKNOWN = "none", "unknown"
#: Tiers that have one right answer. Two causes together (M) and changing soils (T) have several.
TIERS = ("A", "B", "C", "S", "L", "D", "N0", "N1")
#: Causes outside the catalogue that one of its effects describes too: two answers are right.
AMBIGUOUS = ("stiff-layer",)
WHEEL = Wheel(radius=RADIUS, width=WIDTH)
#: All answers that may be given a probability.
CAUSES = (NONE, UNKNOWN, *(n for n, e in EFFECTS.items() if e.applies_to(WHEEL)))
SETS = 24
#: Smallest probability of a cause, since the logarithmic score of zero is infinite; fewest draws.
LEAST_PROBABILITY, SUM_TOLERANCE, LEAST_DRAWS = 1e-4, 1e-4, 20


def plans(secret: str) -> Iterator[tuple[Plan, BlindSet]]:
    """Plans of the benchmark, of equally likely tiers that have one right answer."""
    number = 0
    while True:
        bits = hashlib.sha256(f"{secret} {number}".encode()).digest()[:16]
        number += 1
        seed = int.from_bytes(bits, "big")
        of_tier = [
            plan
            for plan in benchmark_plans(seed)
            if (plan.design, plan.tier) == ("sweep", TIERS[seed % len(TIERS)])
            and plan.cause not in AMBIGUOUS
        ]
        plan = of_tier[seed // len(TIERS) % len(of_tier)]
        try:
            yield plan, draw_blind_set(plan)
        except RuntimeError:  # no soil of the family carries all rows
            continue


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def public_files(drawn: BlindSet) -> dict[str, str]:
    """Runs, model and operating points of the rows kept back; no reading of these.

    Times are left out: they are there in some tiers alone, which they would reveal.
    """
    runs = {name: values for name, values in drawn.columns.items() if name != "time_s"}
    given = [name for name in runs if name not in COLUMNS]
    held = {name: np.concatenate([drawn.between[name], drawn.region[name]]) for name in given}
    elapsed = [drawn.truth["between_elapsed"], drawn.truth["region_elapsed"]]
    held["progress"] = np.concatenate(elapsed)
    files = {"runs.csv": csv_text(runs), "held_out.csv": csv_text(held)}
    return files | {"model.toml": drawn.model}


def truth_of(plan: Plan, drawn: BlindSet) -> Row:
    """The right answer, readings kept back (rows, channels), and the unit of their scores.

    The answer is the hidden cause by its name in the catalogue, `none` or `unknown`. Noise, scatter
    of the soil and faults of readings (tiers N) are `none`: the model is right. A smooth error of
    the model alone (tier D), and causes that the catalogue lacks, are `unknown`. The unit, the
    median noise of the runs, is known before a reading is, so that the score stays proper.
    """
    if plan.tier in TIERS_WITHOUT_MECHANISM:
        answer = UNKNOWN if plan.tier == "D" else NONE
    else:
        (name,) = (cause["name"] for cause in drawn.truth["causes"])
        answer = name if name in EFFECTS else UNKNOWN
    kept = [np.concatenate([drawn.between[c], drawn.region[c]]) for c in COLUMNS]
    sensors = [Sensor(**drawn.truth["noise"]["declared"][c]) for c in COLUMNS]
    noise = [np.median(s.std(drawn.columns[c])) for s, c in zip(sensors, COLUMNS, strict=True)]
    return {"answer": answer, "readings": np.column_stack(kept).tolist(), "noise": noise}


def crps(draws: Any, reading: Any) -> Any:
    r"""Continuous ranked probability score of draws (d, ...) for readings (...), in their unit.

    .. math::
        \frac{1}{d} \sum_i |x_i - y| - \frac{1}{2 d (d - 1)} \sum_{i, j} |x_i - x_j|

    With d - 1 in place of d the expectation does not depend on the number of draws; it may then
    be slightly negative.

    References: Gneiting and Raftery, Strictly proper scoring rules, prediction, and estimation,
    JASA 102, 2007, eq. 21; Ferro, Fair scores for ensemble forecasts, Q. J. R. Meteorol. Soc. 140,
    2014.
    """
    count = len(draws)
    weight = 2.0 * np.arange(1, count + 1) - count - 1.0
    spread = np.tensordot(weight, np.sort(draws, axis=0), axes=1) / (count * (count - 1))
    return np.abs(draws - reading).mean(axis=0) - spread


def scores(probabilities: Any, draws: Any, truth: Row) -> Row:
    """Scores of a set: of the cause, and of each channel."""
    ranked = crps(np.asarray(draws), np.asarray(truth["readings"])).mean(axis=0) / truth["noise"]
    cause = np.log(probabilities[CAUSES.index(truth["answer"])])
    return {"causes, ln p": cause} | dict(zip(CHANNELS, ranked, strict=True))


def tables(rows: list[Row]) -> str:
    """Scores of each entry with standard errors over sets, and differences to the first one.

    The logarithm of the probability of the right cause is better the higher it is; the ranked score
    of readings kept back, in units of the noise, the lower.
    """
    columns = {name: with_error(name) for name in ("causes, ln p", *CHANNELS)}
    first = {r["number"]: r for r in rows if r["entry"] == rows[0]["entry"]}
    others = [
        row | {name: row[name] - first[row["number"]][name] for name in columns}
        for row in rows
        if row["entry"] != rows[0]["entry"]
    ]
    found = f"{len(first)} sets.\n\n{table(rows, {'entry': 'entry'}, columns)}"
    words = f"\n\nDifferences to {rows[0]['entry']}, paired by set.\n\n"
    return found + (words + table(others, {"entry": "entry"}, columns) if others else "")


def make(folder: Path, sealed: Path, count: int = SETS) -> None:
    """Write a folder for entrants, and the file of the truth, which stays with its maker."""
    if folder.exists() or sealed.exists() or sealed.resolve().is_relative_to(folder.resolve()):
        raise InputError(f"{folder} and {sealed} must be new, and the truth outside the folder")
    sets, files = {}, {}
    drawn = plans(secrets.token_hex(32))
    for number, (plan, one) in zip(range(count), drawn, strict=False):
        name = f"s{number + 1:02d}"
        files |= {f"{name}/{file}": text for file, text in public_files(one).items()}
        sets[name] = {"answer": "", **truth_of(plan, one)}
    checks = {name: digest(text.encode()) for name, text in files.items()}
    content = {"salt": secrets.token_hex(32), "files": checks, "sets": sets}
    truth = json.dumps(content)
    public = {"truth_sha256": digest(truth.encode()), "causes": CAUSES, "sets": list(sets)}
    files["challenge.json"] = json.dumps(public, indent=1)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    sealed.write_text(truth, encoding="utf-8")


def score(folder: Path, sealed: Path, entries: Sequence[Path]) -> str:
    """The tables of some entries.

    Raises `InputError` where the truth or a file of the folder was changed, or an entry is wrong.
    """
    raw = sealed.read_bytes()
    public, truth = json.loads((folder / "challenge.json").read_text()), json.loads(raw)
    if digest(raw) != public["truth_sha256"]:
        raise InputError(f"{sealed} is not the truth of {folder}, or was changed")
    for name, known in truth["files"].items():
        if digest((folder / name).read_bytes()) != known:
            raise InputError(f"{folder / name} was changed since the challenge was made")
    rows = []
    for entry in entries:
        content = json.loads(entry.read_text())
        for number, (name, own) in enumerate(truth["sets"].items()):
            told = checked(content.get(name, {}), own, f"{entry}, set {name}")
            rows.append({"entry": entry.stem, "number": number} | scores(*told, own))
    return tables(rows)


def checked(told: Mapping[str, Any], truth: Row, where: str) -> tuple[Any, Any]:
    """Probabilities of all causes and draws (d, rows, channels) of an entry for a set."""
    causes, draws = told.get("causes", {}), told.get("draws", {})
    p = np.asarray([causes.get(cause, np.nan) for cause in CAUSES], float)
    if not (np.all(p >= LEAST_PROBABILITY) and abs(p.sum() - 1.0) <= SUM_TOLERANCE):
        raise InputError(
            f"{where}: needed is a probability of at least {LEAST_PROBABILITY:g} for each cause in "
            f"challenge.json, and a sum of 1; the least is {np.min(p):g}, the sum {p.sum():g}"
        )
    shape = (LEAST_DRAWS, len(truth["readings"]))
    found = [np.asarray(draws.get(c, []), float) for c in COLUMNS]
    if any(
        x.ndim != 2 or len(x) < shape[0] or x.shape[1:] != shape[1:] or not np.isfinite(x).all()
        for x in found
    ) or len({len(x) for x in found}) > 1:  # fmt: skip
        raise InputError(
            f"{where}: needed are {shape[0]} or more finite draws of {shape[1]} rows, as many of "
            f"each of {', '.join(COLUMNS)}; given are {', '.join(str(x.shape) for x in found)}"
        )
    return p / p.sum(), np.stack(found, axis=-1)


if __name__ == "__main__":
    action, folder, sealed, *entries = sys.argv[1:]
    try:
        if action == "make":
            make(Path(folder), Path(sealed))
        else:
            print(score(Path(folder), Path(sealed), [Path(entry) for entry in entries]))
    except InputError as error:
        sys.exit(f"error: {error}")
