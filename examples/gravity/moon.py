"""A wheel tested on Earth and asked for on the Moon; `--make` simulates the rows.

Prints the answers by the open law of gravity and by each school, how they compare with a flight,
and the tests on Earth that would transfer best; draws demo/gravity/moon.png.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from soilml import read_case, read_table, simulate
from soilml.experiment_design import samples_of_rows
from soilml.experiment_design.transfer_tests import TransferAdvice, advise_transfer
from soilml.fitting.coordinates import select_free
from soilml.fitting.usable_readings import usable_readings
from soilml.io.text_tables import csv_text
from soilml.numerics.quantiles import quantile_band
from soilml.physics.soils.gravity_law import LAWS, GravityChange
from soilml.report.aligned_text import format_table
from soilml.report.figure_style import save_png
from soilml.traction import Traction, predict_traction
from soilml.traction.gravity import draws_at_gravity
from soilml.traction.measured_range import MeasuredRange, slip_grid
from soilml.traction.pull_and_slope import predictions_by_load
from soilml.traction.soil_draws import measured_soil

HERE, OUT = Path(__file__).parent, Path("demo/gravity/moon.png")
EARTH, MOON, LOAD, SLIP = 9.80665, 1.62, 20.0, 0.3  # m/s^2, load on the Moon in N
SOIL = {"cohesion": 100.0, "friction_angle": 0.61, "shear_modulus": 0.012}
RADII = (0.1, 0.15, 0.25)  # m
COLORS = {"open": "#444444", "constant": "#005b96", "proportional": "#cc7a00"}


def make() -> None:
    """Write runs.csv: torque at three slips under two loads."""
    case = read_case(HERE / "wheel.toml")
    slip, load = np.tile([0.1, 0.3, 0.5], 2), np.repeat([40.0, 80.0], 3)
    rows = simulate(case.with_values(SOIL), slip, load, run=np.full(6, "earth"), seed=4)
    columns = {"run": rows["run"], "slip": slip, "load_N": load}
    columns["torque_Nm"] = np.round(rows["torque_Nm"], 3)
    (HERE / "runs.csv").write_text(csv_text(columns))


def answers(case, table) -> dict[str, Traction]:
    """The pull on the Moon by each law, and that on Earth under the same load."""
    draws, seen = measured_soil(case, table).draws, MeasuredRange.of(table["slip"], table["load_N"])
    moon, slips = GravityChange(EARTH, MOON), slip_grid(None, seen)
    (one,) = predictions_by_load(case, draws, draws, [LOAD], slips, seen, gravity=moon)
    print(f"{one.laws.table().text()}\n\n{one.laws.remark().text}\n")
    earth = predict_traction(case, draws, LOAD, slips)
    at = int(np.argmin(np.abs(slips - SLIP)))
    found, lines = {}, []
    for law in LAWS:
        own = draws_at_gravity(case, draws, GravityChange(EARTH, MOON, law))
        moon = found[law] = predict_traction(case, own, LOAD, slips)
        cells = [law]
        for part in ("pull", "sinkage"):
            band = quantile_band(getattr(moon, part)[:, at] / getattr(earth, part)[:, at])
            cells.append(f"{band.middle:.2f} ({band.lower:.2f} to {band.upper:.2f})")
        lines.append(cells)
    print(format_table(["Moon over Earth, same load", "pull", "sinkage"], lines, text_columns=1))
    return found


def tests(case, table) -> dict[str, TransferAdvice]:
    """Tests on Earth rated by each law."""
    samples = samples_of_rows(case, usable_readings(case, table), select_free(case, None), 1024)
    found, lines = {}, []
    for law in LAWS:
        change = GravityChange(EARTH, MOON, law)
        found[law] = advise_transfer(case, samples, change, LOAD, SLIP, radii=RADII)
    named = {"best by the model": "best", "best by scaling": "best_scaled"}
    named |= {"same load": "same_load", "same mass": "same_mass"}
    for law, advice in found.items():
        for name, attribute in named.items():
            test = getattr(advice, attribute)
            cells = [f"{test.load:.0f}", f"{test.radius:.2f}", f"{test.pull_std:.2f}"]
            lines.append([name, law, *cells, f"{test.scaled_error:.2f}", f"{test.speed_ratio:.2f}"])
    header = [
        "test on Earth",
        "law",
        "load_N",
        "radius_m",
        "pull_left_N",
        "scaled_error_N",
        "speed_ratio",
    ]
    print(f"\n{format_table(header, lines, text_columns=2)}\n")
    for remark in found["open"].remarks():
        print(remark)
    return found


def draw(pulls, advice: TransferAdvice, path: Path) -> None:
    """The bands of the pull by law, and both errors over the load of the test."""

    def plot(axes) -> None:
        first, model, scaled = np.ravel(axes)
        for law, found in pulls.items():
            band, color = quantile_band(found.pull), COLORS[law]
            first.fill_between(found.slip, band.lower, band.upper, color=color, alpha=0.3, lw=0)
            first.plot(found.slip, band.middle, color=color, label=law, zorder=3)
        first.set_xlabel("slip")
        first.set_ylabel(f"pull on the Moon under {LOAD:.0f} N, N")
        first.legend(title="law of gravity", frameon=False, fontsize=9, loc="upper left")
        for radius in RADII:
            own = sorted((t.load, t.pull_std, t.scaled_error) for t in advice.tests
                         if t.radius == radius)  # fmt: skip
            load, left, error = np.asarray(own).T
            model.plot(load, left, "o-", ms=4, label=f"radius {radius:.2f} m")
            scaled.plot(load, error, "o-", ms=4)
        model.axhline(advice.least_std, color="#555555", ls="--", lw=1, label="soil known")
        model.axhline(advice.known_std, color="#555555", ls=":", lw=1, label="no further test")
        model.set_ylabel("std of the pull on the Moon, N")
        model.set_title("by the model", fontsize=10)
        scaled.set_ylabel("expected error, N")
        scaled.set_title("pull measured, times ratio of loads", fontsize=10)
        for panel in (model, scaled):
            panel.set_xscale("log")
            panel.set_xticks([20, 40, 80, 120], ["20", "40", "80", "120"])
            panel.minorticks_off()
            panel.set_xlabel("load of the test on Earth, N")
            panel.set_ylim(bottom=0.0)
        model.legend(frameon=False, fontsize=8, loc="lower left")

    path.parent.mkdir(parents=True, exist_ok=True)
    save_png(plot, 1, 3, (12.0, 3.8), path)


def run() -> None:
    """Print all and draw."""
    case, table = read_case(HERE / "wheel.toml"), read_table(HERE / "runs.csv")
    pulls = answers(case, table)
    draw(pulls, tests(case, table)["open"], OUT)


if __name__ == "__main__":
    make() if "--make" in sys.argv else run()
