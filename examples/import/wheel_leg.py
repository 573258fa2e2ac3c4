"""Logs of a wheel-leg, simulated with the defects of real ones, to slip (docs/how-to/import.md).

Each run has two files. That of the motor (100 Hz) has an encoder which starts again at 360 degrees
and reads 12 degrees where a leg is vertical, a current that reads 0.05 A at rest, and a draw wire.
That of the IMU (200 Hz) has a clock of its own that starts 0.4 s later, the vertical acceleration
and an infrared range-finder 6 cm above the axle. Samples are missing and single samples are wild.

Run from the repository root: python examples/import/wheel_leg.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilml import Estimator, Model, Operating
from soilml.cli import main
from soilml.io.table import Table
from soilml.log_import import import_log
from soilml.onboard.multi_sensor import fuse_estimates
from soilml.papers.comin2017_slip import FOOT
from soilml.physics.soils import Soil
from soilml.quantities import Z_90, column
from soilml.report.aligned_text import format_table
from soilml.systems.wheel_legs.stances import GRAVITY, SpringLeg, simulate_stance
from soilml.systems.wheel_legs.stride_relations import VIBRATION

Floats = NDArray[np.float64]

FOLDER = Path("demo/wheel_leg")
LEGS, LENGTH, TURNING, LOAD, REST = 5, 0.18, 0.3, 12.0, 3.0
ZERO, SENSOR, LATE = np.deg2rad(12.0), 0.06, 0.4
SPACING = 2.0 * np.pi / LEGS
RATES = {"motor": 100.0, "imu": 200.0}
TORQUE_CONSTANT, IDLE = 1.5, 0.05  # N m/A behind the gearbox, A
SEEDS = (2, 3, 4)  # Of further logs, in which the coverage alone is looked at
STANCES, SLIPS = 12, (0.08, 0.2, 0.32, 0.45)
MAP = """\
[time]
column = "t"
unit = "s"

[files.motor]
pattern = "*motor*"
[files.imu]
pattern = "*imu*"
clock = "start"                       # a clock of its own, 0.4 s late
delay = "0.4 s"

[wheel_leg]
legs = 5
length = "0.18 m +- 0.5 mm"           # from the axle to the end of a leg
zero = "12 deg"                       # encoder where a leg points straight down
sensor_height = "6 cm +- 0.5 mm"      # of the range-finder above the axle

[wheel_angle]
column = "encoder"
unit = "deg"
wraps_at = 360
[motor_current]
column = "current"
unit = "A"
torque_constant = "1.5 N m/A +- 1 %"  # behind the gearbox
tare = "rest"
[position]
column = "wire"
unit = "mm"
[vibration]
column = "az"
unit = "m/s^2"
[clearance]
column = "range"
unit = "mm"
[load]
value = "12 N +- 0.1 N"
"""


@dataclass(frozen=True)
class Truth:
    """What a log was made from, by stance (runs, stances): slip, N m, m/s^2 and m."""

    slip: Floats
    torque: Floats
    vibration: Floats
    sinkage: Floats


def random_soils(count: int, seed: int) -> Soil:
    """Soils whose properties are uniform within table I of Comin and Saaj 2017."""
    draw = np.random.default_rng(seed).uniform
    n, stiffness = draw(0.45, 0.95, count), draw(0.99e4, 2.36e4, count)
    return Soil(
        cohesion=draw(0.0, 1610.0, count),
        friction_angle=np.deg2rad(draw(29.1, 42.8, count)),
        shear_modulus=draw(0.017, 0.024, count) * FOOT.area**0.5,
        kc=np.zeros(count),
        kphi=stiffness / 0.01**n,
        n=n,
    )


def write_logs(folder: Path, seed: int = 1) -> tuple[list[Path], Truth]:
    """Write two files for each run into a folder, and the map; the files, and the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "map.toml").write_text(MAP)
    rng = np.random.default_rng(seed)
    ground = random_soils(len(SLIPS), seed)
    slip = np.asarray(SLIPS)[:, None] + 0.02 * rng.standard_normal((len(SLIPS), STANCES))
    slip = np.clip(slip, 0.01, 0.6)
    each = type(ground)(**{
        name: np.asarray(getattr(ground, name))[:, None] * np.ones(STANCES)
        for name in ("cohesion", "friction_angle", "shear_modulus", "kc", "kphi", "n")
    })  # fmt: skip
    force = Model(FOOT)(each, Operating(slip=slip, load=LOAD))
    sigma = np.asarray(each.kphi) * 0.01 ** np.asarray(each.n)
    a, b = VIBRATION.line(each.friction_angle, sigma)
    truth = Truth(
        slip, np.asarray(force.torque), np.maximum((slip - a) / b, 0.0), np.asarray(force.sinkage)
    )
    files = []
    for run in range(len(SLIPS)):
        files += _write_run(folder, run, truth, rng)
    return files, truth


