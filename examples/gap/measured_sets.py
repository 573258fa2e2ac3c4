"""Published single-wheel tests as tables and model files, each with three sets of priors.

The tables are read from the folder that `SOILML_DATA` names; the project has no copy of them.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

Row = dict[str, str]
#: Radius and width of a wheel, m.
Size = tuple[float, float]

#: Priors that `soilml init` writes for a soil of which nothing is known, and priors that leave out
#: nothing physically possible. The published soil is in the narrow ones, which are of each set.
INIT = {
    "cohesion": "[0.0, 5000.0]",
    "friction_angle": "[0.35, 0.80]",
    "shear_modulus": '{ range = [0.003, 0.05], scale = "log" }',
    "kphi": '{ range = [2e5, 5e6], scale = "log" }',
    "n": "[0.6, 1.4]",
}
WIDE = {
    "cohesion": "[0.0, 10000.0]",
    "friction_angle": "[0.20, 1.0]",
    "shear_modulus": '{ range = [0.0005, 0.10], scale = "log" }',
    "kphi": '{ range = [2e4, 1e8], scale = "log" }',
    "n": "[0.4, 1.8]",
}
PRIORS = ("tight", "init", "wide")


@dataclass(frozen=True)
class MeasuredSet:
    """Rows of one or two wheels on one soil, and what is known of them.

    `soil` has published or typical values in SI; `tight` the prior ranges about them. `wheels` are
    by the name in the column `gear`, or one without a name. `noise` is that of tracing a printed
    curve, or of repeats. `soil_test` is a section of the model file.
    """

    name: str
    title: str
    file: str
    wanted: Callable[[Row], bool]
    rename: Mapping[str, str]
    run: Callable[[Row], str]
    wheels: Mapping[str, Size]
    gear: Callable[[Row], str]
    soil: Mapping[str, float]
    tight: Mapping[str, str]
    noise: Mapping[str, str]
    covariates: tuple[str, ...] = ()
    soil_test: str = ""


def table_text(measured: MeasuredSet, data: Path) -> str:
    """The rows of a set as the text of a table that `soilml gap` reads."""
    with (data / measured.file).open() as lines:
        rows = [row for row in csv.DictReader(lines) if measured.wanted(row)]
    names = ["slip", "load_N", "torque_Nm", *(n for n in measured.noise if n != "torque_Nm")]
    names += measured.covariates
    several = len(measured.wheels) > 1
    runs = _run_names(rows, measured.run)
    text = [",".join(["run", *(["gear"] if several else []), *names])]
    for run, row in zip(runs, rows, strict=True):
        cells = [row.get(measured.rename.get(n, n), "") for n in names]
        text.append(",".join([run, *([measured.gear(row)] if several else []), *cells]))
    return "\n".join(text) + "\n"


def _run_names(rows: list[Row], run: Callable[[Row], str]) -> list[str]:
    """A run for each name; rows at a slip that the run has already are of the next repeat."""
    seen: dict[tuple[str, str], int] = {}
    names = []
    for row in rows:
        place = run(row), f"{float(row['slip']):.1f}"
        seen[place] = seen.get(place, 0) + 1
        names.append(f"{place[0]}_{seen[place]}")
    return names


def model_text(measured: MeasuredSet, priors: str) -> str:
    """The text of a model file with these priors; `init`'s and the wide ones start elsewhere."""
    ranges = {"tight": measured.tight, "init": INIT, "wide": WIDE}[priors]
    lines = []
    for gear, (radius, width) in measured.wheels.items():
        section = f"gears.{gear}" if len(measured.wheels) > 1 else "gear"
        lines += [f"[{section}]", 'type = "wheel"', f"radius = {radius}", f"width = {width}", ""]
    if priors == "tight":
        lines += ["[soil]", *(f"{name} = {value}" for name, value in measured.soil.items())]
    else:
        lines += ["[soil]", 'name = "wong1989/dry_sand"']
    lines += ["", "[soil.prior]", *(f"{name} = {value}" for name, value in ranges.items())]
    lines += ["", measured.soil_test] if measured.soil_test else []
    lines += ["", "[noise]", *(f"{name} = {value}" for name, value in measured.noise.items())]
    return "\n".join(lines) + "\n"


