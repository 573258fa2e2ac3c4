"""Whether a case, a table and a model file are of the same wheel, soil, effects and priors.

Differences are phrases such as "gear.radius 0.15, the model file has 0.1": the value of the other,
then that of the case, which comes from the user's model file or from `owner`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from soilml.config.case import Case, take_case
from soilml.config.model_settings import UNNAMED_GEAR
from soilml.errors import InputError, TableError
from soilml.io.table import Table, fault_of_text
from soilml.io.toml_settings import Settings
from soilml.quantities import QUANTITIES

#: Relative difference up to which two sizes of a gear count as equal: they are measured, and
#: written with three digits.
SIZE_TOLERANCE = 0.005
VALUE_TOLERANCE = 0.001  # The same for other values, which are copied from file to file
OWNER = "the model file"  # What a case is called in a difference


def recipe_content(text: str, source: str) -> dict[str, Any]:
    """A recipe in JSON as nested dictionaries; {} for data that were not simulated.

    Raises `InputError` for a text that is not a recipe; `source` names the file that holds it.
    """
    try:
        content = json.loads(text, parse_int=float)
    except (ValueError, RecursionError):
        content = None
    effects = content.get("effect", []) if isinstance(content, dict) else None
    # names are printed, also those that are not known here
    entries = effects if isinstance(effects, list) else [None]
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    named = all(isinstance(name, str) and not fault_of_text(name) for name in names)
    if not (isinstance(content, dict) and named):
        raise InputError(f"{source}: its recipe is damaged; generate or train it again")
    return content


def recipe_case(text: str, source: str) -> Case | None:
    """The case of a recipe in JSON; None for the empty recipe of data that were not simulated.

    Raises `InputError` for a text that is not a recipe; `source` names the file that holds it.
    """
    content = recipe_content(text, source)
    return take_case(Settings(content, f"recipe of {source}")) if content else None


def check_wheel_columns(
    table: Table, sizes: Mapping[str, float | None], owner: str, hint: str
) -> None:
    """Raise `TableError` where a column wheel_radius_m or wheel_width_m has another size.

    `sizes` are radius and width (m) as `owner` has them; None or missing where it has none.
    """
    for name in ("radius", "width"):
        key, size = QUANTITIES[f"wheel_{name}"].column, sizes.get(name)
        if key not in table or size is None:
            continue
        wrong = np.abs(table[key] / size - 1.0) > SIZE_TOLERANCE
        if wrong.any():
            row = int(np.argmax(wrong))
            raise TableError(
                f"{table.place(row)}, column {key}: {table[key][row]:g} given, {owner} {size:g}; "
                f"{hint}"
            )


def check_wheel_size(case: Case, table: Table) -> None:
    """Raise `TableError` for a table whose gears, or their sizes, are not those of the case.

    Also for a sinkage that a gear of this size cannot have.
    """
    names = np.unique(table["gear"]) if "gear" in table else np.asarray([""])
    if case.gears:
        _check_gear_names(case, table)
        for name in names:
            rows = table.rows(table["gear"] == name) if "gear" in table else table
            check_wheel_size(case.of_gear(name or UNNAMED_GEAR), rows)
        return
    if names.size > 1:
        raise TableError(
            f"{table.source}: column gear names {', '.join(filter(None, names))}, and the model "
            "has one gear; write each as [gears.NAME], or select rows with --gear NAME"
        )
    key, diameter = QUANTITIES["sinkage"].column, 2.0 * float(case.model.gear.radius)
    if key in table and (wrong := np.abs(table[key]) > diameter).any():  # it is not in metres
        row = int(np.argmax(wrong))
        raise TableError(
            f"{table.place(row)}, column {key}: {table[key][row]:g} given, more than the diameter "
            f"of the gear, {diameter:g} m; convert it to m"
        )
    sizes = {name: getattr(case.model.gear, name, None) for name in ("radius", "width")}
    hint = "select rows with --where run=NAME, or correct [gear]"
    check_wheel_columns(table, sizes, "the model's wheel has", hint)


def _check_gear_names(case: Case, table: Table) -> None:
    """Raise `TableError` for a row whose gear is not among the several gears of a case."""
    known = ", ".join(case.gears)
    if "gear" not in table:
        if UNNAMED_GEAR not in case.gears:
            raise TableError(
                f"{table.source}: column gear is missing; the model file has several gears: {known}"
            )
        return
    named = np.where(table["gear"] == "", UNNAMED_GEAR, table["gear"])
    if (wrong := ~np.isin(named, list(case.gears))).any():
        row = int(np.argmax(wrong))
        given = f"{str(table['gear'][row])!r} given" if table["gear"][row] else "the cell is blank"
        raise TableError(
            f"{table.place(row)}, column gear: {given}; the model file has the gears {known}"
        )


def gear_differences(case: Case, other: Case, owner: str = OWNER) -> Iterator[str]:
    """Differences of type and dimensions of the gear; a dimension that varies is not compared."""
    own, others = case.model.gear.name, other.model.gear.name
    if type(case.model.gear) is not type(other.model.gear):
        yield f"gear type {others!r}, {owner} has {own!r}"
        return
    yield from value_differences(case, other, ("gear",), owner)


def value_differences(
    case: Case, other: Case, kinds: Sequence[str] = ("soil", "effects"), owner: str = OWNER
) -> Iterator[str]:
    """Differences of the fixed values of `kinds`: gear, soil, effects.

    What `other` varies has no value.
    """
    values = other.parameters()
    for path, (_, value) in case.parameters().items():
        kind = "soil" if "." not in path else "gear" if path.startswith("gear.") else "effects"
        tolerance = SIZE_TOLERANCE if kind == "gear" else VALUE_TOLERANCE
        fixed = kind in kinds and path in values and path not in other.prior
        if fixed and not _is_close(value, values[path][1], tolerance):
            yield f"{path} {values[path][1]:g}, {owner} has {value:g}"


def effect_differences(case: Case, other: Case, owner: str = OWNER) -> Iterator[str]:
    """The effects of both, where their names differ."""
    own, others = ({effect.name for effect in c.model.effects} for c in (case, other))
    if own != others:
        shown = [", ".join(sorted(names)) or "none" for names in (others, own)]
        yield f"effects {shown[0]}, {owner} has {shown[1]}"


def prior_differences(
    case: Case, other: Case, names: Sequence[str], owner: str = OWNER
) -> Iterator[str]:
    """Differences of the priors of these parameters, where the case has one."""
    for name in names:
        own, others = case.prior.get(name), other.prior.get(name)
        if own is None:
            continue
        if others is None:
            yield f"no prior of {name}, {owner} has {own.as_setting()}"
        elif own.log != others.log or not (
            _is_close(own.lower, others.lower, VALUE_TOLERANCE)
            and _is_close(own.upper, others.upper, VALUE_TOLERANCE)
        ):
            yield f"prior {others.as_setting()} of {name}, {owner} has {own.as_setting()}"


def _is_close(a: float, b: float, tolerance: float) -> bool:
    return abs(a - b) <= tolerance * max(abs(a), abs(b))
