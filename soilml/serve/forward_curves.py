"""The forward model: its sliders, curves against slip, and the stresses under the wheel."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.fitting.predictions import forces_of_one_gear
from soilml.parameters import Parameter, declared
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears.linear_wheel import LinearWheel
from soilml.physics.operating_point import Operating
from soilml.row_status import Status
from soilml.serve.chosen_case import FIRST_WHEEL, WHEELS, forward_case, with_sliders

#: Slips of the curves when driving, and the braking ones, which are added where the wheel brakes.
DRIVING = np.linspace(0.0, 0.9, 46)
BRAKING = np.linspace(-0.9, -0.02, 45)
POINTS, FEWEST_POINTS = 97, 8  # Points along the contact, and fewest of a profile that is drawn
_DIGITS = 4  # Digits of a value on the page
_REACH = 2.5  # Reference sizes of an effect up to which its slider reaches


@dataclass(frozen=True)
class Slider:
    """A range to slide in, in the shown unit, which is `factor` times the SI unit."""

    label: str
    symbol: str
    unit: str
    factor: float
    ends: tuple[float, float]
    log: bool = False
    text: str = ""


#: Sliders by group and path; a parameter that the case lacks has none.
_GROUPS: dict[str, dict[str, Slider]] = {
    "Operating point": {
        "slip": Slider("Slip", "s", "", 1.0, (-0.9, 0.95),
                       text="driving above zero, braking below"),
        "load": Slider("Vertical load", "W", "N", 1.0, (5.0, 5000.0), log=True),
    },
    "Strength of the soil": {
        "cohesion": Slider("Cohesion", "c", "kPa", 1e-3, (0.0, 10.0)),
        "friction_angle": Slider("Friction angle", "φ", "°", 180.0 / pi, (10.0, 50.0)),
        "shear_modulus": Slider("Shear modulus", "K", "mm", 1e3, (1.0, 100.0), log=True,
                                text="how far soil is sheared until its strength is mobilised"),
    },
    "Bearing of the soil": {
        "kphi": Slider("Frictional modulus", "kφ", "MN/mⁿ⁺²", 1e-6, (0.01, 100.0), log=True),
        "kc": Slider("Cohesive modulus", "kc", "kN/mⁿ⁺¹", 1e-3, (0.0, 100.0)),
        "n": Slider("Exponent of sinkage", "n", "", 1.0, (0.3, 2.0)),
        "a0": Slider("Place of the largest stress", "a₀", "", 1.0, (0.1, 0.8),
                     text="as a share of the entry angle, at no slip"),
        "a1": Slider("Its growth with slip", "a₁", "", 1.0, (0.0, 0.5)),
    },
    "Wheel": {
        "gear.radius": Slider("Radius", "r", "mm", 1e3, (20.0, 500.0), log=True),
        "gear.width": Slider("Width", "b", "mm", 1e3, (10.0, 500.0), log=True),
        "gear.base": Slider("Length between axles", "l", "mm", 1e3, (100.0, 2000.0), log=True),
    },
}  # fmt: skip
#: Shown units of what has no slider above.
_UNITS = {"Pa": ("kPa", 1e-3), "rad": ("°", 180.0 / pi), "m": ("mm", 1e3), "1": ("", 1.0)}


def controls(request: dict[str, Any]) -> dict[str, Any]:
    """The sliders of the chosen wheel and soil, in groups, with their values in SI units.

    Raises `InputError` where the choice or the model file is wrong.
    """
    case = forward_case(request)
    wheel = request.get("wheel", FIRST_WHEEL)
    at = {"slip": 0.3, "load": 60.0 if request.get("model") else WHEELS[wheel].load}
    known = case.parameters() | {name: (declared(Operating)[name], v) for name, v in at.items()}
    groups = {
        title: [_control(k, s, *known[k]) for k, s in sliders.items() if k in known]
        for title, sliders in _GROUPS.items()
    }
    if case.model.gear.name == "track":
        groups["Track"] = groups.pop("Wheel")
    groups["Effects"] = list(_effects(case))
    return {
        "gear": case.model.gear.name,
        "groups": [{"title": title, "controls": own} for title, own in groups.items() if own],
    }


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
        slider = Slider(name, "", unit, factor, (low, high), text=effect.about.text)
        yield _control(path, slider, parameter, float(value)) | {"neutral": default}


def _control(path: str, slider: Slider, parameter: Parameter, value: float) -> dict[str, Any]:
    """A slider as the page takes it; the value is in SI units, all else in the shown unit."""
    shown = slider.factor * float(value)
    low, high = min(slider.ends[0], shown), max(slider.ends[1], shown)
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


def forward(request: dict[str, Any]) -> dict[str, Any]:
    """Curves of torque (N m), pull (N) and sinkage (mm) over slip, and the stresses (kPa).

    request: `wheel`, `soil` or `model` as in `forward_case`, and `values` in SI units by path, with
        `slip` and `load`.

    Raises `InputError` for a value outside its bounds; the line begins with its path.
    """
    case, at = with_sliders(forward_case(request), request)
    slip, load = at.get("slip", 0.3), at.get("load", 60.0)
    grid = np.concatenate([BRAKING, DRIVING]) if slip < 0.0 else DRIVING
    slips = np.append(grid, slip)
    force = forces_of_one_gear(case, Operating(slip=slips, load=load))
    curves = {
        "torque": _digits(force.torque),
        "pull": _digits(force.drawbar_pull),
        "sinkage": _digits(1e3 * np.asarray(force.sinkage)),
    }
    status = Status(int(np.asarray(force.status)[-1]))
    answer: dict[str, Any] = {
        "slip": _digits(grid),
        **{name: values[:-1] for name, values in curves.items()},
        "at": {name: values[-1] for name, values in curves.items()},
        "reason": "" if status is Status.OK else status.reason,
        "profile": _profile(case, slip, load) if status is Status.OK else None,
        "gear": case.model.gear.name,
        "radius": float(getattr(case.model.gear, "radius", np.nan)),
    }
    answer["at"] |= {"slip": slip, "load": load, "pull_per_load": curves["pull"][-1] / load}
    return answer


def _profile(case: Case, slip: float, load: float) -> dict[str, Any] | None:
    """Stresses from entry to exit, and the shear strength under the normal stress, kPa."""
    at = Operating(slip=slip, load=load)
    found = case.model.profile(case.soil, at, POINTS)
    angle, normal, shear = (np.asarray(v) for v in (found.angle, found.normal, found.shear))
    soil = apply_input_effects(case.model.load_case(case.soil, at)[0]).soil
    if isinstance(case.model.gear, LinearWheel):
        peak_share = float(np.ravel(soil.a0)[0] + np.ravel(soil.a1)[0] * slip)
        angle, normal, shear = _straight_lines(angle, normal, shear, peak_share)
    elif len(angle) < FEWEST_POINTS:  # a closed form, which has no profile to draw
        return None
    strength = np.ravel(soil.cohesion) + normal * np.tan(np.ravel(soil.friction_angle))
    used = float(np.trapezoid(np.abs(shear), -angle) / np.trapezoid(strength, -angle))
    return {
        "angle": _digits(np.rad2deg(angle)),
        "normal": _digits(1e-3 * normal),
        "shear": _digits(1e-3 * shear),
        "strength": _digits(1e-3 * strength),
        "mobilised": used,
    }


def _straight_lines(
    angle: NDArray[np.float64],
    normal: NDArray[np.float64],
    shear: NDArray[np.float64],
    peak_share: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Stresses (points,) along straight lines, of those at exit and maximum (2,).

    They go from entry, where there is none, to exit; the maximum is at this share of the entry
    angle.
    """
    leave, peak = float(angle[0]), float(angle[1])
    corners = np.array([leave, peak, peak / peak_share])
    half = POINTS // 2 + 1
    path = np.concatenate(
        [np.linspace(corners[2], peak, half), np.linspace(peak, leave, POINTS - half + 1)[1:]]
    )
    lines = (np.interp(path, corners, [*values, 0.0]) for values in (normal, shear))
    return path, *lines


def _digits(values: Any) -> list[float]:
    """Numbers of six digits, which is more than a picture shows and less to send."""
    found: NDArray[np.float64] = np.asarray(values, dtype=np.float64)
    return [float(f"{value:.6g}") for value in found]
