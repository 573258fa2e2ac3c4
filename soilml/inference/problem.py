"""What may have made the readings: hypotheses, their unknowns and their prior odds."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.config.measurement_noise import checked_sensors
from soilml.fitting.candidate_effects import with_effect
from soilml.fitting.coordinates import (
    Coordinate,
    free_soil_parameters,
    select_free,
    shape_coordinates,
    size_coordinate,
)
from soilml.fitting.readings import Readings
from soilml.inference import constants
from soilml.numerics.prior import Prior
from soilml.physics.effects.base import Effect
from soilml.quantities import SHEAR

#: Parameters of the soil whose priors are opened together: with the bearing fixed, those of shear
#: press for what the bearing lacks, and the other way round.
OPENED = (*SHEAR, "kphi", "n")
#: Range of slip, and of log load, above which the dependence of an effect on it can be estimated; a
#: load that scatters by this much about one level can suffice.
MIN_SLIP_RANGE, MIN_LOG_LOAD_RANGE = 0.05, 0.1


@dataclass(frozen=True, order=True)
class Hypothesis:
    """What a model may lack: effects, and whether their laws and the soil's priors are free.

    effects: Sorted names; none for the soil alone.
    free_law: Whether the laws of the effects have free shapes, or are the catalogue's.
    wide_priors: Whether the soil's priors are those of natural soils, or as the case states them.
    """

    effects: tuple[str, ...] = ()
    free_law: bool = False
    wide_priors: bool = False


SOIL_ALONE = Hypothesis()


@dataclass(frozen=True)
class InferenceProblem:
    """A case, its readings, and what may explain them.

    soil: Free soil parameters.
    effects: The catalogue by name.
    calibration: Standard deviations of sensor and rig errors by effect name, in the unit of the
        effect's size.
    """

    case: Case
    soil: tuple[Coordinate, ...]
    readings: Readings
    effects: Mapping[str, type[Effect]]
    calibration: Mapping[str, float]

    @staticmethod
    def of(
        case: Case,
        readings: Readings,
        soil: Sequence[Coordinate],
        effects: Mapping[str, type[Effect]],
        calibration: Mapping[str, float] | None = None,
    ) -> InferenceProblem:
        """The problem of a case; effects whose size is free already are no candidates.

        calibration: Beside that of the sensors in the case's [bias].
        """
        free = {c.path for c in soil}
        candidates = {n: e for n, e in effects.items() if f"{n}.{e.about.size}" not in free}
        known = checked_sensors(case.bias) | dict(calibration or {})
        return InferenceProblem(case, tuple(soil), readings, candidates, known)

    def checksum(self) -> str:
        """A checksum, within this process, of all that the posterior depends on."""
        readings = replace(self.readings, notes=())
        effects = sorted((name, id(effect)) for name, effect in self.effects.items())
        parts = (self.case, self.soil, readings, effects, self.calibration)
        return hashlib.sha256(repr(_as_fields(parts)).encode()).hexdigest()

    @cached_property
    def penalties(self) -> dict[str, float]:
        """-2 ln of the prior odds of each effect against its absence, by name."""
        return effect_penalties(self.effects)

    @cached_property
    def wide_case(self) -> Case:
        """The case with the priors of its soil opened as far as natural soils vary."""
        known = self.case.parameters()
        names = [name for name in OPENED if name in known]
        wide = {c.path: c.prior for c in select_free(replace(self.case, prior={}), names)}
        own = self.case.prior
        for path, prior in wide.items():  # a prior over the range of both
            other = own.get(path, prior)
            lower, upper = min(prior.lower, other.lower), max(prior.upper, other.upper)
            wide[path] = Prior(lower, upper, log=prior.log and lower > 0.0)
        return replace(self.case, prior=own | wide)

    @cached_property
    def wide_soil(self) -> tuple[Coordinate, ...]:
        """The soil parameters that are free where the priors are opened."""
        free = free_soil_parameters(self.wide_case, None)
        paths = {c.path for c in free}
        return (*free, *(c for c in self.soil if c.path not in paths))

    @cached_property
    def varies(self) -> dict[str, bool]:
        """Whether the readings can tell each coefficient of a law's shape."""
        slips = bool(np.ptp(self.readings.slip) > MIN_SLIP_RANGE)
        loads = bool(np.ptp(np.log(self.readings.load)) > MIN_LOG_LOAD_RANGE)
        return {"slip_power": slips, "by_slip": slips, "by_load": loads}

    def case_of(self, hypothesis: Hypothesis) -> Case:
        """The case with the effects of a hypothesis, at their neutral sizes."""
        case = self.wide_case if hypothesis.wide_priors else self.case
        for name in hypothesis.effects:
            case = with_effect(case, self.effects[name])
        return case

    def size(self, name: str) -> Coordinate:
        """The coordinate of an effect's size; errors of sensor and rig have a normal prior."""
        about = self.effects[name].about
        unchecked = constants.UNCHECKED_STD * about.reference[about.size]
        default = unchecked if about.calibration else None
        return size_coordinate(self.effects[name], self.calibration.get(name, default))

    def shapes(self, name: str) -> list[Coordinate]:
        """The coordinates of the shape of an effect's law that the readings can tell."""
        return [c for c in self._all_shapes[name] if self.varies[c.name]]

    @cached_property
    def _all_shapes(self) -> dict[str, list[Coordinate]]:
        return {name: shape_coordinates(effect) for name, effect in self.effects.items()}

    def coordinates(self, hypothesis: Hypothesis) -> list[Coordinate]:
        """The unknowns of a hypothesis: soil, sizes, and shapes where the laws are free."""
        found = list(self.wide_soil if hypothesis.wide_priors else self.soil)
        found += [self.size(name) for name in hypothesis.effects]
        if hypothesis.free_law:
            found += [c for name in hypothesis.effects for c in self.shapes(name)]
        return found

    def penalty(self, hypothesis: Hypothesis) -> float:
        """-2 ln of the prior odds of a hypothesis."""
        value = sum(self.penalties[name] for name in hypothesis.effects)
        outside = constants.OUTSIDE_PRIORS
        value -= 2.0 * float(np.log(outside if hypothesis.wide_priors else 1.0 - outside))
        if any(self._all_shapes[name] for name in hypothesis.effects):
            other = constants.OTHER_LAW_PRIOR
            value -= 2.0 * float(np.log(other if hypothesis.free_law else 1.0 - other))
        return value


