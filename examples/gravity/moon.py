"""A wheel tested on Earth and asked for on the Moon; `--make` simulates the rows.

Prints the answers by the open law of gravity and by each school, and how they compare with a
flight; draws demo/gravity/moon.png.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from soilml import read_case, read_table, simulate
from soilml.io.text_tables import csv_text
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import LAWS, GravityChange
from soilml.report.aligned_text import format_table
from soilml.report.report import Picture
from soilml.report.tables import Column, ReportTable
from soilml.traction import DrivenVehicle, Performance, performance
from soilml.traction.prediction import MeasuredRange, slip_grid
from soilml.traction.soil_draws import measured_soil

HERE, OUT = Path(__file__).parent, Path("demo/gravity/moon.png")
EARTH, MOON, LOAD, SLIP = 9.80665, 1.62, 20.0, 0.3  # m/s^2, load on the Moon in N
SOIL = {"cohesion": 100.0, "friction_angle": 0.61, "shear_modulus": 0.012}
COLORS = {"open": "#444444", "constant": "#005b96", "proportional": "#cc7a00"}


def make() -> None:
    """Write runs.csv: torque at three slips under two loads."""
    case = read_case(HERE / "wheel.toml")
    slip, load = np.tile([0.1, 0.3, 0.5], 2), np.repeat([40.0, 80.0], 3)
    rows = simulate(case.with_values(SOIL), slip, load, run=np.full(6, "earth"), seed=4)
    columns = {"run": rows["run"], "slip": slip, "load_N": load}
    columns["torque_Nm"] = np.round(rows["torque_Nm"], 3)
    (HERE / "runs.csv").write_text(csv_text(columns))


def answers(case, table) -> dict[str, Performance]:
    """The pull on the Moon by each law, and that on Earth under the same load."""
    draws = measured_soil(case, table).draws
    slips = slip_grid(None, MeasuredRange.of(table["slip"], table["load_N"]))
    wheel, level = DrivenVehicle.of_wheel(case, LOAD), np.zeros(0)
    earth = performance(wheel, draws, level, slips)
    at = int(np.argmin(np.abs(slips - SLIP)))
    found, lines = {}, []
    for law in LAWS:
        own = draws.at_gravity(case, GravityChange(EARTH, MOON, law))
        moon = found[law] = performance(wheel, own, level, slips)
        cells = [law]
        for part in ("pull", "deepest"):
            band = quantile_band(getattr(moon, part)[:, at] / getattr(earth, part)[:, at])
            cells.append(f"{band.middle:.2f} ({band.lower:.2f} to {band.upper:.2f})")
        lines.append(cells)
    pull, slope = (
        [quantile_band(getattr(one, name)) for one in found.values()]
        for name in ("largest_pull", "steepest_slope")
    )
    columns = [
        Column("law of gravity", list(found)),
        Column.of_bands("pull", pull, "N"),
        Column.of_bands("slope", slope, "rad"),
    ]
    print(f"{ReportTable('By law of gravity', columns).text()}\n")
    print(format_table(["Moon over Earth, same load", "pull", "sinkage"], lines, text_columns=1))
    return found


def draw(pulls, path: Path) -> None:
    """The bands of the pull by law."""

    def plot(axes) -> None:
        panel = axes[0, 0]
        for law, found in pulls.items():
            band, color = quantile_band(found.pull), COLORS[law]
            panel.fill_between(
                found.curve_slip, band.lower, band.upper, color=color, alpha=0.3, lw=0
            )
            panel.plot(found.curve_slip, band.middle, color=color, label=law, zorder=3)
        panel.set_xlabel("slip")
        panel.set_ylabel(f"pull on the Moon under {LOAD:.0f} N, N")
        panel.legend(title="law of gravity", frameon=False, fontsize=9, loc="upper left")

    path.parent.mkdir(parents=True, exist_ok=True)
    Picture("Moon", plot, 1, 1, (5.0, 3.8), "Pull against slip by law of gravity").save(path)


def run() -> None:
    """Print all and draw."""
    case, table = read_case(HERE / "wheel.toml"), read_table(HERE / "runs.csv")
    draw(answers(case, table), OUT)


if __name__ == "__main__":
    make() if "--make" in sys.argv else run()