def _one(row: Row) -> str:
    return ""


DING = {
    "load_N": "vertical_load_n",
    "torque_Nm": "meas_torque_nm",
    "drawbar_pull_N": "meas_drawbar_pull_n",
    "sinkage_m": "meas_sinkage_m",
}
#: Steps of the traced values; the modulus K of the authors is 11 mm.
DING_NOISE = {"torque_Nm": "0.1", "drawbar_pull_N": "0.5", "sinkage_m": "0.0005"}
DING_SOIL = {
    "cohesion": 250.0,
    "friction_angle": 0.557,
    "shear_modulus": 0.011,
    "kc": 15600.0,
    "kphi": 2407400.0,
    "n": 1.10,
}
DING_TIGHT = {
    "cohesion": "[0.0, 600.0]",
    "friction_angle": "[0.45, 0.65]",
    "shear_modulus": '{ range = [0.005, 0.025], scale = "log" }',
}
DING_WHEEL = (0.15735, 0.165)


def _ding(name: str, title: str, kinds: tuple[str, ...]) -> MeasuredSet:
    """Rows at slips above zero: at zero the torque is zero by definition and was not read."""
    return MeasuredSet(
        name=name,
        title=title,
        file="ding2011/single_wheel_tests.csv",
        wanted=lambda r: float(r["slip"]) > 0.0 and r["case_id"].split("_")[1] in kinds,
        rename=DING,
        run=lambda r: r["case_id"].split("_")[1],
        wheels={"smooth": DING_WHEEL, "lugged": DING_WHEEL} if len(kinds) > 1 else {"": DING_WHEEL},
        gear=lambda r: "lugged" if float(r["grouser_height_m"]) > 0.0 else "smooth",
        soil=DING_SOIL,
        tight=DING_TIGHT,
        noise=DING_NOISE,
    )


#: Half a grid line of the printed curves.
KLS1_NOISE = {"torque_Nm": "0.05", "drawbar_pull_N": "0.5", "sinkage_m": "0.0005"}
#: Direct shear for the strength; no bearing is published, that of a lunar simulant stands in.
KLS1_SOIL = {
    "cohesion": 1716.0,
    "friction_angle": 0.7086,
    "shear_modulus": 0.011,
    "kc": 1379.0,
    "kphi": 814000.0,
    "n": 1.0,
}
KLS1_TIGHT = {
    "cohesion": "[0.0, 3000.0]",
    "friction_angle": "[0.60, 0.80]",
    "shear_modulus": '{ range = [0.003, 0.03], scale = "log" }',
    "kphi": '{ range = [2e5, 4e6], scale = "log" }',
}
KLS1_WHEEL, RASHID_WHEEL = (0.085, 0.080), (0.100, 0.080)


def _kls1(name: str, title: str, *runs: str) -> MeasuredSet:
    no_torque = runs == ("rashid1_fjs1_w24",)
    wheel = RASHID_WHEEL if no_torque else KLS1_WHEEL
    noise = {key: v for key, v in KLS1_NOISE.items() if not (no_torque and key == "torque_Nm")}
    return MeasuredSet(
        name=name,
        title=title,
        file="kls1_rashid1/single_wheel_tests.csv",
        wanted=lambda r: r["run"] in runs,
        rename={},
        run=lambda r: r["run"],
        wheels={"smooth": wheel, "lugged": wheel} if len(runs) > 1 else {"": wheel},
        gear=lambda r: "lugged" if float(r["grouser_height_m"]) > 0.0 else "smooth",
        soil=KLS1_SOIL,
        tight=KLS1_TIGHT,
        noise=noise,
    )


