"""Identifiability audit: which effects an experimental design could identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import Coordinate, free_soil_parameters
from soilml.fitting.effect_signatures import Signature, effect_signatures
from soilml.fitting.least_squares import SoilTestTerms
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import answered_rows
from soilml.gap.design.planned_readings import expected_readings, joined_readings, planned_readings
from soilml.gap.design.run_kinds import check_costs
from soilml.gap.design.run_options import RunOption, run_options
from soilml.gap.evidence.similarity import SignatureSimilarity
from soilml.gap.report.results import as_json_entry
from soilml.io.read_table import Rows, as_table
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.remarks import Remark
from soilml.results import Result

if TYPE_CHECKING:
    from soilml.report.report import Report


#: Largest difference, in sigma of a reading, of two signatures that count as equal.
SAME_PREDICTION = 0.1


@dataclass(frozen=True)
class AddedRun:
    """A run that could be added: number of effects that could then be named, and the new ones."""

    kind: str
    text: str
    nameable: int
    gained: tuple[str, ...]
    cost: float | None = None


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """The identifiability audit of a design, made by `soilml.gap.audit`.

    Attributes
    ----------
    effects : tuple of EffectIdentifiability
        The testable effects, the best identified first.
    classes : tuple of tuple of str
        Groups of effects that the design cannot distinguish at their reference sizes.
    untestable : dict of Remark
        Why the design cannot test an effect, by its name.
    added_runs : tuple of AddedRun
        Runs that could be added, the most useful first.
    """

    effects: tuple[EffectIdentifiability, ...]
    classes: tuple[tuple[str, ...], ...]
    untestable: dict[str, Remark]
    added_runs: tuple[AddedRun, ...]

    def report(self) -> Report:
        """Which effects could be named, and the runs that would add most."""
        from soilml.gap.design.audit_report import audit_report

        return audit_report(self, NAMEABLE_SIGMA)

    def frame_columns(self) -> dict[str, Any]:
        """A row for each effect: size and unit, signals in sigma, and whether it could be named."""
        names = ["name", "nameable", "size", "unit", "residual_signal", "separating_snr"]
        names += ["detectable_size", "absorbed"]
        return {key: [getattr(e, key) for e in self.effects] for key in names}

    def as_json(self) -> dict[str, Any]:
        """The content of the file that `soilml plan effects --out` writes."""
        effects = [as_json_entry(e) | {"nameable": e.nameable} for e in self.effects]
        content: dict[str, Any] = as_json_entry(self)
        return content | {"effects": effects}


@solvable("the audit")
def audit(
    case: Case,
    design: Rows,
    *,
    free: Sequence[str] | None = None,
    effects: Mapping[str, type[Effect]] = EFFECTS,
    costs: Mapping[str, float] | None = None,
) -> Audit:
    """Determine which effects runs at the slips and loads of a design could identify.

    No measurement is needed: the signatures of the effects, at their reference sizes, are compared
    with the noise and with each other, after the free soil parameters have adapted.

    Parameters
    ----------
    case : Case
        Channels are those whose noise is declared here or in the design.
    design : Table, data frame or mapping of columns
        Rows with `run`, `slip` and `load_N`.
    free : sequence of str, optional
        Soil parameters that would be fitted; by default those with a prior.
    effects : mapping, optional
        The catalogue of effects by name.
    costs : mapping, optional
        Cost of each kind of run to add, 1 where none is given; they are then ranked by the effects
        that they gain per cost.

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
    case = case.without_explanations()
    effects = candidate_effects(case, effects)
    known_costs = check_costs(costs or {})
    design, _ = answered_rows(as_table(design))
    readings = planned_readings(case, design)
    coordinates = free_soil_parameters(case, free)
    nominal = np.asarray([c.prior.fraction(c.nominal) for c in coordinates])
    jacobian = linearise(case, coordinates, nominal, readings).jacobian / readings.std[:, None]
    of_tests = SoilTestTerms(case, coordinates).rates(nominal)
    jacobian = np.vstack([jacobian, of_tests])
    signatures, untestable = effect_signatures(case, readings, effects)
    table = identifiability(signatures, readings.std, jacobian, effects)
    before = {e.name for e in table if e.nameable}
    added_runs = []
    for option in run_options(readings, case, tuple(effects.values())):
        try:
            extended = _with_added_run(
                case, readings, option, coordinates, nominal, effects=effects
            )
        except (InputError, np.linalg.LinAlgError):
            continue
        if not extended:
            continue
        gained = sorted(e.name for e in extended if e.nameable and e.name not in before)
        cost = known_costs.get(option.kind, 1.0) if known_costs else None
        nameable = len(before) + len(gained)
        added_runs.append(AddedRun(option.kind, option.text, nameable, tuple(gained), cost))
    added_runs.sort(key=lambda run: -len(run.gained) / (run.cost or 1.0))
    return Audit(
        effects=tuple(sorted(table, key=lambda e: -e.separating_snr)),
        classes=indistinguishable_classes(signatures, readings.std, jacobian),
        untestable=untestable,
        added_runs=tuple(added_runs),
    )


