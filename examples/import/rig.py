"""Logs of a simulated single-wheel rig, with what real logs have: see docs/how-to/import.md.

The columns are those of a rig in Germany: UTF-16, semicolons, decimal commas, degrees of a motor
before a gearbox of 99 to 1, a pull sensor that reads 14 N at rest and a burst of missing samples.
In `sand_3` the torque sensor is dead, and at the end of `sand_4` somebody pulls on the carriage.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

RADIUS, RATIO, RATE, REST, SECONDS = 0.15, 99.0, 50.0, 3.0, 9.0
MODEL = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
[soil.prior]
cohesion = [0.0, 3000.0]
friction_angle = [0.436332, 0.785398]
shear_modulus = [0.005, 0.03]
"""


def write_logs(folder: Path) -> list[Path]:
    """Write four logs and a model file into a folder; the logs."""
    from soilml import Model, Operating, Wheel, soil

    rng = np.random.default_rng(1)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.toml").write_text(MODEL)
    model, logs = Model(Wheel(radius=RADIUS, width=0.12)), []
    for number, load in enumerate((40.0, 60.0, 60.0, 80.0), 1):
        time = np.arange(0.0, REST + 4 * SECONDS, 1 / RATE)
        stage = np.maximum(time - REST, 0.0) // SECONDS
        slip = _settled(np.array([0.08, 0.2, 0.35, 0.5])[stage.astype(int)])
        slip += _wandering(rng, time.size, 0.01)
        force = model(soil("wong1989/dry_sand"), Operating(slip=slip, load=load))
        rim = np.where(time < REST, 0.0, 0.05)
        travel = rim * (1.0 - slip)
        if number == 4:
            late = time > time[-1] - 5.0
            pushed = 0.02 * np.repeat(rng.standard_normal(time.size // 12 + 1), 12)[: time.size]
            travel = np.where(late, travel + pushed, travel)
        fluctuation = 1.0 + _wandering(rng, time.size, 0.04)
        torque = np.where(rim > 0.0, force.torque * fluctuation, 0.0)
        pull = np.where(rim > 0.0, force.drawbar_pull + _wandering(rng, time.size, 0.5), 0.0)
        noise = rng.standard_normal((4, time.size))
        columns = {
            "Zeit [ms]": 1000.0 * time,
            "Motor Position [°]": np.degrees(np.cumsum(rim) / RATE / RADIUS) * RATIO,
            "Wagen Position [mm]": 1000.0 * np.cumsum(travel) / RATE + 0.3 * noise[0],
            "Drehmoment [mNm]": 1000.0 * torque + 30.0 * noise[1],
            "Fx [N]": 14.0 + pull + 0.4 * noise[2],
            "Fz [N]": -load + 0.5 * noise[3],
        }
        if number == 3:
            columns["Drehmoment [mNm]"] = np.full(time.size, 3.1)
        burst = (time > 8.0) & (time < 8.3)
        for name in ("Fx [N]", "Fz [N]"):
            columns[name] = np.where(burst, np.nan, columns[name])
        logs.append(_write(folder / f"sand_{number}.csv", columns))
    return logs


def _settled(target: np.ndarray) -> np.ndarray:
    """A slip that follows its target with a time constant of 0.4 s."""
    slip = target.copy()
    for i in range(1, slip.size):
        slip[i] = slip[i - 1] + (target[i] - slip[i - 1]) / (0.4 * RATE)
    return slip


def _wandering(rng: np.random.Generator, n: int, std: float) -> np.ndarray:
    """Correlated noise (n,) with a memory of 0.3 s."""
    keep = np.exp(-1.0 / (0.3 * RATE))
    values = std * rng.standard_normal(n)
    for i in range(1, n):
        values[i] = keep * values[i - 1] + np.sqrt(1.0 - keep**2) * values[i]
    return values


def _write(path: Path, columns: dict[str, np.ndarray]) -> Path:
    lines = ["Rig 3", "Radius: 150 mm", ";".join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(";".join(f"{value:.6g}" for value in row).replace(".", ","))
    path.write_bytes("\r\n".join(lines).encode("utf-16"))
    return path
