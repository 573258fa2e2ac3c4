"""The sliders of the page: what can be moved, in which unit, and how far."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

from soilml.config.case import Case
from soilml.parameters import Parameter, declared
from soilml.physics.operating_point import Operating
from soilml.serve.answers.choices import FIRST_WHEEL, WHEELS
from soilml.serve.answers.chosen_case import forward_case

#: Digits of a value on the page.
_DIGITS = 4
#: Reference sizes of an effect up to which its slider reaches.
_REACH = 2.5


@dataclass(frozen=True)
class Slider:
    """A range to slide in, in the shown unit, which is `factor` times the SI unit."""

    label: str
    symbol: str
    unit: str
    factor: float
    lower: float
    upper: float
    log: bool = False
    text: str = ""


_OPERATING = {
    "slip": Slider("Slip", "s", "", 1.0, -0.9, 0.95, text="driving above zero, braking below"),
    "load": Slider("Vertical load", "W", "N", 1.0, 5.0, 5000.0, True),
}
_STRENGTH = {
    "cohesion": Slider("Cohesion", "c", "kPa", 1e-3, 0.0, 10.0),
    "friction_angle": Slider("Friction angle", "φ", "°", 180.0 / pi, 10.0, 50.0),
    "shear_modulus": Slider("Shear modulus", "K", "mm", 1e3, 1.0, 100.0, True,
                            text="how far soil is sheared until its strength is mobilised"),
}  # fmt: skip
_BEARING = {
    "kphi": Slider("Frictional modulus", "kφ", "kN/mⁿ⁺²", 1e-3, 10.0, 1e5, True),
    "kc": Slider("Cohesive modulus", "kc", "kN/mⁿ⁺¹", 1e-3, 0.0, 100.0),
    "n": Slider("Exponent of sinkage", "n", "", 1.0, 0.3, 2.0),
    "a0": Slider("Place of the largest stress", "a₀", "", 1.0, 0.1, 0.8,
                 text="as a share of the entry angle, at no slip"),
    "a1": Slider("Its growth with slip", "a₁", "", 1.0, 0.0, 0.5),
}  # fmt: skip
_GEAR = {
    "gear.radius": Slider("Radius", "r", "mm", 1e3, 20.0, 500.0, True),
    "gear.width": Slider("Width", "b", "mm", 1e3, 10.0, 500.0, True),
    "gear.base": Slider("Length between axles", "l", "mm", 1e3, 100.0, 2000.0, True),
}
#: Shown units of what has no slider above.
_UNITS = {"Pa": ("kPa", 1e-3), "rad": ("°", 180.0 / pi), "m": ("mm", 1e3), "1": ("", 1.0)}


def controls(request: dict[str, Any]) -> dict[str, Any]:
    """The sliders of the chosen wheel and soil, in groups, with their values in SI units.

    Raises `InputError` where the choice or the model file is wrong.
    """
    case = forward_case(request)
    known = case.parameters()
    wheel = request.get("wheel", FIRST_WHEEL)
    load = 60.0 if request.get("model") else WHEELS[wheel].load
    operating = declared(Operating)
    groups = [
        ("Operating point", [_control(k, s, operating[k], {"slip": 0.3, "load": load}[k])
                             for k, s in _OPERATING.items()]),
        ("Strength of the soil", _known(_STRENGTH, known)),
        ("Bearing of the soil", _known(_BEARING, known)),
        ("Track" if case.model.gear.name == "track" else "Wheel", _known(_GEAR, known)),
        ("Effects", list(_effects(case))),
    ]  # fmt: skip
    return {
        "gear": case.model.gear.name,
        "groups": [{"title": title, "controls": own} for title, own in groups if own],
    }


def _known(sliders: dict[str, Slider], known: dict[str, Any]) -> list[dict[str, Any]]:
    return [_control(k, s, *known[k]) for k, s in sliders.items() if k in known]


def _effects(case: Case) -> Any:
    """The size of each effect, from its default to a few times what matters on a small rover."""
    known = case.parameters()
    for effect in case.model.effects:
        size = effect.about.size
        path = f"{effect.name}.{size}"
        if path not in known:
            continue
        parameter, value = known[path]
        unit, factor = _UNITS.get(parameter.unit, (parameter.unit, 1.0))
        default = float(getattr(type(effect)(), size))
        far = default + _REACH * (effect.about.reference[size] - default)
        low, high = sorted((default, far))
        if effect.about.kind == "rig":  # a slope may fall, a transfer may lift
            low = min(low, -high)
        low, high = (factor * min(max(v, parameter.lower), parameter.upper) for v in (low, high))
        name = effect.name.replace("-", " ").capitalize()
        slider = Slider(name, "", unit, factor, low, high, text=effect.about.text)
        yield _control(path, slider, parameter, float(value)) | {"neutral": default}


def _control(path: str, slider: Slider, parameter: Parameter, value: float) -> dict[str, Any]:
    """A slider as the page takes it; the value is in SI units, all else in the shown unit."""
    shown = slider.factor * float(value)
    low, high = min(slider.lower, shown), max(slider.upper, shown)
    if slider.log:
        low = max(low, 1e-9)
    return {
        "path": path,
        "label": slider.label,
        "symbol": slider.symbol,
        "unit": slider.unit,
        "factor": slider.factor,
        "min": _short(low),
        "max": _short(high),
        "least": slider.factor * parameter.lower,
        "most": slider.factor * parameter.upper,
        "log": slider.log,
        "text": slider.text,
        "value": float(value),
    }


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