def _with_added_run(
    case: Case,
    readings: Readings,
    option: RunOption,
    coordinates: Sequence[Coordinate],
    x: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[EffectIdentifiability]:
    """The identifiability of effects by a design with one run added; none if it adds a repeat."""
    new = expected_readings(option.at, readings, option.changed(case), option.kind)
    parts = [(case, joined_readings(readings, new))]
    if option.gear is not None:
        parts = [(case, readings), (option.changed(case), new)]
    by_part, stds, jacobians = [], [], []
    for changed, part in parts:
        removed = option.gear.removed if option.gear and part is new else ()
        known = {name: e for name, e in effects.items() if name not in removed}
        signatures, _ = effect_signatures(changed, part, known)
        by_part.append({s.name: s for s in signatures})
        stds.append(part.std)
        found = linearise(changed, coordinates, x, part)
        jacobians.append(found.jacobian / part.std[:, None])
    if option.plain is not None:
        plain = joined_readings(readings, expected_readings(option.plain, readings, case))
        usual = {s.name: s.column for s in effect_signatures(case, plain, effects)[0]}
        if _are_equal(usual, by_part[0], stds[0]):
            return []
    of_tests = SoilTestTerms(case, coordinates).rates(x)
    pooled = []
    for name in sorted(set().union(*by_part)):
        columns = [
            own[name].column if name in own else np.zeros(len(std))
            for own, std in zip(by_part, stds, strict=True)
        ]
        signature = next(own[name] for own in by_part if name in own)
        pooled.append(replace(signature, column=np.concatenate(columns)))
    return identifiability(pooled, np.concatenate(stds), np.vstack([*jacobians, of_tests]), effects)


def _are_equal(usual: Mapping[str, Floats], new: Mapping[str, Signature], std: Floats) -> bool:
    """Whether all effects change the readings of two runs equally, to a tenth of a sigma."""
    return usual.keys() == new.keys() and all(
        bool(np.all(np.abs(usual[name] - s.column) <= SAME_PREDICTION * std))
        for name, s in new.items()
    )


#: Approximate 95 % quantile of the largest score of the catalogue in data without a gap.
DETECTION_THRESHOLD = 3.0
#: 80 % quantile of the standard normal distribution: the power at which an effect is detectable.
POWER_QUANTILE = 0.8416
#: Separation, in sigma, from which an effect can be named, and below which two effects are
#: indistinguishable.
NAMEABLE_SIGMA, SAME_CLASS_SIGMA = 3.0, 2.0
LISTED_RIVALS = 3  # Rivals that are listed for each effect


class Rival(NamedTuple):
    """An effect with a similar signature, and the cosine between the two."""

    name: str
    cosine: float


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
    rivals: tuple[Rival, ...]  # the most similar effects
    separating_snr: float  # sigma, against the most similar effect
    detectable_size: float  # smallest size detected with a power of 80 %, in `unit`

    @property
    def nameable(self) -> bool:
        """Whether the design distinguishes the effect from all others."""
        return self.separating_snr >= NAMEABLE_SIGMA


def identifiability(
    signatures: Sequence[Signature],
    std: Floats,
    jacobian: Floats,
    effects: Mapping[str, type[Effect]],
) -> list[EffectIdentifiability]:
    """Norms, cosines and separations of signatures on readings with independent noise.

    `jacobian`, (m + t, p), has the derivatives of the whitened readings by the soil, and behind
    them those of tests of the soil, which no effect changes.
    """
    if not signatures:
        return []
    columns = _whitened(signatures, std, len(jacobian))
    similar = SignatureSimilarity.beside(jacobian, [s.name for s in signatures], columns)
    signal, residual = np.linalg.norm(columns, axis=0), similar.norm
    table = []
    for i, s in enumerate(signatures):
        nearest = np.argsort(-similar.cosine[i])[:LISTED_RIVALS]
        about = effects[s.name].about
        size = about.reference[about.size]
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
                rivals=tuple(
                    Rival(similar.names[j], float(similar.cosine[i, j])) for j in nearest if j != i
                ),
                separating_snr=similar.separation(s.name, 1.0)[0],
                detectable_size=detectable,
            )
        )
    return table


def indistinguishable_classes(
    signatures: Sequence[Signature], std: Floats, jacobian: Floats
) -> tuple[tuple[str, ...], ...]:
    """Effects that this design cannot distinguish at their reference sizes."""
    if not signatures:
        return ()
    columns = _whitened(signatures, std, len(jacobian))
    similar = SignatureSimilarity.beside(jacobian, [s.name for s in signatures], columns)
    norm, sine = similar.norm, np.sqrt(np.maximum(0.0, 1.0 - similar.cosine**2))
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


def _whitened(signatures: Sequence[Signature], std: Floats, rows: int) -> Floats:
    """Whitened signatures (rows, k), zero behind the readings."""
    columns = np.zeros((rows, len(signatures)))
    columns[: len(std)] = np.stack([s.column for s in signatures], axis=1) / std[:, None]
    return columns
