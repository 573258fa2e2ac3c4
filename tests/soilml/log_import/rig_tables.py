"""Logs of rigs as data: columns by their headers, of what a simulated drive holds."""

from dataclasses import dataclass, field

import numpy as np
from foreign_rigs import RADIUS, drive, law, table, wander, way

GRAVITY, RPM, DEGREES = 9.80665, 30.0 / np.pi, 180.0 / np.pi


@dataclass
class Truth:
    """The samples of the first log (n,), in SI units at the wheel, and constants that it states.

    known: The quantities that the log holds, of rotation, travel, slip, torque, current, load,
        pull, sinkage; with several wheels, those of the first.
    """

    samples: object
    known: str
    constants: dict = field(default_factory=dict)
    every_row: bool = False

    def values(self, name):
        d = self.samples
        own = {"rotation": d.omega, "travel": d.v, "torque": d.torque, "load": d.load,
               "pull": d.pull, "sinkage": d.sinkage, "current": d.torque}  # fmt: skip
        return slip_of(d) if name == "slip" else own[name]


def slip_of(d):
    """Slip (n,) of a drive, 0 where the wheel rests."""
    return np.where(d.omega > 0.05, 1 - d.v / np.maximum(RADIUS * d.omega, 1e-9), 0.0)


def write(file, columns, head=(), separator=",", units=None, **style):
    rows = table(columns.values(), separator, **style)
    second = [separator.join(units)] if units else []
    file.write_text("\n".join([*head, separator.join(columns), *second, *rows]), encoding="utf-8")
    return file


def sideways(rng, d, size=0.12):
    """A lateral force (n,) that wanders about a share of the load."""
    return d.load * (size + wander(rng, d.t.size, d.t[1], 0.03, 2.0))


#: Samples by name, of a drive and a generator, and the noise of their sensors.
SAMPLES = {
    "t": (lambda d, r: d.t, 0), "w": (lambda d, r: d.omega, 0), "v": (lambda d, r: d.v, 2e-4),
    "T": (lambda d, r: d.torque, 0.03), "W": (lambda d, r: d.load, 0.4),
    "P": (lambda d, r: d.pull, 0.3), "z": (lambda d, r: d.sinkage, 0),
    "x": (lambda d, r: way(d.t, d.v), 0), "turn": (lambda d, r: way(d.t, d.omega), 0),
    "rim": (lambda d, r: RADIUS * d.omega, 0), "s": (lambda d, r: slip_of(d), 0),
    "side": (lambda d, r: sideways(r, d), 0), "noise": (lambda d, r: 0.0 * d.t, 1),
    "one": (lambda d, r: 1.0 + 0.0 * d.t, 0), "n": (lambda d, r: np.arange(d.t.size), 0),
    "power": (lambda d, r: d.torque * d.omega, 0),
}  # fmt: skip


def writers(rigs):
    """A writer for each rig, by its name.

    rigs: Known quantities; columns as a sample, or sample, factor and offset; how it is driven and
    written. `beside` are texts of further files by name, `rows` a table of steady runs instead.
    """

    def writer(name, known, columns, style):
        def written(rng, folder):
            own = {"file": f"{name}.csv", "constants": {}, "digits": 6} | style
            driven = {"slips": (0.1, 0.3, 0.5), "load": 62.0, "rate": 20} | own.pop("drive", {})
            rests, load = driven.pop("rests", True), driven.pop("load")
            d = drive(rng, loads=[load] * len(driven["slips"]), **driven)
            if not rests:
                keep = (d.t > 5) & (d.t < d.t[-1] - 3)
                for key in ("t", "load", "omega", "v", "torque", "pull", "sinkage"):
                    setattr(d, key, getattr(d, key)[keep])
            rows = own.pop("rows", 0)
            if rows:
                slip = np.linspace(0.05, 0.7, rows)
                d.t, d.omega, d.v = np.arange(float(rows)), np.ones(rows), RADIUS * (1 - slip)
                d.load = load + 0 * slip
                d.torque, d.pull, d.sinkage = law(slip, d.load)
            for file, text in own.pop("beside", {}).items():
                (folder / file).write_text(text)
            found = {}
            for column, given in columns.items():
                sample, *change = (given,) if isinstance(given, str) else given
                factor, offset = (*change, *(1, 0)[len(change) :])
                make, noise = SAMPLES[sample]
                values = make(d, rng) + (0 if rows else noise) * rng.standard_normal(d.t.size)
                found[column] = factor * values + offset
            file, constants = folder / own.pop("file"), own.pop("constants")
            return [write(file, found, **own)], Truth(d, known, constants, rows > 0)

        written.__name__ = name
        return written

    return tuple(writer(name, *rig) for name, rig in rigs.items())
