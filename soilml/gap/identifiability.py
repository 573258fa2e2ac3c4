"""Identifiability audit: which effects an experimental design could identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import free_soil_parameters
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import SoilTestTerms
from soilml.fitting.predictions import linearise
from soilml.fitting.readings import Readings
from soilml.fitting.usable_readings import answered_rows
from soilml.gap.planned_readings import expected_readings, joined_readings, planned_readings
from soilml.gap.results import as_json_entry
from soilml.gap.run_options import LUG_EFFECTS, check_costs, run_options
from soilml.gap.scores import SignatureSimilarity
from soilml.io.read_table import Rows, as_table
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.remarks import Remark
from soilml.results import Result

if TYPE_CHECKING:
    from soilml.report.report import Report

#: Approximate 95 % quantile of the largest score of the catalogue in data without a gap.
DETECTION_THRESHOLD = 3.0
#: 80 % quantile of the standard normal distribution: the power at which an effect is detectable.
POWER_QUANTILE = 0.8416
#: Separation, in sigma, from which an effect can be named, and below which two effects are
#: indistinguishable.
NAMEABLE_SIGMA, SAME_CLASS_SIGMA = 3.0, 2.0
LISTED_RIVALS = 3  # Rivals that are listed for each effect
LEAST_LEFT = 1e-6  # Signal beside the soil, in sigma, up to which no size is detectable


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
        from soilml.gap.audit_report import audit_report

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
    soil = free_soil_parameters(case, free)
    x = np.asarray([c.prior.fraction(c.nominal) for c in soil])
    of_tests = SoilTestTerms(case, soil).rates(x)

    def signals(*parts: tuple[Case, Readings]) -> tuple[dict[str, Floats], Floats]:
        """Whitened signatures by name, and Jacobian of the soil, of the rows of some parts."""
        found, jacobians = [], []
        for number, (own, part) in enumerate(parts):
            known = {n: e for n, e in effects.items() if not number or n not in LUG_EFFECTS}
            columns = effect_signatures(own, part, known)[0]
            found.append({s.name: s.column / part.std for s in columns})
            jacobians.append(linearise(own, soil, x, part).jacobian / part.std[:, None])
        none = [np.zeros(len(part)) for _, part in parts]
        pooled = {}
        for name in dict.fromkeys(name for own in found for name in own):
            rows = [one.get(name, zero) for one, zero in zip(found, none, strict=True)]
            pooled[name] = np.concatenate([*rows, np.zeros(len(of_tests))])
        return pooled, np.vstack([*jacobians, of_tests])

    def nameable(*parts: tuple[Case, Readings]) -> set[str]:
        return {e.name for e in identifiability(*signals(*parts), effects) if e.nameable}

    columns, jacobian = signals((case, readings))
    table = identifiability(columns, jacobian, effects)
    added_runs, before = [], {e.name for e in table if e.nameable}
    for option in run_options(readings, case, list(effects)):
        changed, known = option.changed(case), before
        try:
            new = expected_readings(option.at, readings, changed, option.kind)
            if option.smooth:
                extended = nameable((case, readings), (changed, new))
            else:
                extended = nameable((case, joined_readings(readings, new)))
            if option.plain is not None:  # what a repeat gains is no gain of the covariate
                repeat = expected_readings(option.plain, readings, case)
                known = before | nameable((case, joined_readings(readings, repeat)))
        except (InputError, np.linalg.LinAlgError):
            continue
        gained = sorted(extended - known)
        cost = known_costs.get(option.kind, 1.0) if known_costs else None
        count = len(before) + len(gained)
        added_runs.append(AddedRun(option.kind, option.text, count, tuple(gained), cost))
    added_runs.sort(key=lambda run: -len(run.gained) / (run.cost or 1.0))
    return Audit(
        effects=tuple(sorted(table, key=lambda e: -e.separating_snr)),
        classes=indistinguishable_classes(columns, jacobian),
        untestable=effect_signatures(case, readings, effects)[1],
        added_runs=tuple(added_runs),
    )


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
    columns: Mapping[str, Floats], jacobian: Floats, effects: Mapping[str, type[Effect]]
) -> list[EffectIdentifiability]:
    """Norms, cosines and separations of whitened signatures on readings with independent noise.

    columns: Signatures (m + t,) by name.
    jacobian (m + t, p): Derivatives of the whitened readings by the soil, and behind them those of
        tests of the soil, which no effect changes.
    """
    if not columns:
        return []
    similar, table = SignatureSimilarity.beside(jacobian, columns), []
    for i, (name, column) in enumerate(columns.items()):
        nearest = np.argsort(-similar.cosine[i])[:LISTED_RIVALS]
        about, left = effects[name].about, float(similar.norm[i])
        size, signal = about.reference[about.size], float(np.linalg.norm(column))
        detectable = (DETECTION_THRESHOLD + POWER_QUANTILE) / max(left, 1e-300) * size
        table.append(
            EffectIdentifiability(
                name=name,
                kind=about.kind,
                size=size,
                unit=declared(effects[name])[about.size].unit,
                signal=signal,
                residual_signal=left,
                absorbed=1.0 - (left / signal) ** 2,
                rivals=tuple(
                    Rival(similar.names[j], float(similar.cosine[i, j])) for j in nearest if j != i
                ),
                separating_snr=similar.separation(name, 1.0)[0],
                detectable_size=detectable if left > LEAST_LEFT else float("inf"),
            )
        )
    return table


def indistinguishable_classes(
    columns: Mapping[str, Floats], jacobian: Floats
) -> tuple[tuple[str, ...], ...]:
    """Effects that this design cannot distinguish at their reference sizes."""
    from scipy.sparse.csgraph import connected_components

    if not columns:
        return ()
    similar = SignatureSimilarity.beside(jacobian, columns)
    weaker = np.minimum.outer(similar.norm, similar.norm)
    sine = np.sqrt(np.maximum(0.0, 1.0 - similar.cosine**2))
    alike = (weaker > SAME_CLASS_SIGMA) & (weaker * sine < SAME_CLASS_SIGMA)
    _, label = connected_components(alike, directed=False)
    groups = [
        tuple(n for n, k in zip(columns, label, strict=True) if k == g) for g in np.unique(label)
    ]
    return tuple(sorted(g for g in groups if len(g) > 1))