def _as_fields(value: Any) -> Any:
    """A value by its type and fields, whose text tells any two apart."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return id(type(value)), [_as_fields(getattr(value, f.name)) for f in fields(value)]
    if isinstance(value, Mapping):
        return sorted((str(key), _as_fields(own)) for key, own in value.items())
    if isinstance(value, (list, tuple)):
        return [_as_fields(own) for own in value]
    return repr(value)


def effect_penalties(effects: Mapping[str, type[Effect]]) -> dict[str, float]:
    r"""-2 ln of the prior odds of each effect against its absence, by name.

    .. math:: -2 \ln \frac{\lambda}{F\,n}

    with F families, n effects in the effect's own one, and the expected number of causes,
    `EXPECTED_CAUSES`. An effect without a family is one of its own; on one of several gears, it is
    of the family that it has on all of them. A catalogue that grows, or a law of which more forms
    are listed, does not make a cause likelier.

    References: Scott and Berger, Bayes and empirical-Bayes multiplicity adjustment in the
    variable-selection problem, Annals of Statistics 38(5), 2010.
    """
    family = {n: e.about.family or n.partition("@")[0] for n, e in effects.items()}
    members = Counter(family.values())
    return {
        name: 2.0 * float(np.log(len(members) * members[own] / constants.EXPECTED_CAUSES))
        for name, own in family.items()
    }


def exclude_each_other(effect: type[Effect], other: type[Effect]) -> bool:
    """Whether two effects cannot be in one set: both act on one gear, as one effect or one family.

    An effect that all gears share acts on each of them.
    """
    (base, _, gear), (other_base, _, other_gear) = (
        own.name.partition("@") for own in (effect, other)
    )
    if gear and other_gear and gear != other_gear:
        return False
    family = effect.about.family
    return base == other_base or (bool(family) and other.about.family == family)
