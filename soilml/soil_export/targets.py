"""The programs that soils are written for: what they take, by which equation, what they ignore."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from soilml.errors import InputError
from soilml.report.page import json_text

Values = Mapping[str, float]


@dataclass(frozen=True)
class MappedParameter:
    """A parameter of a program that follows from the soil.

    `soil` are the parameters of `Soil` that it is made of; `value` computes it from them, in SI.
    """

    name: str
    unit: str
    equation: str
    soil: tuple[str, ...]
    value: Callable[[Values], float]


@dataclass(frozen=True)
class FixedParameter:
    """A parameter of a program that no wheel test reveals, with its value and the reason for it."""

    name: str
    unit: str
    value: float
    reason: str


@dataclass(frozen=True)
class SoilTarget:
    """A program, or a part of one.

    name: What `--to` takes.
    program: What it is, with the version or file that was read.
    sources: Addresses of the documentation that units and equations are taken from.
    mapped, fixed: Its parameters.
    ignored: Why it has no use for parameters of the soil, by name.
    files: By name, in which `{}` stands for the label of a draw: a text with values by the
        program's names, or what makes one of them.
    loading: How the program reads the files.
    lost: What of the wheel's behaviour the program cannot show, in sentences.
    check: Raises `InputError` for values that the program would misread.
    """

    name: str
    program: str
    sources: tuple[str, ...]
    mapped: tuple[MappedParameter, ...]
    fixed: tuple[FixedParameter, ...]
    ignored: dict[str, str]
    files: Mapping[str, str | Callable[[Values], str]]
    loading: str
    lost: tuple[str, ...]
    check: Callable[[Values], None] = lambda values: None

    def written(self, values: Values, label: str = "") -> dict[str, str]:
        """The text of each file by its name."""
        return {
            name.format(label): text.format(**values) if isinstance(text, str) else text(values)
            for name, text in self.files.items()
        }

    @property
    def units(self) -> dict[str, str]:
        """The unit of each parameter."""
        mapped = {own.name: own.unit for own in self.mapped}
        return mapped | {own.name: own.unit for own in self.fixed}

    def values(self, soil: Values) -> dict[str, float]:
        """Every parameter by the program's name and in its unit.

        Raises `InputError` for a value that the program would not take as meant.
        """
        found = {own.name: own.value(soil) for own in self.mapped}
        found |= {own.name: own.value for own in self.fixed}
        self.check(found)
        return found


def _same(name: str, unit: str, soil: str, equation: str) -> MappedParameter:
    return MappedParameter(name, unit, equation, (soil,), lambda v: v[soil])


_DEGREES = (
    "deg", "180/pi friction_angle, of Mohr-Coulomb: tau_max = c + sigma tan(phi)", math.degrees
)  # fmt: skip


def _angle(name: str, unit: str, equation: str, value: Callable[[float], float]) -> MappedParameter:
    """A function of the friction angle."""
    of_angle = ("friction_angle",)
    return MappedParameter(name, unit, equation, of_angle, lambda v: value(v["friction_angle"]))


_STRESS_ANGLE = "the pressure along the contact follows from depth, without an angle of its own"
_CHRONO = "https://github.com/projectchrono/chrono/blob/main/"

_SCM_KEYS = {
    "Bekker_Kphi": "Bekker Kphi", "Bekker_Kc": "Bekker Kc", "Bekker_n": "Bekker n",
    "Mohr_cohesion": "Mohr Cohesion", "Mohr_friction": "Mohr Friction",
    "Janosi_shear": "Janosi Shear", "elastic_K": "Elastic K", "damping_R": "Dampening R",
}  # fmt: skip


def _scm(values: Values) -> str:
    content = {
        "Name": "Soil by soilml",
        "Type": "Terrain Properties",
        "Template": "SCM Soil Parameters",
        "Soil Parameters": {key: values[name] for name, key in _SCM_KEYS.items()},
    }
    return json_text(content)


_GAZEBO_PLUGIN = """\
soilml:
  k: 0.0
  k_c: {k_c:.9g}
  k_phi: {k_phi:.9g}
  c: {c:.9g}
  phi: {phi:.9g}
  K: {K:.9g}
  rho: {rho:.9g}
  n: {n:.9g}
