"""Cases of several explanations: their mean forces, and one model that has the effects of all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from soilml.config.case import Case
from soilml.physics.contact import Force
from soilml.physics.model import Model

#: Kinds of effects of the test rig and its sensors, which do not act on a vehicle.
EXCLUDED_KINDS = ("rig", "sensor")


def mixed_forces(case: Case, of_one: Callable[[Case], Force]) -> Force:
    """Mean forces (n,) of the explanations that have an equilibrium, by their weights.

    As the sensors of the rig read them: the remainder of the mixture was learned beside the faults
    that some explanations have. A vehicle has none of them (`without_faults`).
    """
    parts = [(one.weight, of_one(case.of_explanation(one))) for one in case.explanations]
    answered = np.stack([np.asarray(force.status) == 0 for _, force in parts])
    weight = answered * np.asarray([w for w, _ in parts])[:, None]
    weight = weight / np.where(answered.any(axis=0), weight.sum(axis=0), 1.0)
    first = max(parts, key=lambda part: part[0])[1]
    values: dict[str, Any] = {}
    for one in fields(Force):
        each = np.stack([np.asarray(getattr(force, one.name)) for _, force in parts])
        if one.name == "status":
            values[one.name] = np.where(answered.any(axis=0), 0, np.asarray(first.status))
            continue
        mean = (weight * np.where(answered, each, 0.0)).sum(axis=0)
        values[one.name] = np.where(answered.any(axis=0), mean, getattr(first, one.name))
    return Force(**values)


def without_faults(case: Case) -> Case:
    """The case without the effects of the test rig and its sensors, which act on no vehicle."""

    def kept(model: Model) -> Model:
        return replace(
            model, effects=tuple(e for e in model.effects if e.about.kind not in EXCLUDED_KINDS)
        )

    return replace(
        case, model=kept(case.model), gears={name: kept(own) for name, own in case.gears.items()}
    )


def with_all_effects(case: Case, others: Sequence[Case]) -> Case:
    """A case with the effects of others beside its own, at sizes at which they change nothing.

    Draws of different explanations are values of its parameters.
    """

    def joined(model: Model, more: Sequence[Model]) -> Model:
        for other in more:
            known = {effect.name for effect in model.effects}
            model = replace(
                model,
                effects=(
                    *model.effects,
                    *(type(e)() for e in other.effects if e.name not in known),
                ),
            )
        return model

    return replace(
        case,
        model=joined(case.model, [one.model for one in others]),
        gears={
            name: joined(own, [one.gears[name] for one in others])
            for name, own in case.gears.items()
        },
        explanations=(),
    )
