"""A single-wheel rig that is simulated, with known slip, torque and load in each stage."""

from dataclasses import dataclass, field

import numpy as np

from soilml.log_import import import_log, init_map

RADIUS, LOAD, RIM_SPEED = 0.15, 60.0, 0.05


def torque_law(slip, load=LOAD, radius=RADIUS):
    """Any smooth law will do: the import knows none."""
    return load * radius * (0.12 + 0.45 * (1.0 - np.exp(-np.asarray(slip) / 0.2)))


def wandering(rng, n, step, std, memory):
    """An AR(1) process (n,) with this standard deviation and correlation time (s)."""
    if memory <= 0.0:
        return std * rng.standard_normal(n)
    keep = np.exp(-step / memory)
    shocks = std * np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    values = np.empty(n)
    last = std * rng.standard_normal()
    for i in range(n):
        last = values[i] = keep * last + shocks[i]
    return values


@dataclass
class Drive:
    """What happened: columns over time, and the true means of the stages."""

    time: np.ndarray
    rim: np.ndarray
    ground: np.ndarray
    torque: np.ndarray
    load: np.ndarray
    stages: list = field(default_factory=list)  # (start, stop, slip)

    @property
    def rim_place(self):
        return np.cumsum(self.rim) * (self.time[1] - self.time[0])

    @property
    def place(self):
        return np.cumsum(self.ground) * (self.time[1] - self.time[0])


def drive(
    rng,
    slips=(0.1, 0.3, 0.5),
    seconds=14.0,
    rate=50.0,
    rest=3.0,
    load=LOAD,
    radius=RADIUS,
    memory=0.3,
    slip_std=0.02,
    torque_std=0.06,
    settling=0.4,
    ripple=0.03,
):
    """Drive at one slip after another, with settling, wandering and the ripple of grousers."""
    step = 1.0 / rate
    n = round((rest + seconds * len(slips)) * rate)
    time = step * np.arange(n)
    target = np.zeros(n)
    rim = np.where(time < rest, 0.0, RIM_SPEED)
    stages = []
    for i, slip in enumerate(slips):
        start = rest + i * seconds
        target[time >= start] = slip
        stages.append((start, start + seconds, slip))
    slip = np.empty(n)
    slip[0] = target[0]
    for i in range(1, n):
        slip[i] = slip[i - 1] + (target[i] - slip[i - 1]) * step / settling
    slip = slip + wandering(rng, n, step, slip_std, memory)
    moving = rim > 0.0
    torque = torque_law(slip, load, radius)
    torque = torque * (1.0 + wandering(rng, n, step, torque_std, memory))
    torque = torque * (1.0 + ripple * np.sin(2.0 * np.pi * time / 0.8))
    loads = load * (1.0 + wandering(rng, n, step, 0.01, memory))
    return Drive(
        time,
        rim,
        np.where(moving, rim * (1.0 - slip), 0.0),
        np.where(moving, torque, 0.0),
        loads,
        stages,
    )


def write_csv(path, columns, separator=",", decimal=".", encoding="utf-8", head=(), units=None):
    """A text log in the dialect of some logger."""
    lines = [*head, separator.join(columns)]
    if units is not None:
        lines.append(separator.join(units))
    for row in zip(*columns.values(), strict=True):
        cells = [value if isinstance(value, str) else f"{value:.14g}" for value in row]
        lines.append(separator.join(cells).replace(".", decimal))
    path.write_bytes("\r\n".join(lines).encode(encoding))
    return path


def scores(imported, stages, truth, name):
    """Errors of the rows within the stages, in standard deviations: (rows,)."""
    table = imported.table
    found = []
    for start, stop, slip in stages:
        inside = (table["time_s"] > start) & (table["time_s"] < stop)
        for i in np.flatnonzero(inside):
            found.append((table[name][i] - truth(slip)) / table[f"{name}_std"][i])
    return found


#: The edit that gives a new map the radius of 0.15 m.
RADIUS_EDIT = ('# radius = "0.15 m', 'radius = "0.15 m')


def noisy(rng, values, std):
    return values + std * rng.standard_normal(values.size)


def imported(folder, logs, edits=()):
    """The import of logs by a new map with these edits and no other, and the text of the map."""
    text = init_map(logs)
    for old, new in edits:
        assert old in text, text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text, encoding="utf-8")
    return import_log(logs, folder / "map.toml"), text