"""


def _check_gazebo(values: Values) -> None:
    if values["k_phi"] == 0.0:
        raise InputError(
            "kphi is 0; gz-terramechanics computes its modulus from k_c and k_phi only where k_phi "
            "is not 0: give kphi, which with kc / width carries the wheel"
        )


def _check_chrono(values: Values) -> None:
    if values["Bekker_Kphi"] >= values["elastic_K"]:
        raise InputError(
            f"kphi is {values['Bekker_Kphi']:g}; chrono needs it below elastic_K, "
            f"{values['elastic_K']:g} Pa/m: this soil is stiffer than its elastic unloading"
        )


_CHRONO_SCM = SoilTarget(
    name="chrono",
    program="Project Chrono, deformable terrain SCM (`SCMTerrain::SetSoilParameters`)",
    sources=(
        f"{_CHRONO}src/chrono_vehicle/terrain/SCMTerrain.h",
        f"{_CHRONO}src/chrono_vehicle/terrain/SCMTerrain.cpp",
        f"{_CHRONO}src/chrono_vehicle/wheeled_vehicle/test_rig/ChWheelTestRig.cpp",
    ),
    mapped=(
        _same("Bekker_Kphi", "N/m^(n+2)", "kphi", "kphi, of sigma = (Kc/b + Kphi) z^n"),
        _same("Bekker_Kc", "N/m^(n+1)", "kc", "kc; 1/b is perimeter / (2 area) of the contact"),
        _same("Bekker_n", "1", "n", "n"),
        _same("Mohr_cohesion", "Pa", "cohesion", "cohesion, of tau_max = c + sigma tan(phi)"),
        _angle("Mohr_friction", *_DEGREES),
        _same("Janosi_shear", "m", "shear_modulus", "K, of tau = tau_max (1 - exp(-j/K))"),
    ),
    fixed=(
        FixedParameter(
            "elastic_K", "Pa/m", 2e8,
            "unloading was not measured; 2e8 is what Chrono's own ChWheelTestRig sets",
        ),
        FixedParameter(
            "damping_R", "Pa s/m", 3e4,
            "damping was not measured; 3e4 is what Chrono's own ChWheelTestRig sets",
        ),
    ),
    ignored={
        **dict.fromkeys(("a0", "a1"), _STRESS_ANGLE),
        "unit_weight": "SCM has no weight of the soil; bulldozing has parameters of its own",
    },
    files={"scm_soil{}.json": _scm},
    loading="""\
import json
soil = json.load(open("scm_soil.json"))["Soil Parameters"]
terrain.SetSoilParameters(*soil.values())  # in the order of the file, before Initialize""",
    lost=(
        "SCM has no angle of maximum stress: pressure follows from the depth of each node.",
        "Its width b is that of the contact patch, not that of the wheel: with kc other than 0, "
        "the pressure at one depth differs.",
        "Below elastic_K times depth, pressure is elastic; damping_R acts on all vertical motion.",
    ),
    check=_check_chrono,
)  # fmt: skip

_GAZEBO = SoilTarget(
    name="gazebo",
    program="Gazebo: soil_params.yaml of gz-terramechanics",
    sources=(
        "https://github.com/unitsSpaceLab/gz-terramechanics/blob/main/config/soil_params.yaml",
        "https://github.com/unitsSpaceLab/gz-terramechanics/blob/main/src/TerramechanicsSystem.cc",
    ),
    mapped=(
        _same("k_c", "N/m^(n+1)", "kc", "kc; the plugin takes k = k_c / b + k_phi"),
        _same("k_phi", "N/m^(n+2)", "kphi", "kphi"),
        _same("c", "Pa", "cohesion", "cohesion"),
        _angle("phi", *_DEGREES),
        _same("K", "m", "shear_modulus", "K, of tau = (c + sigma tan(phi)) (1 - exp(-j/K))"),
        _same("rho", "N/m^3", "unit_weight", "unit_weight: rho is a weight, for bulldozing"),
        _same("n", "1", "n", "n"),
    ),
    fixed=(),
    ignored=dict.fromkeys(
        ("a0", "a1"), "gz-terramechanics puts the maximum stress at half the entry angle"
    ),
    files={"soil_params{}.yaml": _GAZEBO_PLUGIN},
    loading="""\
Copy soil_params.yaml into the folder config_path of the plugin gz-terramechanics, and name the
soil in terrain_mapping.yaml: default_soil: soilml. Its wheels have no friction of their own.""",
    lost=(
        "The plugin's stress is largest at theta_1 / 2, that of the fit at (a0 + a1 s) theta_1.",
    ),
    check=_check_gazebo,
)

#: Every target by the name that `--to` takes.
TARGETS: dict[str, SoilTarget] = {target.name: target for target in (_CHRONO_SCM, _GAZEBO)}
