"""Identifiability audit: which effects an experimental design could identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.errors import InputError
from soilml.fitting.coordinates import SoilCoordinate, linearise, soil_coordinate
from soilml.fitting.free_parameters import select_free
from soilml.fitting.readings import Readings
from soilml.fitting.soil_test_terms import SoilTestTerms
from soilml.gap.data.candidate_effects import candidate_effects
from soilml.gap.design.effect_identifiability import (
    NAMEABLE_SIGMA,
    EffectIdentifiability,
    identifiability,
    indistinguishable_classes,
)
from soilml.gap.design.planned_readings import expected_readings, joined_readings, planned_readings
from soilml.gap.design.run_costs import check_costs
from soilml.gap.design.run_options import RunOption, run_options
from soilml.gap.statistics.signatures import Signature, effect_signatures
from soilml.io.read_table import Rows, as_table
from soilml.physics.effects import EFFECTS, Effect
from soilml.quantities import SHEAR
from soilml.unsolvable import solvable

Floats = NDArray[np.float64]

#: Largest difference, in sigma of a reading, of two signatures that count as equal.
SAME_PREDICTION = 0.1


class AddedRun(NamedTuple):
    """A run that could be added: number of effects that could then be named, and the new ones."""

    kind: str
    text: str
    nameable: int
    gained: tuple[str, ...]
    cost: float | None = None


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

    def plot(self, ax: Any = None) -> Any:
        """Draw what is left of each effect beside the soil, and what separates it, in sigma.

        Parameters
        ----------
        ax
            Axes of matplotlib; by default those of a new figure.

        Returns
        -------
        Axes

        Raises
        ------
        InputError
            For several axes.
        """
        from soilml.gap.design.audit_figure import plot_audit

        return plot_audit(self, ax)

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
                | ({} if run.cost is None else {"cost": run.cost})
                for run in self.added_runs
            ],
        }


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
    effects = candidate_effects(case, effects)
    known_costs = check_costs(costs or {})
    design = as_table(design)
    if not design.answered.any():
        raise InputError(f"{design.source}: no row has the status ok")
    readings = planned_readings(case, design.rows(design.answered))
    selected = select_free(case, free if free is not None or case.prior else SHEAR)
    soil = [f for f in selected if "." not in f.path]
    coordinates = [soil_coordinate(f) for f in soil]
    nominal = np.asarray([f.prior.fraction(f.nominal) for f in soil])
    jacobian = linearise(case, coordinates, nominal, readings)[1] / readings.std[:, None]
    of_tests = SoilTestTerms(case, coordinates).rates(nominal)
    jacobian = np.vstack([jacobian, of_tests])
    signatures, untestable = effect_signatures(case, readings, effects)
    table = identifiability(signatures, readings.std, jacobian, effects)
    before = {e.name for e in table if e.separating_snr >= NAMEABLE_SIGMA}
    added_runs = []
    for option in run_options(readings, case, tuple(effects.values())):
        try:
            extended = _with_added_run(case, readings, option, coordinates, nominal, effects)
        except (InputError, np.linalg.LinAlgError):
            continue
        if not extended:
            continue
        after = {e.name for e in extended if e.separating_snr >= NAMEABLE_SIGMA}
        gained = tuple(sorted(after - before))
        cost = known_costs.get(option.kind, 1.0) if known_costs else None
        nameable = len(before) + len(gained)
        added_runs.append(AddedRun(option.kind, option.text, nameable, gained, cost))
    added_runs.sort(key=lambda run: -len(run.gained) / (run.cost or 1.0))
    return Audit(
        tuple(sorted(table, key=lambda e: -e.separating_snr)),
        indistinguishable_classes(signatures, readings.std, jacobian),
        {u.name: u.reason for u in untestable},
        tuple(added_runs),
    )


def _with_added_run(
    case: Case,
    readings: Readings,
    option: RunOption,
    coordinates: Sequence[SoilCoordinate],
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
        jacobians.append(linearise(changed, coordinates, x, part)[1] / part.std[:, None])
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