#: Standard deviation of three repeats.
CMU_NOISE = {"drawbar_pull_N": "0.4", "sinkage_m": "0.0007"}
#: A typical shear strength, and the bearing by the plate tests of the sand: 35 kPa under the plate
#: of 50 mm at a depth of 20 mm, the exponent between those of small and large depths.
CMU_SOIL = {
    "cohesion": 100.0,
    "friction_angle": 0.6,
    "shear_modulus": 0.01,
    "kc": 0.0,
    "kphi": 5500000.0,
    "n": 1.3,
}
#: The plate test of this width as `soilml bevameter` writes it (examples/bevameter/real.py).
CMU_PLATES = """\
[[soil.test]]
plate_width = 0.05
sinkage = 0.0202398
pressure = 35028.7
scatter = 0.084"""
CMU_TIGHT = {
    "cohesion": "[0.0, 500.0]",
    "friction_angle": "[0.50, 0.70]",
    "shear_modulus": '{ range = [0.003, 0.03], scale = "log" }',
    "kphi": '{ range = [3.5e6, 8e6], scale = "log" }',
}


def _cmu(
    name: str,
    title: str,
    slip: tuple[float, float],
    steepest: float = 0.0,
    soil_test: str = "",
) -> MeasuredSet:
    """Trials between two slips and up to a slip angle (rad)."""
    return MeasuredSet(
        name=name,
        title=title,
        file="cmu_smooth_wheel/smooth_wheel_trials.csv",
        wanted=lambda r: (
            slip[0] < float(r["slip"]) < slip[1] and float(r["slip_angle_rad"]) <= steepest + 1e-6
        ),
        rename={},
        run=lambda r: f"angle{round(57.29578 * float(r['slip_angle_rad']))}",
        wheels={"": (0.060, 0.050)},
        gear=_one,
        soil=CMU_SOIL,
        tight=CMU_TIGHT,
        noise=CMU_NOISE,
        covariates=("slip_angle_rad",) if steepest else (),
        soil_test=soil_test,
    )


SETS = (
    _ding("ding2011_smooth", "Ding 2011, smooth wheel (5 slips, 80 N)", ("smooth",)),
    _ding("ding2011_lugged", "Ding 2011, wheel with lugs of 10 mm (5 slips, 80 N)", ("lug10",)),
    _ding("ding2011_both", "Ding 2011, both wheels on one soil", ("smooth", "lug10")),
    _kls1("kls1_smooth", "KLS-1, smooth wheel (5 slips, 59 N)", "kls1_smooth_w59"),
    _kls1("kls1_lugged", "KLS-1, wheel with lugs of 10 mm (5 slips, 59 N)", "kls1_lug10_w59"),
    _kls1("kls1_both", "KLS-1, both wheels on one soil", "kls1_smooth_w59", "kls1_lug10_w59"),
    _kls1(
        "rashid1", "Rashid-1 wheel, lugs of 20 mm (5 slips, 25 N, no torque)", "rashid1_fjs1_w24"
    ),
    _cmu("cmu_driving", "CMU, smooth wheel, driving (4 slips, 3 repeats, no torque)", (0.05, 1.0)),
    _cmu("cmu_braking", "CMU, smooth wheel, braking (3 slips, 3 repeats)", (-0.95, -0.05)),
    _cmu(
        "cmu_driving_plates",
        "CMU, driving, with the plate tests of its sand",
        (0.05, 1.0),
        soil_test=CMU_PLATES,
    ),
    _cmu(
        "cmu_braking_plates",
        "CMU, braking, with the plate tests of its sand",
        (-0.95, -0.05),
        soil_test=CMU_PLATES,
    ),
    _cmu("cmu_all", "CMU, driving and braking", (-0.95, 1.0)),
    _cmu("cmu_turned", "CMU, driving, slip angles to 30 degrees", (0.05, 1.0), 0.5236),
)
