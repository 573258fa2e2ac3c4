"""Identifiability audit: which effects an experimental design could identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.gap.data.stacked_readings import StackedReadings
from soilml.gap.design.planned_readings import planned_readings
from soilml.gap.design.run_options import expected_readings, run_options
from soilml.gap.statistics.coordinates import SoilCoordinate, linearise, soil_coordinate
from soilml.gap.statistics.signatures import Signature, effect_signatures
from soilml.identification.free_parameters import select_free
from soilml.io.table import Table
from soilml.numerics.subspaces import project_out
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.quantities import SHEAR

Floats = NDArray[np.float64]

#: Approximate 95 % quantile of the largest score of the catalogue in data without a gap.
DETECTION_THRESHOLD = 3.0
#: 80 % quantile of the standard normal distribution: the power at which an effect is detectable.
POWER_QUANTILE = 0.8416
#: Separation, in sigma, from which an effect can be named, and below which two effects are
#: indistinguishable.
NAMEABLE_SIGMA, SAME_CLASS_SIGMA = 3.0, 2.0
#: Rivals that are listed for each effect.
LISTED_RIVALS = 3


@dataclass(frozen=True)
class EffectIdentifiability:
    """How well a design identifies one effect at its reference size."""

    name: str
    kind: str
    size: float  # reference size, in `unit`
    unit: str
    signal: float  # norm of the signature, in sigma
    residual_signal: float  # norm that remains after the soil parameters have adapted, in sigma
    absorbed: float  # fraction of the squared norm that the soil parameters absorb
    rivals: tuple[tuple[str, float], ...]  # most similar effects, with their cosine
    separating_snr: float  # sigma, against the most similar effect
    detectable_size: float  # smallest size detected with a power of 80 %, in `unit`


class AddedRun(NamedTuple):
    """A run that could be added: number of effects that could then be named, and the new ones."""

    kind: str
    text: str
    nameable: int
    gained: tuple[str, ...]


@dataclass(frozen=True)
class Audit:
    """The identifiability audit of a design, made by `soilml.gap.audit`.

    Attributes
    ----------
    effects : tuple of EffectIdentifiability
        The testable effects, the best identified first.
    classes : tuple of tuple of str
        Groups of effects that the design cannot distinguish at their reference sizes.
    untestable : dict of str
        Effects that the design cannot test, with the reason.
    added_runs : tuple of AddedRun
        Runs that could be added, the most useful first.
    """

    effects: tuple[EffectIdentifiability, ...]
    classes: tuple[tuple[str, ...], ...]
    untestable: dict[str, str]
    added_runs: tuple[AddedRun, ...]

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml audit --out` writes."""
        return {
            "effects": [
                {
                    "name": e.name,
                    "kind": e.kind,
                    "reference_size": e.size,
                    "unit": e.unit,
                    "seen_sigma": e.signal,
                    "left_sigma": e.residual_signal,
                    "absorbed": e.absorbed,
                    "rivals": [{"name": n, "cosine": c} for n, c in e.rivals],
                    "separating_snr": e.separating_snr,
                    "detectable_size": e.detectable_size,
                    "nameable": e.separating_snr >= NAMEABLE_SIGMA,
                }
                for e in self.effects
            ],
            "classes": [list(c) for c in self.classes],
            "not_testable": self.untestable,
            "runs_to_add": [
                {"kind": run.kind, "text": run.text, "nameable": run.nameable}
                | {"gained": list(run.gained)}
                for run in self.added_runs
            ],
        }


def audit(
    case: Case,
    design: Table,
    *,
    free: Sequence[str] | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
) -> Audit:
    """Determine which effects runs at the slips and loads of a design could identify.

    No measurement is needed: the signatures of the effects, at their reference sizes, are compared
    with the noise and with each other, after the free soil parameters have adapted.

    Parameters
    ----------
    case : Case
        Channels are those whose noise is declared here or in the design.
    design : Table
        Rows with `run`, `slip` and `load_N`.
    free : sequence of str, optional
        Soil parameters that would be fitted; by default those with a prior.
    effects : mapping, optional
        The catalogue of effects by name.

    Raises
    ------
    InputError
        Where no channel has declared noise, or the soil cannot carry a load of the design.

    Examples
    --------
    >>> import numpy as np
    >>> from soilml import Model, Wheel, soil
    >>> from soilml.config.case import Case
    >>> from soilml.config.measurement_noise import Noise
    >>> from soilml.gap import audit
    >>> from soilml.io.table import Table
    >>> from soilml.numerics.prior import Prior
    >>> from soilml.physics.effects import EFFECTS
    >>> model = Model(Wheel(radius=0.15, width=0.12))
    >>> noise = {"torque_Nm": Noise(share=0.01), "sinkage_m": Noise(share=0.01)}
    >>> case = Case(model, soil("wong1989/dry_sand"), {"friction_angle": Prior(0.3, 0.8)}, noise)
    >>> slip, load = np.tile(np.linspace(0.1, 0.6, 6), 3), np.repeat([40.0, 60.0, 90.0], 6)
    >>> design = Table({"run": np.repeat(["a", "b", "c"], 6), "slip": slip, "load_N": load})
    >>> found = audit(case, design, effects={"slip-sinkage": EFFECTS["slip-sinkage"]})
    >>> e = found.effects[0]
    >>> e.name, e.separating_snr > 3.0, round(e.absorbed, 3)
    ('slip-sinkage', True, 0.121)
    """
    effects = {name: e for name, e in effects.items() if e.applies_to(case.model.gear)}
    readings = planned_readings(case, design.rows(design.answered))
    selected = select_free(case, free if free is not None or case.prior else SHEAR)
    soil = [f for f in selected if "." not in f.path]
    coordinates = [soil_coordinate(f) for f in soil]
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in soil])
    jacobian = linearise(case, coordinates, nominal, readings)[1] / readings.std[:, None]
    signatures, untestable = effect_signatures(case, readings, effects)
    table = _identifiability(signatures, readings.std, jacobian, effects)
    before = {e.name for e in table if e.separating_snr >= NAMEABLE_SIGMA}
    added_runs = []
    for option in run_options(readings):
        try:
            new = expected_readings(option, readings, case)
            extended = _with_added_run(case, readings, new, coordinates, nominal, effects)
        except (InputError, np.linalg.LinAlgError):
            continue
        after = {e.name for e in extended if e.separating_snr >= NAMEABLE_SIGMA}
        gained = tuple(sorted(after - before))
        added_runs.append(AddedRun(option.kind, option.text, len(before) + len(gained), gained))
    added_runs.sort(key=lambda run: -run.nameable)
    return Audit(
        tuple(sorted(table, key=lambda e: -e.separating_snr)),
        _indistinguishable_classes(signatures, readings.std, jacobian),
        {u.name: u.reason for u in untestable},
        tuple(added_runs),
    )


