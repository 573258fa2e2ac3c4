"""The forward model of the page: its sliders, curves against slip, stresses under the wheel."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isfinite, radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case, read_case
from soilml.errors import InputError
from soilml.fitting.predictions import forces_of_one_gear
from soilml.parameters import Parameter, declared
from soilml.physics.effects import EFFECTS, Effect
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears import Track, Wheel
from soilml.physics.gears.base import Gear
from soilml.physics.model import Model
from soilml.physics.operating_point import Operating
from soilml.physics.soils import soil, soil_catalogue
from soilml.report.numbers import pretty, round_significant, shown_unit
from soilml.row_status import Status
from soilml.serve.job_commands import MODEL_FILE

#: Slips of the curves when driving, and the braking ones, which are added where the wheel brakes.
DRIVING = np.linspace(0.0, 0.9, 46)
BRAKING = np.linspace(-0.9, -0.02, 45)
POINTS, FEWEST_POINTS = 97, 8  # Points along the contact, and fewest of a profile that is drawn
_DIGITS = 4  # Digits of the ends of a slider
_REACH = 2.5  # Reference sizes of an effect up to which its slider reaches
#: Running gears of the page by name, with the load (N) that each typically carries.
GEARS: dict[str, tuple[Gear, float]] = {
    "wheel": (Wheel(radius=0.15, width=0.12), 60.0),
    "track": (Track(radius=0.1, width=0.08, base=0.6), 637.6),
}
FIRST_SOIL, FIRST_SLIP = "wong1989/dry_sand", 0.3  # What the page shows first
#: Kinds of effects that the page offers; those of sensors belong to a log.
OFFERED_KINDS = ("soil", "wheel", "rig")


@dataclass(frozen=True)
class Slider:
    """A range to slide in, in SI units; a text below it."""

    label: str
    symbol: str
    ends: tuple[float, float]
    log: bool = False
    text: str = ""


#: Sliders by group and path; a parameter that the case lacks has none.
_GROUPS: dict[str, dict[str, Slider]] = {
    "Operating point": {
        "slip": Slider("Slip", "s", (-0.9, 0.95), text="driving above zero, braking below"),
        "load": Slider("Vertical load", "W", (5.0, 5000.0), log=True),
    },
    "Strength of the soil": {
        "cohesion": Slider("Cohesion", "c", (0.0, 1e4)),
        "friction_angle": Slider("Friction angle", "φ", (radians(10.0), radians(50.0))),
        "shear_modulus": Slider("Shear modulus", "K", (0.001, 0.1), log=True,
                                text="how far soil is sheared until its strength is mobilised"),
    },
    "Bearing of the soil": {
        "kphi": Slider("Frictional modulus", "kφ", (1e4, 1e8), log=True),
        "kc": Slider("Cohesive modulus", "kc", (0.0, 1e5)),
        "n": Slider("Exponent of sinkage", "n", (0.3, 2.0)),
        "a0": Slider("Place of the largest stress", "a₀", (0.1, 0.8),
                     text="as a share of the entry angle, at no slip"),
        "a1": Slider("Its growth with slip", "a₁", (0.0, 0.5)),
    },
    "Gear": {
        "gear.radius": Slider("Radius", "r", (0.02, 0.5), log=True),
        "gear.width": Slider("Width", "b", (0.01, 0.5), log=True),
        "gear.base": Slider("Length between axles", "l", (0.1, 2.0), log=True),
    },
}  # fmt: skip


def choices() -> dict[str, Any]:
    """The lists of the page."""
    from soilml import __version__

    soils = []
    for name, entry in soil_catalogue().items():
        assumed = f"; assumed: {', '.join(entry.assumed)}" if entry.assumed else ""
        label = f"{entry.text} – {name}"
        soils.append({"id": name, "label": label, "note": f"{entry.source}{assumed}"})
    gears = [{"id": name, "label": name.capitalize()} for name in GEARS]
    return {"version": __version__, "wheels": gears, "soils": soils, "first": FIRST_SOIL}


def controls(request: dict[str, Any]) -> dict[str, Any]:
    """The sliders of the chosen gear and soil, in groups, with their values in SI units.

    Raises `InputError` where the choice or the model file is wrong.
    """
    case = _case(request)
    load = 60.0 if request.get("model") else GEARS[request.get("wheel", "wheel")][1]
    at = {"slip": FIRST_SLIP, "load": load}
    known = case.parameters() | {name: (declared(Operating)[name], v) for name, v in at.items()}
    groups = {
        title: [_control(k, s, *known[k]) for k, s in sliders.items() if k in known]
        for title, sliders in _GROUPS.items()
    }
    groups["Effects"] = list(_effects(case))
    return {
        "gear": case.model.gear.name,
        "groups": [{"title": title, "controls": own} for title, own in groups.items() if own],
    }


def _effects(case: Case) -> Iterator[dict[str, Any]]:
    """The size of each effect, from its default to a few times what matters on a small rover."""
    known = case.parameters()
    for effect in case.model.effects:
        size = effect.about.size
        path = f"{effect.name}.{size}"
        if path not in known:
            continue
        parameter, value = known[path]
        default = float(getattr(type(effect)(), size))
        far = default + _REACH * (effect.about.reference[size] - default)
        low, high = sorted((default, far))
        if effect.about.kind == "rig":  # a slope may fall, a transfer may lift
            low = min(low, -high)
        low, high = (min(max(v, parameter.lower), parameter.upper) for v in (low, high))
        name = effect.name.replace("-", " ").capitalize()
        yield _control(
            path, Slider(name, "", (low, high), text=effect.about.text), parameter, value
        )


def _control(path: str, slider: Slider, parameter: Parameter, value: Any) -> dict[str, Any]:
    """A slider as the page takes it; the value is in SI units, all else in the shown unit."""
    value = float(value)
    factor, unit = shown_unit(parameter.unit, slider.ends[1])
    low, high = (factor * end for end in slider.ends)
    low, high = min(low, factor * value), max(high, factor * value)
    return {
        "path": path,
        "label": slider.label,
        "symbol": slider.symbol,
        "unit": pretty(unit),
        "factor": factor,
        "min": round_significant(max(low, 1e-9) if slider.log else low, _DIGITS),
        "max": round_significant(high, _DIGITS),
        "least": factor * parameter.lower,
        "most": factor * parameter.upper,
        "log": slider.log,
        "text": slider.text,
        "value": value,
    }


def forward(request: dict[str, Any]) -> dict[str, Any]:
    """Curves of torque (N m), pull (N) and sinkage (mm) over slip, and the stresses (kPa).

    request: `wheel` and `soil`, or the text `model`; and `values` in SI units by path, with `slip`
        and `load`.

    Raises `InputError` for a value outside its bounds; the line begins with its path.
    """
    case, slip, load = _with_sliders(_case(request), request)
    grid = np.concatenate([BRAKING, DRIVING]) if slip < 0.0 else DRIVING
    force = forces_of_one_gear(case, Operating(slip=np.append(grid, slip), load=load))
    curves = {
        "torque": _digits(force.torque),
        "pull": _digits(force.drawbar_pull),
        "sinkage": _digits(1e3 * np.asarray(force.sinkage)),
    }
    status = Status(int(np.asarray(force.status)[-1]))
    here = {name: values[-1] for name, values in curves.items()}
    return {
        "slip": _digits(grid),
        **{name: values[:-1] for name, values in curves.items()},
        "at": {**here, "slip": slip, "load": load, "pull_per_load": here["pull"] / load},
        "reason": "" if status is Status.OK else status.reason,
        "profile": _profile(case, slip, load) if status is Status.OK else None,
        "gear": case.model.gear.name,
        "radius": float(getattr(case.model.gear, "radius", np.nan)),
    }


def _profile(case: Case, slip: float, load: float) -> dict[str, Any] | None:
    """Stresses from entry to exit, and the shear strength under the normal stress, kPa.

    None for a closed form, which has no profile to draw.
    """
    at = Operating(slip=slip, load=load)
    found = case.model.profile(case.soil, at, POINTS)
    angle, normal, shear = (np.asarray(v) for v in (found.angle, found.normal, found.shear))
    if len(angle) < FEWEST_POINTS:
        return None
    ground = apply_input_effects(case.model.load_case(case.soil, at)[0]).soil
    strength = np.ravel(ground.cohesion) + normal * np.tan(np.ravel(ground.friction_angle))
    used = float(np.trapezoid(np.abs(shear), -angle) / np.trapezoid(strength, -angle))
    return {
        "angle": _digits(np.rad2deg(angle)),
        "normal": _digits(1e-3 * normal),
        "shear": _digits(1e-3 * shear),
        "strength": _digits(1e-3 * strength),
        "mobilised": used,
    }


def _digits(values: Any) -> list[float]:
    """Numbers of six digits, which is more than a picture shows and less to send."""
    found: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    return [float(f"{value:.6g}") for value in found]


def _case(request: dict[str, Any]) -> Case:
    """The case of one gear, the first where a file has several, with every effect on offer.

    Effects that the case lacks are added with their default parameters, which change nothing.
    Raises `InputError` for an unknown name or a bad file.
    """
    text, gear, name = (
        request.get(key, first)
        for key, first in (("model", ""), ("wheel", "wheel"), ("soil", FIRST_SOIL))
    )
    if isinstance(text, str) and text.strip():
        case = case_of_text(text)
    else:
        if not isinstance(gear, str) or gear not in GEARS:
            raise InputError(f"no wheel {gear!r}; there are: {', '.join(GEARS)}")
        if not isinstance(name, str):
            raise InputError("soil: needed is the name of a soil")
        case = Case(Model(GEARS[gear][0]), soil(name))
    if case.gears:
        case = case.of_gear(next(iter(case.gears)))
    own = {effect.name for effect in case.model.effects}
    added = [effect() for effect in _offered(case.model.gear) if effect.name not in own]
    return replace(case, model=replace(case.model, effects=(*case.model.effects, *added)))


@lru_cache(maxsize=16)
def case_of_text(text: str) -> Case:
    """The case of the text of a model file; errors name `MODEL_FILE`."""
    with tempfile.TemporaryDirectory(prefix="soilml-model-") as folder:
        path = Path(folder) / MODEL_FILE
        path.write_text(text, encoding="utf-8")
        try:
            return read_case(path, with_bias=True, names_files=False, with_explanations=True)
        except InputError as error:
            raise InputError(str(error).replace(str(path), MODEL_FILE)) from None


def _offered(gear: Gear) -> list[type[Effect]]:
    """Effects of the catalogue that need nothing but slip and load on this gear."""
    return [
        effect
        for effect in EFFECTS.values()
        if effect.about.kind in OFFERED_KINDS
        and not effect.about.needs
        and (not effect.gear_types or isinstance(gear, effect.gear_types))
    ]


def _with_sliders(case: Case, request: dict[str, Any]) -> tuple[Case, float, float]:
    """The case with the sliders' values, without effects at their defaults; slip and load.

    Raises `InputError` for values that are no numbers, unknown or outside their bounds.
    """
    given = request.get("values") or {}
    if not isinstance(given, dict):
        raise InputError("values: needed are numbers by name")
    for path, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise InputError(f"{path}: needed is a number")
    values = {str(path): float(value) for path, value in given.items()}
    slip, load = values.pop("slip", FIRST_SLIP), values.pop("load", 60.0)
    case = case.with_values(values)
    needed = tuple(effect for effect in case.model.effects if effect != type(effect)())
    return replace(case, model=replace(case.model, effects=needed)), slip, load