def _write_run(folder: Path, run: int, truth: Truth, rng: np.random.Generator) -> list[Path]:
    """The two files of a run: a rest, then stances one after the other."""
    lasts = REST + STANCES * SPACING / TURNING
    files = []
    for kind, rate in RATES.items():
        time = (
            np.arange(0.0, lasts, 1.0 / rate)
            if kind == "motor"
            else np.arange(LATE, lasts, 1 / rate)
        )
        angle = TURNING * np.maximum(time - REST, 0.0) - SPACING / 2.0
        k = np.clip(np.round(angle / SPACING), 0, STANCES - 1).astype(int)
        since = np.clip(angle - SPACING * k, -SPACING / 2.0, SPACING / 2.0)
        drives = time >= REST
        if kind == "motor":
            columns = _motor(run, k, since, drives, truth, rng)
            columns = {"t": 1000.0 + time, **columns}
            columns["encoder [deg]"] = np.mod(np.rad2deg(angle + ZERO), 360.0)
        else:
            columns = {"t": time - LATE, **_imu(run, k, since, drives, truth, rng)}
            gone = (time > 20.0) & (time < 21.2)
            columns["az [m/s^2]"][gone] = np.nan
        name = folder / f"leg_{run + 1}_{kind}.csv"
        _write(name, columns)
        files.append(name)
    return files