def _identifiability(
    signatures: Sequence[Signature],
    std: Floats,
    jacobian: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[EffectIdentifiability]:
    """Norms, cosines and separations of signatures on readings with independent noise."""
    if not signatures:
        return []
    columns = np.stack([s.column for s in signatures], axis=1) / std[:, None]
    projected = project_out(columns, jacobian)
    signal, residual = np.linalg.norm(columns, axis=0), np.linalg.norm(projected, axis=0)
    unit = projected / np.maximum(residual, 1e-300)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    table = []
    for i, s in enumerate(signatures):
        nearest = np.argsort(-cosine[i])[:LISTED_RIVALS]
        about = effects[s.name].about
        size = about.reference[about.size]
        sine = np.sqrt(max(0.0, 1.0 - float(cosine[i].max(initial=0.0)) ** 2))
        detectable = float("inf")
        if residual[i] > 1e-6:
            detectable = float((DETECTION_THRESHOLD + POWER_QUANTILE) / residual[i] * size)
        table.append(
            EffectIdentifiability(
                name=s.name,
                kind=s.kind,
                size=size,
                unit=declared(effects[s.name])[about.size].unit,
                signal=float(signal[i]),
                residual_signal=float(residual[i]),
                absorbed=float(1.0 - (residual[i] / signal[i]) ** 2),
                rivals=tuple((signatures[j].name, float(cosine[i, j])) for j in nearest if j != i),
                separating_snr=float(residual[i] * sine),
                detectable_size=detectable,
            )
        )
    return table


def _with_added_run(
    case: Case,
    readings: StackedReadings,
    new: StackedReadings,
    coordinates: Sequence[SoilCoordinate],
    x: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[EffectIdentifiability]:
    """The identifiability of effects by a design with one run added."""
    by_part, stds, jacobians = [], [], []
    for part in (readings, new):
        signatures, _ = effect_signatures(case, part, effects)
        by_part.append({s.name: s for s in signatures})
        stds.append(part.std)
        jacobians.append(linearise(case, coordinates, x, part)[1] / part.std[:, None])
    pooled = []
    for name in sorted(by_part[0].keys() | by_part[1].keys()):
        columns = [
            own[name].column if name in own else np.zeros(len(std))
            for own, std in zip(by_part, stds, strict=True)
        ]
        signature = by_part[0].get(name) or by_part[1][name]
        pooled.append(replace(signature, column=np.concatenate(columns)))
    return _identifiability(pooled, np.concatenate(stds), np.vstack(jacobians), effects)


def _indistinguishable_classes(
    signatures: Sequence[Signature], std: Floats, jacobian: Floats
) -> tuple[tuple[str, ...], ...]:
    """Effects that this design cannot distinguish at their reference sizes."""
    if not signatures:
        return ()
    columns = np.stack([s.column for s in signatures], axis=1) / std[:, None]
    projected = project_out(columns, jacobian)
    norm = np.linalg.norm(projected, axis=0)
    unit = projected / np.maximum(norm, 1e-300)
    sine = np.sqrt(np.maximum(0.0, 1.0 - (unit.T @ unit) ** 2))
    label = list(range(len(signatures)))
    for i in range(len(signatures)):
        for j in range(i):
            weaker = min(norm[i], norm[j])
            if weaker > SAME_CLASS_SIGMA and weaker * sine[i, j] < SAME_CLASS_SIGMA:
                old, new = label[i], label[j]
                label = [new if k == old else k for k in label]
    groups = [
        tuple(s.name for s, k in zip(signatures, label, strict=True) if k == g) for g in set(label)
    ]
    return tuple(sorted(g for g in groups if len(g) > 1))
