"""The forward model for the sliders: curves against slip, and the stresses under the wheel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.config.case import Case
from soilml.physics.forces import apply_input_effects
from soilml.physics.gears.linear_wheel import LinearWheel
from soilml.physics.operating_point import Operating
from soilml.row_status import Status
from soilml.serve.answers.chosen_case import forward_case, with_sliders

#: Slips of the curves when driving, and the braking ones, which are added where the wheel brakes.
DRIVING = np.linspace(0.0, 0.9, 46)
BRAKING = np.linspace(-0.9, -0.02, 45)
#: Points along the contact, and fewest of a profile that is drawn.
POINTS, FEWEST_POINTS = 97, 8


def forward(request: dict[str, Any]) -> dict[str, Any]:
    """Curves of torque (N m), pull (N) and sinkage (mm) over slip, and the stresses (kPa).

    Parameters
    ----------
    request
        `wheel`, `soil` or `model` as in `forward_case`, and `values` in SI units by path, with
        `slip` and `load`.

    Raises
    ------
    InputError
        For a value outside its bounds; the line begins with its path.
    """
    case, at = with_sliders(forward_case(request), request)
    slip, load = at.get("slip", 0.3), at.get("load", 60.0)
    grid = np.concatenate([BRAKING, DRIVING]) if slip < 0.0 else DRIVING
    slips = np.append(grid, slip)
    force = case.model(case.soil, Operating(slip=slips, load=load))
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
        "profile": None,
        "gear": case.model.gear.name,
        "radius": float(getattr(case.model.gear, "radius", np.nan)),
    }
    answer["at"] |= {"slip": slip, "load": load, "pull_per_load": curves["pull"][-1] / load}
    if status is Status.OK:
        profile = _profile(case, slip, load)
        answer["profile"] = profile
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
