"""Identifiability audit: which effects an experimental design could identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.compatibility import check_wheel_size
from soilml.errors import InputError, solvable
from soilml.fitting.candidate_effects import candidate_effects
from soilml.fitting.coordinates import free_soil_parameters
from soilml.fitting.effect_signatures import effect_signatures
from soilml.fitting.least_squares import SoilTestTerms
from soilml.fitting.operating_points import operating_points, with_rover_columns
from soilml.fitting.predictions import forces, linearise
from soilml.fitting.readings import Readings, positive_std
from soilml.fitting.usable_readings import answered_rows
from soilml.gap.results import as_json_entry
from soilml.io.read_table import Rows, as_table
from soilml.io.table import Table
from soilml.numerics.subspaces import project_out
from soilml.parameters import declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.quantities import CHANNELS, column
from soilml.remarks import Remark
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.row_status import Status

#: Approximate 95 % quantile of the largest score of the catalogue in data without a gap, and 80 %
#: quantile of the standard normal distribution: the power at which an effect is detectable.
DETECTION_THRESHOLD, POWER_QUANTILE = 3.0, 0.8416
#: Separation, in sigma, from which an effect can be named.
NAMEABLE_SIGMA = 3.0
LEAST_LEFT = 1e-6  # Signal beside the soil, in sigma, up to which no size is detectable


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
    rival: str  # the effect with the most similar signature; empty where there is no other
    cosine: float  # between the two
    separating_snr: float  # sigma, against the rival
    detectable_size: float  # smallest size detected with a power of 80 %, in `unit`

    @property
    def nameable(self) -> bool:
        """Whether the design distinguishes the effect from all others."""
        return self.separating_snr >= NAMEABLE_SIGMA


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """The identifiability audit of a design, made by `soilml.gap.audit`.

    Attributes
    ----------
    effects : tuple of EffectIdentifiability
        The testable effects, the best identified first.
    untestable : dict of Remark
        Why the design cannot test an effect, by its name.
    """

    effects: tuple[EffectIdentifiability, ...]
    untestable: dict[str, Remark]

    def report(self) -> Report:
        """Which effects could be named."""
        effects, units = self.effects, [e.unit for e in self.effects]
        named = [e.name for e in effects if e.nameable]
        count = len(effects) + len(self.untestable)
        table = ReportTable(
            "Effects",
            [
                Column("effect", [e.name for e in effects]),
                Column("nameable", [e.nameable for e in effects]),
                Column("left", [e.residual_signal for e in effects], digits=3),
                Column("apart", [e.separating_snr for e in effects], digits=3),
                Column("size", [e.size for e in effects], units, digits=3),
                Column("detectable", [e.detectable_size for e in effects], units,
                       digits=2, sizes=[e.size for e in effects]),
                Column("absorbed", [e.absorbed for e in effects], "share", digits=2),
                Column("rival", [f"{e.rival} {e.cosine:.2f}" if e.rival else "" for e in effects]),
            ],
            "Signals in sigma at the reference size: left beside the soil, and apart from the "
            "most similar effect. Absorbed: the share that the soil imitates.",
        )  # fmt: skip
        untested = [f"{name}: {why}" for name, why in self.untestable.items()]
        return Report(
            kind="plan",
            verdict=f"These runs could name {len(named)} of {count} effects.",
            lines=[f"They could name: {', '.join(named)}."] if named else [],
            tables=[table] if effects else [],
            details=[("Effects that cannot be tested", untested)] if untested else [],
            status=f"{len(named)} of {count}",
            title="Effects that a design could name",
        )

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
    rows, _ = answered_rows(as_table(design))
    readings = planned_readings(case, rows)
    soil = free_soil_parameters(case, free)
    x = np.asarray([c.prior.fraction(c.nominal) for c in soil])
    of_tests = SoilTestTerms(case, soil).rates(x)
    jacobian = linearise(case, soil, x, readings).jacobian / readings.std[:, None]
    signatures, untestable = effect_signatures(case, readings, effects)
    none = np.zeros(len(of_tests))
    columns = {s.name: np.append(s.column / readings.std, none) for s in signatures}
    table = identifiability(columns, np.vstack([jacobian, of_tests]), effects)
    return Audit(tuple(sorted(table, key=lambda e: -e.separating_snr)), untestable)


def planned_readings(case: Case, design: Table) -> Readings:
    """The readings that a case expects of a design, in the channels with declared noise."""
    design = with_rover_columns(case, design)
    check_wheel_size(case, design)
    at = operating_points(design)
    force = forces(case, at)
    if np.any(force.status != 0):
        row = int(np.flatnonzero(force.status)[0])
        raise InputError(f"{design.place(row)}: {Status(int(force.status[row])).reason}")
    expected = {column(name): np.asarray(getattr(force, name)) for name in CHANNELS}
    filled = replace(design, columns={**design.columns, **expected})
    stds = {name: positive_std(case, filled, column(name)) for name in CHANNELS}
    names = [name for name, std in stds.items() if np.isfinite(std).all()]
    if not names:
        raise InputError("no channel has declared noise: give [noise] in the model file")
    runs, number = np.unique(design["run"], return_inverse=True)
    return Readings.of_every_row(
        at,
        names,
        measured=np.concatenate([expected[column(n)] for n in names]),
        std=np.concatenate([stds[n] for n in names]),
        run=number.astype(np.int64),
        runs=[str(r) for r in runs],
    )


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
    names, (norm, cosine) = list(columns), similarity(columns, jacobian)
    table = []
    for i, (name, own) in enumerate(columns.items()):
        about, left, signal = effects[name].about, float(norm[i]), float(np.linalg.norm(own))
        size, nearest = about.reference[about.size], int(np.argmax(cosine[i]))
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
                rival=names[nearest] if nearest != i else "",
                cosine=float(cosine[i, nearest]),
                separating_snr=left * float(np.sqrt(max(0.0, 1.0 - cosine[i, nearest] ** 2))),
                detectable_size=detectable if left > LEAST_LEFT else float("inf"),
            )
        )
    return table


def similarity(columns: Mapping[str, Floats], space: Floats) -> tuple[Floats, Floats]:
    """Norms (k,) and absolute cosines (k, k), of zero diagonal, of whitened signatures (m,).

    space (m, p): Directions that are projected out of them.
    """
    projected = project_out(np.stack(list(columns.values()), axis=1), space)
    norm = np.linalg.norm(projected, axis=0)
    unit = projected / np.where(norm > 0, norm, 1.0)
    cosine = np.abs(unit.T @ unit)
    np.fill_diagonal(cosine, 0.0)
    return norm, cosine
