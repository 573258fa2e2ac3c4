"""The wheel that `estimate` assumes, and whether it is that of the case and of the table."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from itertools import chain

import numpy as np

from soilml.config.case import Case, read_case_of_one_gear
from soilml.config.compatibility import (
    check_wheel_columns,
    effect_differences,
    gear_differences,
    prior_differences,
    recipe_case,
    value_differences,
)
from soilml.errors import InputError, TableError
from soilml.fitting.soil_test_remarks import ignored_soil_tests
from soilml.identification.trained_estimator import (
    condition_on_case,
    narrower_priors,
    with_sensors_of,
)
from soilml.io.table import Table
from soilml.onboard.estimator import Estimator
from soilml.quantities import QUANTITIES
from soilml.remarks import texts
from soilml.report.terminal import shown_unit, significant

_HINT = "select rows with --where, or train a model for this wheel"


def describe_file(estimator: Estimator) -> str:
    """What a model file is for, in one line: gear, effects, estimated quantities with their prior.

    Bounds of the prior that a context input scales are given by its name until it is set.
    """
    gear = dict(json.loads(estimator.metadata["gear"]))
    limits = {} if estimator.sets is None else estimator.sets.context_ranges
    fixed = {} if estimator.sets is None else estimator.sets.context_values
    for name in ("radius", "width"):
        gear[name] = fixed.get(f"wheel_{name}", gear.get(name, limits.get(f"wheel_{name}")))
    sizes = [f"{k} {_number(v)}" for k, v in gear.items() if k != "type" and v is not None]
    effects = [e["name"] for e in json.loads(estimator.metadata["recipe"]).get("effect", [])]
    with_effects = f"with {', '.join(effects)}" if effects else "without effects"
    priors = [
        f"{entry['name'].replace('_', ' ')} {_prior_text(ends[0], ends[1], entry['unit'])}"
        if (scale := entry.get("scale")) is None or scale in fixed
        else f"{entry['name'].replace('_', ' ')} {entry['lower']:.3g} to 1 {scale}"
        for entry, *ends in zip(
            json.loads(estimator.metadata["outputs"]),
            estimator.prior.lower,
            estimator.prior.upper,
            strict=True,
        )
    ]
    return (
        f"{estimator.path}: for a {gear.get('type', 'gear that it does not state')}"
        f"{' of ' if sizes else ''}{', '.join(sizes)}, {with_effects}; reads "
        f"{', '.join(estimator.inputs)}; estimates {', '.join(priors)}"
    )


def _prior_text(low: float, high: float, unit: str) -> str:
    """A range in the unit in which a terminal shows it."""
    factor, shown = shown_unit(unit, high)
    return f"{significant(factor * low)} to {significant(factor * high)} {shown}".rstrip()


def apply_case_option(
    args: argparse.Namespace, estimators: list[Estimator]
) -> tuple[list[Estimator], Case | None, list[str]]:
    """The estimators for the wheel and soil of `--case`, the case, and notes on what is ignored.

    Raises `InputError` where a file for wheels of any size has no case, and where the gear or the
    effects of the case are not those of a file.
    """
    case = None
    if args.case is not None:
        case = read_case_of_one_gear(args.case, gear=args.gear, with_bias=True)
    given, notes = [], []
    for estimator in estimators:
        if estimator.sets is not None and estimator.sets.missing_context:
            if case is None:
                raise InputError(
                    f"{estimator.path} is for wheels of any size: give --case MODEL.toml with your "
                    "[gear], [soil], [soil.prior] and [noise]"
                )
            estimator, own_notes = condition_on_case(estimator, case)
            notes += texts(own_notes)
        elif case is not None:
            together = estimator.sets is not None and args.by is not None
            notes += _compare(args, estimator, case, together)
            estimator = with_sensors_of(estimator, case) if together else estimator
        given.append(estimator)
    if case is not None and case.discrepancy:
        notes.append(_discrepancy_note(args, given[0], case))
    if case is not None:
        notes += texts(ignored_soil_tests(case))
    return given, case, notes


def _compare(
    args: argparse.Namespace, estimator: Estimator, case: Case, together: bool
) -> list[str]:
    """Notes on what differs between a file for one wheel and the case.

    Raises `InputError` where gear or effects do.
    """
    own = recipe_case(estimator.metadata["recipe"], estimator.path)
    if own is None:
        return [
            f"{estimator.path} does not state its wheel: it cannot be compared with {args.case}"
        ]
    values = list(value_differences(case, own))  # an effect's path has a point: slip-sinkage.n1
    of_effects = [text for text in values if "." in text.split()[0]]
    wrong = [*gear_differences(case, own), *effect_differences(case, own), *of_effects]
    if wrong:
        said = "; ".join(wrong).replace("the model file", args.case)
        raise InputError(
            f"{estimator.path} is not for the wheel of {args.case}: {said}; train a file for this "
            "model, or correct [gear] and [[effect]]"
        )
    used = narrower_priors(estimator, case) if together else {}
    different = chain(
        (text for text in values if text not in of_effects),
        prior_differences(case, own, [name for name in estimator.names if name not in used]),
        () if together else _noise_differences(case, own),
    )
    return [
        f"{estimator.path}: {text.replace('the model file', args.case)}, which is ignored"
        for text in different
    ]


def _noise_differences(case: Case, own: Case) -> Iterator[str]:
    """Declared noise of the case that is not that of the file."""
    for key, noise in case.noise.items():
        if noise != own.noise.get(key):
            yield f"noise of {key} as in its recipe, the model file has another one"
    if case.bias:
        yield f"no bias of {', '.join(case.bias)}, the model file declares it"


def _discrepancy_note(args: argparse.Namespace, estimator: Estimator, case: Case) -> str:
    names = ", ".join(case.discrepancy)
    if estimator.sets is None or (args.by is None and not estimator.sets.sets_only):
        return f"estimate ignores the [discrepancy] of {names}: the file takes no noise of a row"
    return (
        f"[discrepancy] of {names} is included as independent errors of the rows, enlarged by the "
        "rows that are alike: intervals are wider than those of soilml identify"
    )


def _number(value: object) -> str:
    """A number, or the ends of a range."""
    if isinstance(value, tuple):
        return f"{value[0]:.3g} to {value[1]:.3g} m"
    return f"{value:g} m" if isinstance(value, float) else str(value)


def trained_radius(estimator: Estimator) -> float | None:
    """Radius (m) of the wheel of the training; None for a file of any wheel."""
    radius = json.loads(estimator.metadata["gear"]).get("radius")
    return float(radius) if isinstance(radius, int | float) else None


def check_table_wheel(estimator: Estimator, table: Table) -> None:
    """Raise `TableError` where the table's wheel columns differ from the wheel of the training."""
    gear = json.loads(estimator.metadata["gear"])
    fixed = estimator.sets.context_values if estimator.sets is not None else {}
    sizes = {n: fixed.get(f"wheel_{n}", gear.get(n)) for n in ("radius", "width")}
    check_wheel_columns(table, sizes, "the model was trained for", _HINT)
    effects = json.loads(estimator.metadata["recipe"]).get("effect", [])
    key = QUANTITIES["grouser_height"].column
    if key in table and not any(effect["name"] == "grousers" for effect in effects):
        lugs = table[key] > 0.0
        if lugs.any():
            row = int(np.argmax(lugs))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, the model was "
                f"trained for a wheel without lugs; {_HINT}"
            )
