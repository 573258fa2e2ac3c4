"""Making a challenge: blind sets in a public folder, their truths in one sealed file."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from datagen.blind_sets import BlindSet, Plan, csv_text, draw_blind_set, draw_plan
from datagen.blind_sets.plans import MECHANISMS, TIERS_WITHOUT_MECHANISM
from datagen.blind_sets.reading_errors import Sensor
from datagen.blind_sets.soil_families import RADIUS, WIDTH
from datagen.challenge.challenge_files import (
    CHALLENGE_FILE,
    COLUMNS,
    FORMAT,
    LEAST_DRAWS,
    LEAST_PROBABILITY,
    NONE,
    UNKNOWN,
    digest,
)
from soilml import __version__
from soilml.errors import InputError
from soilml.io.text_tables import format_table
from soilml.physics.effects import EFFECTS
from soilml.physics.gears import Wheel

#: Tiers that have one right answer. Two causes together (M) and changing soils (T) have several.
TIERS = tuple(t for t in (*MECHANISMS, *TIERS_WITHOUT_MECHANISM) if t != "T")
DEFAULT_TIERS = ("A", "B", "C", "S", "L", "D", "N0", "N1")
#: Causes outside the catalogue that one of its effects describes too: two answers are right.
AMBIGUOUS = ("stiff-layer",)
README = Path(__file__).with_name("README_of_challenge.md")


@dataclass(frozen=True)
class Sealed:
    """A challenge before it is written: texts of the public files by name, and of the truth."""

    public: dict[str, str]
    truth: str


def make_challenge(
    count: int,
    tiers: Sequence[str] = DEFAULT_TIERS,
    seed: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Sealed:
    """Draw the sets of a challenge.

    count: Number of sets.
    tiers: Members of `TIERS`, each equally likely in every set.
    seed: Makes the challenge repeatable, and so open to all who guess it. Without one, 256 random
        bits of the operating system decide, of which each set uses a digest: no set tells of
        another, and no one can try them all.
    progress: Called with the number of sets that are done.

    Raises `InputError` for an unknown tier.
    """
    for tier in tiers:
        if tier not in TIERS:
            raise InputError(f"no tier {tier!r}; there are: {', '.join(TIERS)}")
    secret = secrets.token_hex(32) if seed is None else digest(f"seed {seed}".encode())
    wheel = Wheel(radius=RADIUS, width=WIDTH)
    causes = [NONE, UNKNOWN, *(n for n, e in EFFECTS.items() if e.applies_to(wheel))]
    public: dict[str, str] = {}
    sets: dict[str, Any] = {}
    number = 0
    while len(sets) < count:
        bits = hashlib.sha256(f"{secret} {number}".encode()).digest()[:16]
        number += 1
        plan = draw_plan(tiers, int.from_bytes(bits, "big"))
        if plan.cause in AMBIGUOUS:
            continue
        try:
            drawn = draw_blind_set(plan)
        except RuntimeError:  # no soil of the family carries all rows
            continue
        name = f"s{len(sets) + 1:0{len(str(count))}d}"
        public |= {f"{name}/{file}": text for file, text in _public_files(drawn).items()}
        sets[name] = _truth_of_set(plan, drawn)
        if progress is not None:
            progress(len(sets))
    truth = {
        "format": FORMAT,
        "soilml_version": __version__,
        "salt": secrets.token_hex(32) if seed is None else digest(f"salt {seed}".encode()),
        "files": {name: digest(text.encode()) for name, text in public.items()},
        "causes": causes,
        "sets": sets,
    }
    truth_text = json.dumps(truth) + "\n"
    sealed = digest(truth_text.encode())
    content = {
        "format": FORMAT,
        "soilml_version": __version__,
        "truth_sha256": sealed,
        "tiers": list(tiers),
        "causes": causes,
        "least_probability": LEAST_PROBABILITY,
        "least_draws": LEAST_DRAWS,
        "channels": list(COLUMNS),
        "sets": {name: {"rows": len(own["readings"][COLUMNS[0]])} for name, own in sets.items()},
    }
    public[CHALLENGE_FILE] = json.dumps(content, indent=1) + "\n"
    public["README.md"] = _readme(sealed, causes, tiers, count)
    return Sealed(public, truth_text)


def answer_of(plan: Plan, causes: Sequence[dict[str, Any]]) -> str:
    """The right answer: the hidden cause by its name in the catalogue, `none` or `unknown`.

    Noise, scatter of the soil and faults of readings (tiers N) are `none`: the model is right. A
    smooth error of the model alone (tier D), and causes that the catalogue lacks, are `unknown`.
    """
    if plan.tier in TIERS_WITHOUT_MECHANISM:
        return UNKNOWN if plan.tier == "D" else NONE
    (name,) = (cause["name"] for cause in causes)
    return name if name in EFFECTS else UNKNOWN


def _public_files(drawn: BlindSet) -> dict[str, str]:
    """Runs, model and operating points of the rows kept back; no reading of these.

    Times are left out: they are there in some tiers alone, which they would reveal.
    """
    runs = {name: values for name, values in drawn.columns.items() if name != "time_s"}
    given = [name for name in runs if name not in COLUMNS]
    held = {name: np.concatenate([drawn.between[name], drawn.region[name]]) for name in given}
    elapsed = [drawn.truth["between_elapsed"], drawn.truth["region_elapsed"]]
    held["progress"] = np.concatenate(elapsed)
    return {
        "runs.csv": csv_text(runs),
        "held_out.csv": csv_text(held),
        "model.toml": drawn.model,
    }


def _truth_of_set(plan: Plan, drawn: BlindSet) -> dict[str, Any]:
    readings, noise = {}, {}
    for name in COLUMNS:
        sensor = Sensor(**drawn.truth["noise"]["declared"][name])
        readings[name] = [*drawn.between[name].tolist(), *drawn.region[name].tolist()]
        noise[name] = float(np.median(sensor.std(drawn.columns[name])))
    kept = ("plan", "causes", "soil", "scatter_std")
    return {
        "answer": answer_of(plan, drawn.truth["causes"]),
        **{key: drawn.truth[key] for key in kept},
        "readings": readings,
        "noise": noise,
    }


def _readme(sealed: str, causes: Sequence[str], tiers: Sequence[str], count: int) -> str:
    """What entrants read."""
    names = {
        "A": "one cause of the catalogue, by its usual law",
        "B": "one cause of the catalogue, by another law",
        "C": "one cause that the catalogue lacks (`unknown`)",
        "S": "a fault of a sensor",
        "L": "another law of the soil, of the catalogue",
        **{t: text for t, text in TIERS_WITHOUT_MECHANISM.items() if t != "D"},
        "D": "a smooth error of the model alone (`unknown`)",
    }
    table = format_table(("tier", "what is hidden"), [(t, names[t]) for t in tiers], 2)
    text = README.read_text(encoding="utf-8")
    for key, value in {
        "SETS": str(count),
        "TIERS": table,
        "SHA256": sealed,
        "NAME": sealed[:16],
        "LEAST_PROBABILITY": f"{LEAST_PROBABILITY:g}",
        "LEAST_DRAWS": str(LEAST_DRAWS),
        "CAUSES": ", ".join(causes),
    }.items():
        text = text.replace(f"{{{key}}}", value)
    return text
