"""Another program in place of the equations of a gear: [simulator], its runs and their emulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from soilml.arrays import Floats
from soilml.config.measurement_noise import Discrepancy
from soilml.errors import InputError
from soilml.io.declared_settings import Key, Numbers, take_declared
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.io.toml_settings import Settings
from soilml.io.toml_text import Inline
from soilml.numerics.gaussian_emulator import GaussianEmulator, fit_emulator
from soilml.numerics.prior import Prior
from soilml.optional_imports import need
from soilml.parameters import declared
from soilml.physics.gears.base import Gear
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.operating_point import MOST_SLIP
from soilml.physics.soils import Soil
from soilml.quantities import CHANNELS, QUANTITIES, column

#: Fewest runs for each input, and how many are advised (Loeppky, Sacks and Welch, Technometrics
#: 51(4), 2009).
FEWEST, ADVISED = 5, 10
#: Relative difference of the outputs of two runs with equal inputs that is taken for rounding.
SAME = 1e-6
LEAST_LOAD, MOST_LOAD = 1e-6, 1e7  # N, of tables


@dataclass(frozen=True)
class Simulator:
    """The table [simulator] of a model file, and the error of the emulator of its runs."""

    runs: Path | None  # File of the runs; None where the model file has them within it
    slip: tuple[float, float]  # Ranges of the design
    load: tuple[float, float]  # N
    gear: Gear  # Of the model file
    # Standard deviation of the emulator by column, in its unit; empty where no runs were read
    error: dict[str, float] = field(default_factory=dict)
    states_discrepancy: bool = False  # Whether the model file states one of its own
    # The runs: those of the file, or of the key `runs`, by which a recipe has them within it
    runs_read: Table | None = field(default=None, repr=False, compare=False)

    def as_settings(self) -> dict[str, object]:
        """The table [simulator], with the full path of its file."""
        found: dict[str, object] = {"runs": Inline(self.columns())}
        if self.runs is not None:
            found = {"table": str(self.runs.resolve())}
        return found | {"slip": list(self.slip), "load_N": list(self.load)}

    def columns(self) -> dict[str, list[float]]:
        """The runs that were read, as lists of numbers by column."""
        found = {} if self.runs_read is None else self.runs_read.columns
        return {key: x.tolist() for key, x in found.items() if x.dtype.kind == "f"}

    def within(self) -> dict[str, object]:
        """The table [simulator] with the runs in it, which depends on no file."""
        return {"runs": self.columns(), "slip": list(self.slip), "load_N": list(self.load)}


class RunsWithin:
    """The runs of a simulator within settings: a list of as many numbers for each column."""

    def take(self, settings: Settings, key: str, kind: str) -> Table:
        """The runs as a table."""
        needed = "lists of as many numbers, by column"
        found = settings.take(key, dict, needed)
        try:
            columns = {name: np.asarray(own, dtype=np.float64) for name, own in found.items()}
        except (TypeError, ValueError):
            settings.fail(f"{key} has a value that is no number; needed are {needed}")
        if {x.ndim for x in columns.values()} != {1} or len({*map(len, columns.values())}) != 1:
            settings.fail(f"{key} has columns of different lengths; needed are {needed}")
        return Table(columns, f"{settings.where} {key}")


_ENDS = "[lowest, highest]"


@dataclass(frozen=True)
class _SimulatorTable:
    """The table [simulator], but for the file `table`."""

    slip: Annotated[
        tuple[float, float],
        Numbers(f"{_ENDS}, between -1 and 1", 2, -MOST_SLIP, MOST_SLIP, rising=True),
    ]
    load: Annotated[
        tuple[float, float],
        Key("load_N"),
        Numbers(f"{_ENDS}, above zero", 2, LEAST_LOAD, MOST_LOAD, rising=True),
    ]
    runs: Annotated[Table | None, RunsWithin()] = None


def take_simulator(settings: Settings, gear: Gear) -> Simulator:
    """Read the table [simulator]; raises `InputError` for what is missing, unknown or wrong."""
    runs = None if "runs" in settings else settings.file("table")
    own = take_declared(_SimulatorTable, settings)
    return Simulator(runs, own.slip, own.load, gear, runs_read=own.runs)


def emulated(
    simulator: Simulator, soil: Soil, prior: Mapping[str, Prior]
) -> tuple[EmulatedGear, Simulator]:
    """The gear that answers by the runs of a simulator, and the simulator with its error.

    Raises `InputError` where there are no runs, or too few, where a run has no output, where two
    runs of one input differ, and where the soil or a prior reaches beyond the design.
    """
    need("scipy", "", what="a model file with [simulator]")
    table = simulator.runs_read
    if table is None:
        assert simulator.runs is not None
        if not simulator.runs.is_file():
            raise InputError(
                f"{simulator.runs}: there is no such file; `soilml plan runs` proposes the runs "
                "of [simulator]"
            )
        table = read_runs(simulator.runs)
    gear, emulator = emulator_of(table, simulator.gear, prior)
    _check_soil(gear, soil, prior, table.source)
    error = {column(name): float(e) for name, e in zip(gear.channels, emulator.error, strict=True)}
    return gear, replace(simulator, error=error, runs_read=table)


def read_runs(path: Path) -> Table:
    """The runs of a simulator that have an answer; raises `InputError` as `read_table` does."""
    table = read_table(path, ("slip", "load_N"), filled=("slip", "load_N"))
    if not table.answered.any():
        raise InputError(f"{path}: no run has the status ok")
    return table.rows(table.answered)


def emulator_of(
    table: Table, gear: Gear, prior: Mapping[str, Prior]
) -> tuple[EmulatedGear, GaussianEmulator]:
    """The gear of a table of runs, and its emulator; raises `InputError` as `design_of` does."""
    found, outputs = design_of(table, gear, prior)
    emulator = fit_emulator(found.fractions(_columns(table, found.inputs)), outputs)
    return replace(found, emulate=emulator.__call__), emulator


def design_of(table: Table, gear: Gear, prior: Mapping[str, Prior]) -> tuple[EmulatedGear, Floats]:
    """The inputs that a table of runs varies, as a gear without emulator; its outputs (n, k).

    Raises `InputError` where the runs are too few, lack an output, or contradict each other.
    """
    source = table.source
    columns = {name: table[column(name)] for name in CHANNELS if column(name) in table}
    channels = tuple(name for name, values in columns.items() if np.isfinite(values).any())
    if not channels:
        raise InputError(f"{source}: no run has {', '.join(map(column, CHANNELS))}: simulate them")
    names = ["slip", "load", *declared(Soil)]
    present = [name for name in names if column(name) in table]
    inputs = tuple(n for n in present if np.ptp(table[column(n)]) > 0.0)
    if not {"slip", "load"} <= {*inputs}:
        raise InputError(f"{source}: slip and load_N must vary between the runs of a simulator")
    outputs = np.stack([table[column(name)] for name in channels], axis=1)
    known = np.asarray(np.isfinite(_columns(table, inputs)).all(axis=1))
    bad = np.asarray(~(np.isfinite(outputs) & known[:, None]))
    if bad.any():
        row, which = (int(i) for i in np.argwhere(bad)[0])
        raise InputError(
            f"{table.place(row)}: the run has no {column(channels[which])}; write its reason into "
            "the column status, or remove the row"
        )
    if len(table) < FEWEST * len(inputs):
        raise InputError(
            f"{source}: {len(table)} runs for {len(inputs)} inputs ({', '.join(inputs)}); needed "
            f"are {FEWEST * len(inputs)}, better {ADVISED * len(inputs)}: soilml plan runs "
            "proposes more"
        )
    x = _columns(table, inputs)
    _check_repeats(table, x, outputs)
    low, high = x.min(axis=0), x.max(axis=0)
    log = tuple(n == "load" or (n in prior and prior[n].log) for n in inputs)
    return EmulatedGear(
        radius=gear.radius,
        width=gear.width,
        inputs=inputs,
        lower=tuple(low.tolist()),
        upper=tuple(high.tolist()),
        logarithmic=log,
        channels=channels,
        emulate=_no_emulator,
    ), outputs


def _no_emulator(u: Floats) -> Floats:
    raise NotImplementedError("the runs have not been emulated")


def _columns(table: Table, names: Sequence[str]) -> Floats:
    return np.stack([table[column(name)] for name in names], axis=1)


def _check_repeats(table: Table, x: Floats, outputs: Floats) -> None:
    """Raise `InputError` for two runs of the same inputs whose outputs differ."""
    _, first, place = np.unique(x, axis=0, return_index=True, return_inverse=True)
    base = outputs[first[place.reshape(-1)]]
    apart = np.abs(outputs - base) > SAME * np.ptp(outputs, axis=0)
    if apart.any():
        row = int(np.argwhere(apart)[0][0])
        raise InputError(
            f"{table.place(row)}: the run differs from an earlier one with the same inputs; the "
            "simulator must give the same answer twice: fix its seed, or average its runs"
        )


def _check_soil(gear: EmulatedGear, soil: Soil, prior: Mapping[str, Prior], source: str) -> None:
    """Raise `InputError` where soil or priors are not those of the design."""
    for path in prior:
        if path in declared(Soil) and path not in gear.inputs:
            raise InputError(
                f"{source} does not vary {path}, which has a prior: vary it in the runs, or fix it"
            )
    for name, low, high in zip(gear.inputs, gear.lower, gear.upper, strict=True):
        if name in ("slip", "load"):
            continue
        own = prior.get(name)
        ends = (own.lower, own.upper) if own else (getattr(soil, name),) * 2
        if gear.beyond(name, np.asarray(ends, dtype=np.float64)).any():
            what = f"the prior of {name}" if own else f"{name} of [soil]"
            shown = f"{ends[0]:g} to {ends[1]:g}" if own else f"{ends[0]:g}"
            raise InputError(
                f"{what}, {shown}, reaches beyond the runs of {source}, {low:g} to {high:g} "
                f"{QUANTITIES[name].unit}: simulate more, or narrow it"
            )


def with_emulator_error(
    discrepancy: Mapping[str, Discrepancy], error: Mapping[str, float]
) -> dict[str, Discrepancy]:
    """The discrepancy of a model with the error of an emulator, by column, in quadrature."""
    found = dict(discrepancy)
    for key, std in error.items():
        own = found.get(key, Discrepancy())
        found[key] = replace(own, constant=float(np.hypot(own.constant, std)))
    return found
