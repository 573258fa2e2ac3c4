"""What a rig and a design could tell, before anything is driven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.observations import Cells, declared_std
from soilml.gap.design.run_options import cells_at, menu
from soilml.gap.statistics.coordinates import linearised, soil_axis
from soilml.gap.statistics.score_test import outside
from soilml.gap.statistics.signatures import Signature, signatures
from soilml.identification.free_parameters import select_free
from soilml.identification.operating_points import operating_points
from soilml.io.table import Table
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.quantities import CHANNELS, SHEAR, column
from soilml.row_status import Status

Floats = NDArray[np.float64]

#: Score that the largest of a catalogue reaches by chance in one of twenty null data sets, about.
THRESHOLD = 3.0
#: Further standard deviations that a power of 80 % asks for.
POWER = 0.8416
#: Separation, in sigma, from which an effect can be named, and below which two are one class.
NAMEABLE, ONE_CLASS = 3.0, 2.0


@dataclass(frozen=True)
class Nameable:
    """What a design tells of one effect at its reference size."""

    name: str
    kind: str
    size: float  # reference size, in `unit`
    unit: str
    seen: float  # sigma, all of its signature
    left: float  # sigma, what the soil parameters cannot absorb
    absorbed: float
    rivals: tuple[tuple[str, float], ...]  # nearest first, with the cosine
    separating_snr: float
    detectable: float  # smallest size found with a power of 80 %, in `unit`


@dataclass(frozen=True)
class Audit:
    """The audit of a design."""

    effects: tuple[Nameable, ...]
    classes: tuple[tuple[str, ...], ...]
    untestable: dict[str, str]
    additions: tuple[tuple[str, str, int, tuple[str, ...]], ...]  # kind, text, nameable, gained

    def as_json(self) -> dict[str, Any]:
        """As `soilml audit --out` writes it."""
        return {
            "effects": [
                {
                    "name": e.name,
                    "kind": e.kind,
                    "reference_size": e.size,
                    "unit": e.unit,
                    "seen_sigma": e.seen,
                    "left_sigma": e.left,
                    "absorbed": e.absorbed,
                    "rivals": [{"name": n, "cosine": c} for n, c in e.rivals],
                    "separating_snr": e.separating_snr,
                    "detectable_size": e.detectable,
                    "nameable": e.separating_snr >= NAMEABLE,
                }
                for e in self.effects
            ],
            "classes": [list(c) for c in self.classes],
            "not_testable": self.untestable,
            "runs_to_add": [
                {"kind": k, "text": t, "nameable": n, "gained": list(g)}
                for k, t, n, g in self.additions
            ],
        }


def audit(
    case: Case,
    design: Table,
    *,
    free: Sequence[str] | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
) -> Audit:
    """What runs at the slips and loads of a design could name; no reading is looked at.

    Channels are those whose noise is declared. Raises `InputError` where none is, or where the
    model carries a load of the design nowhere.
    """
    effects = {name: e for name, e in effects.items() if e.applies_to(case.model.gear)}
    cells = planned(case, design.rows(design.answered))
    wanted = select_free(case, free if free is not None or case.prior else SHEAR)
    axes = [soil_axis(f) for f in wanted if "." not in f.path]
    at = np.asarray([f.prior.fraction(f.nominal) for f in wanted if "." not in f.path])
    slope = linearised(case, axes, at, cells)[1] / cells.std[:, None]
    known, cannot = signatures(case, cells, effects)
    table = _told(known, cells.std, slope, effects)
    additions = []
    before = {e.name for e in table if e.separating_snr >= NAMEABLE}
    for option in menu(cells):
        try:
            new = cells_at(option, cells, case)
            more = _added(case, cells, new, axes, at, effects)
        except (InputError, np.linalg.LinAlgError):
            continue
        gained = tuple(sorted({e.name for e in more if e.separating_snr >= NAMEABLE} - before))
        additions.append((option.kind, option.text, len(before) + len(gained), gained))
    additions.sort(key=lambda entry: -entry[2])
    return Audit(
        tuple(sorted(table, key=lambda e: -e.separating_snr)),
        _classes(known, cells.std, slope),
        {u.name: u.reason for u in cannot},
        tuple(additions),
    )


def planned(case: Case, design: Table) -> Cells:
    """The cells that a design would bring, with the readings that the case expects."""
    at = operating_points(design)
    force = case.model(case.soil, at)
    if np.any(force.status != 0):
        row = int(np.flatnonzero(force.status)[0])
        raise InputError(f"{design.place(row)}: {Status(int(force.status[row])).reason}")
    names, readings, stds = [], [], []
    for name in CHANNELS:
        expected = np.asarray(getattr(force, name))
        filled = Table({**design.columns, column(name): expected}, design.source, design.line)
        std = declared_std(case, filled, column(name))
        if np.isfinite(std).all():
            names.append(name)
            readings.append(expected)
            stds.append(std)
    if not names:
        raise InputError("no channel has its noise declared: give [noise] in the model file")
    rows, channels = len(design), len(names)
    runs, number = np.unique(design["run"], return_inverse=True)
    return Cells(
        at=at,
        run=number.astype(np.int64),
        runs=tuple(str(r) for r in runs),
        order=np.arange(rows),
        channels=tuple(names),
        row=np.tile(np.arange(rows), channels),
        channel=np.repeat(np.arange(channels), rows),
        reading=np.concatenate(readings),
        std=np.concatenate(stds),
        noise=tuple(case.noise.get(column(n)) for n in names),
    )


def _told(
    known: Sequence[Signature], std: Floats, slope: Floats, effects: Mapping[str, type[Effect]]
) -> list[Nameable]:
    if not known:
        return []
    columns = np.stack([s.column for s in known], axis=1) / std[:, None]
    beyond = outside(columns, slope)
    seen, left = np.linalg.norm(columns, axis=0), np.linalg.norm(beyond, axis=0)
    unit = beyond / np.maximum(left, 1e-300)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    found = []
    for i, s in enumerate(known):
        order = np.argsort(-cosine[i])[:3]
        about = effects[s.name].about
        size = about.reference[about.size]
        sine = np.sqrt(max(0.0, 1.0 - float(cosine[i].max(initial=0.0)) ** 2))
        found.append(
            Nameable(
                s.name,
                s.kind,
                size,
                declared(effects[s.name])[about.size].unit,
                float(seen[i]),
                float(left[i]),
                float(1.0 - (left[i] / seen[i]) ** 2),
                tuple((known[j].name, float(cosine[i, j])) for j in order if j != i),
                float(left[i] * sine),
                float((THRESHOLD + POWER) / left[i] * size) if left[i] > 1e-6 else float("inf"),
            )
        )
    return found


def _added(
    case: Case,
    cells: Cells,
    new: Cells,
    axes: Sequence[Any],
    at: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[Nameable]:
    """The table of a design with one run more."""
    known, stds, slopes = [], [], []
    for part in (cells, new):
        found, _ = signatures(case, part, effects)
        known.append({s.name: s for s in found})
        stds.append(part.std)
        slopes.append(linearised(case, axes, at, part)[1] / part.std[:, None])
    names = sorted(known[0].keys() | known[1].keys())
    joined = []
    for name in names:
        parts = [
            k[name].column if name in k else np.zeros(len(s))
            for k, s in zip(known, stds, strict=True)
        ]
        one = known[0].get(name) or known[1][name]
        joined.append(replace(one, column=np.concatenate(parts)))
    return _told(joined, np.concatenate(stds), np.vstack(slopes), effects)


def _classes(known: Sequence[Signature], std: Floats, slope: Floats) -> tuple[tuple[str, ...], ...]:
    """Effects that this design cannot tell apart at their reference sizes."""
    if not known:
        return ()
    beyond = outside(np.stack([s.column for s in known], axis=1) / std[:, None], slope)
    length = np.linalg.norm(beyond, axis=0)
    unit = beyond / np.maximum(length, 1e-300)
    sine = np.sqrt(np.maximum(0.0, 1.0 - (unit.T @ unit) ** 2))
    label = list(range(len(known)))
    for i in range(len(known)):
        for j in range(i):
            alike = min(length[i], length[j]) * sine[i, j] < ONE_CLASS
            if alike and min(length[i], length[j]) > ONE_CLASS:
                old, new = label[i], label[j]
                label = [new if k == old else k for k in label]
    groups = [
        tuple(s.name for s, k in zip(known, label, strict=True) if k == g) for g in set(label)
    ]
    return tuple(sorted(g for g in groups if len(g) > 1))