def _motor(
    run: int, k: Floats, since: Floats, drives: Floats, truth: Truth, rng: np.random.Generator
) -> dict[str, Floats]:
    """Current and place: torque grows while the leg falls; the hub advances by l sin."""
    n = k.size
    torque = truth.torque[run, k] * (1.0 + 0.35 * np.sin(since) - 0.4 * (1.0 - np.cos(since)))
    torque = torque * (1.0 + 0.02 * _wandering(rng, n, RATES["motor"]))
    current = np.where(drives, torque / TORQUE_CONSTANT, 0.0) + IDLE + 0.01 * rng.standard_normal(n)
    wild = rng.integers(0, n, 8)
    current[wild] += rng.choice([-3.0, 3.0], 8)
    part = (1.0 - truth.slip[run, k]) * LENGTH * (np.sin(since) + np.sin(SPACING / 2.0))
    before = np.concatenate(
        [[0.0], np.cumsum((1.0 - truth.slip[run]) * 2.0 * LENGTH * np.sin(SPACING / 2.0))]
    )
    wire = 1000.0 * (before[k] + part) + 0.5 * rng.standard_normal(n)
    wire[n // 3 : n // 3 + 20] = np.nan
    return {"current [A]": current, "wire [mm]": wire}


def _imu(
    run: int, k: Floats, since: Floats, drives: Floats, truth: Truth, rng: np.random.Generator
) -> dict[str, Floats]:
    """Vertical acceleration, of stick-slip after midstance, and the range to the ground."""
    n = k.size
    shaking = np.zeros(n)
    leg = SpringLeg(stiffness=8000.0, softening=0.03, length=LENGTH, turning=TURNING)
    found = simulate_stance(leg, truth.slip[run], 0.65, 0.2)
    rigid = -LENGTH * TURNING**2 * np.cos(TURNING * found.time)  # (times, stances)
    wave = found.acceleration - rigid
    wave = wave * truth.vibration[run] / np.abs(wave).max(axis=0)
    for stance in range(STANCES):
        own = (k == stance) & (since > 0.0) & drives
        shaking[own] = np.interp(since[own] / TURNING, found.time[:, stance], wave[:, stance])
    shaking += np.where(drives, -LENGTH * TURNING**2 * np.cos(since), 0.0)
    up = GRAVITY + shaking + 0.05 * rng.standard_normal(n)
    up[rng.integers(0, n, 6)] += 25.0
    height = LENGTH * np.cos(since) - truth.sinkage[run, k]
    ranged = 1000.0 * (height + SENSOR) + 1.0 * rng.standard_normal(n)
    return {"az [m/s^2]": up, "range [mm]": ranged}


def _wandering(rng: np.random.Generator, n: int, rate: float) -> Floats:
    """Correlated noise (n,) of standard deviation 1 with a memory of 0.1 s."""
    keep = np.exp(-1.0 / (0.1 * rate))
    values = rng.standard_normal(n)
    for i in range(1, n):
        values[i] = keep * values[i - 1] + np.sqrt(1.0 - keep**2) * values[i]
    return values


def _write(file: Path, columns: dict[str, Floats]) -> None:
    """A CSV file with blanks for missing samples."""
    lines = [",".join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(",".join("" if np.isnan(x) else f"{x:.4f}" for x in row))
    file.write_text("\n".join(lines) + "\n")


def of_stances(table: Table, truth: Truth) -> dict[str, Floats]:
    """The truth of each row, by column: its stance follows from the time of its middle."""
    runs = sorted(set(table["run"]))
    run = np.asarray([runs.index(name) for name in table["run"]])
    stance = np.round((table["time_s"] - REST) * TURNING / SPACING - 0.5).astype(int)
    stance = np.clip(stance, 0, STANCES - 1)
    return {column(name): values[run, stance] for name, values in vars(truth).items()}


def covered(table: Table, truth: Truth) -> dict[str, float]:
    """What the 90 % intervals cover, by column."""
    return {
        name: float(np.mean(np.abs(table[name] - true) <= Z_90 * table[f"{name}_std"]))
        for name, true in of_stances(table, truth).items()
    }


def compare(table: Table, truth: Truth) -> None:
    """Print how far the rows are from the truth, and what their intervals cover."""
    lines = []
    others: dict[str, list[float]] = {name: [] for name in of_stances(table, truth)}
    for seed in SEEDS:
        folder = FOLDER / f"seed_{seed}"
        logs, other = write_logs(folder, seed)
        for name, share in covered(import_log(logs, folder / "map.toml").table, other).items():
            others[name].append(share)
    for name, true in of_stances(table, truth).items():
        rms = np.sqrt(np.mean((table[name] - true) ** 2))
        std = np.median(table[f"{name}_std"])
        own, more = covered(table, truth)[name], others[name]
        cells = (f"{true.mean():.3g}", f"{rms:.2g}", f"{std:.2g}", f"{own:.0%}")
        lines.append((name, *cells, f"{min(more):.0%} to {max(more):.0%}"))
    print(
        f"\nStances: {len(table)} rows of {len(SLIPS)} runs against what the logs were made from\n"
    )
    head = ("column", "mean", "RMS error", "median std", "90 % covers")
    print(format_table((*head, f"seeds {SEEDS[0]} to {SEEDS[-1]}"), lines))


def slip_on_board(table: Table) -> None:
    """Print the slip that each sensor tells, and both, against that of the draw wire."""
    names = ("slip_torque_paper", "slip_vibration_paper")
    files = [Estimator.load(f"exported/{name}.onnx") for name in names]
    alone = [file(**{n: table[column(n)] for n in file.inputs}) for file in files]
    found = {"torque": alone[0], "vibration": alone[1], "both": fuse_estimates(alone).estimate}
    spread, lines = files[0].prior.std[0], []
    for name, estimate in found.items():
        rms = np.sqrt(np.mean((estimate.mean[:, 0] - table["slip"]) ** 2))
        inside = (estimate.low[:, 0] <= table["slip"]) & (table["slip"] <= estimate.high[:, 0])
        lines.append((name, f"{rms:.3f}", f"{rms / spread:.2f}", f"{inside.mean():.0%}"))
    print("\nSlip of the stances on board, without the draw wire\n")
    print(format_table(("slip by", "RMS error", "over the prior's std", "90 % covers"), lines))


def picture(files: list[Path], target: Path) -> None:
    """A run over time, and slip on board over slip."""
    import matplotlib.pyplot as plt

    from soilml.log_import.figures import draw_run, run_panels
    from soilml.report.figure_style import report_style

    imported = import_log(files, FOLDER / "map.toml")
    with report_style():
        series = imported.series[2]
        count = len(run_panels(series))
        figure, axes = plt.subplots(count, 1, figsize=(9.0, 5.2), layout="constrained")
        draw_run(series, imported.table, axes)
        figure.axes[-1].set_xlabel("time, s; each blue stretch is a stance")
        figure.savefig(target, dpi=80, facecolor="white")
    plt.close(figure)


def run() -> None:
    """From the logs to the slip."""
    logs, truth = write_logs(FOLDER)
    table = FOLDER / "strides.csv"
    main(["import", *map(str, logs), "--map", str(FOLDER / "map.toml"), "--out", str(table)])
    imported = import_log(logs, FOLDER / "map.toml").table
    compare(imported, truth)
    slip_on_board(imported)
    picture(logs, FOLDER / "wheel_leg.png")
    print(f"\npicture: {FOLDER / 'wheel_leg.png'}; report: {table.with_suffix('.report.html')}")


if __name__ == "__main__":
    run()
