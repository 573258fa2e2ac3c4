"""Runs of a simulator: a design over slip, load and soil, further runs, and making them."""

from __future__ import annotations

import importlib.util
import shlex
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case
from soilml.config.simulator import SAME, Simulator, emulator_of
from soilml.errors import InputError, SoilmlError
from soilml.io.atomic_files import save_text
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.io.text_tables import csv_text
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.gears.emulated import EmulatedGear
from soilml.physics.soils import Soil
from soilml.quantities import CHANNELS, column

Columns = dict[str, Floats]

#: Runs for each input: of a first design, and of further ones.
FIRST, FURTHER = 20, 5
CANDIDATES = 1024  # Points among which further runs are chosen
LONGEST = 24 * 3600.0  # s, after which a command counts as hung
_SHOWN = 200  # Most characters of a simulator's own message


def design_inputs(case: Case) -> dict[str, Prior]:
    """Each input of a design by column with its range: slip, load and the soil's priors.

    Raises `InputError` for a case without [simulator].
    """
    if case.simulator is None:
        raise InputError("the model file has no [simulator]; needed are its table, slip and load_N")
    found = {
        column("slip"): Prior(*case.simulator.slip),
        column("load"): Prior(*case.simulator.load, log=True),
    }
    soils = {column(name): prior for name, prior in case.prior.items() if name in declared(Soil)}
    if not soils:
        raise InputError("[soil.prior] is empty: runs vary the soil in the ranges of its priors")
    return found | soils


def space_filling_runs(case: Case, count: int, seed: int = 0) -> Columns:
    """A Latin hypercube of little discrepancy over slip, load and the priors of the soil.

    Returns columns (count,). Raises `InputError` as `design_inputs` does.

    References: McKay, Beckman and Conover, Technometrics 21(2), 1979; Fang, Li and Sudjianto,
    Design and Modeling for Computer Experiments, 2006 (centred discrepancy).
    """
    from scipy.stats import qmc

    inputs = design_inputs(case)
    sampler = qmc.LatinHypercube(len(inputs), rng=seed, optimization="random-cd")
    u = sampler.random(count)
    return {
        name: np.asarray([float(f"{x:.7g}") for x in prior.at(u[:, i])])
        for i, (name, prior) in enumerate(inputs.items())
    }


def further_runs(case: Case, table: Table, count: int, seed: int = 0) -> Columns:
    r"""Runs where the emulator of a table of runs is least sure, (count,) each.

    From Sobol points, the one with the largest standard deviation of any channel over its spread is
    taken, again and again; the variance of the others falls by what correlates with it:

    .. math:: v(u) \leftarrow v(u) (1 - k(u, u_\ast)^2)

    Raises `InputError` as `soilml.config.simulator.design_of` does.
    """
    from scipy.stats import qmc

    inputs = design_inputs(case)
    assert case.simulator is not None
    gear, emulator = emulator_of(table, case.simulator.gear, case.prior)
    u = qmc.Sobol(len(inputs), rng=seed).random(CANDIDATES)
    values = {name: prior.at(u[:, i]) for i, (name, prior) in enumerate(inputs.items())}
    known = [column(name) for name in gear.inputs]
    if missing := [name for name in known if name not in inputs]:
        raise InputError(f"{table.source} varies {missing[0]}, which has no prior in [soil.prior]")
    points = gear.fractions(np.stack([values[name] for name in known], axis=1))
    spread = np.stack([np.std(table[column(name)]) for name in gear.channels])
    variance = (emulator.std(points) / np.maximum(spread, 1e-300)) ** 2
    chosen = []
    for _ in range(count):
        best = int(np.argmax(variance.max(axis=1)))
        chosen.append(best)
        for i, part in enumerate(emulator.parts):
            near = part.correlation(points, points[best : best + 1])[:, 0]
            variance[:, i] *= np.maximum(1.0 - near**2, 0.0)
    return {
        name: np.asarray([float(f"{x:.7g}") for x in own[chosen]]) for name, own in values.items()
    }


def run_simulator(simulator: Simulator, design: Mapping[str, Floats]) -> dict[str, Any]:
    """The design (n,) with the outputs of the simulator, and status where it states one.

    It runs the Python file or the command of the model file, which may do all that its user may:
    call it for a file that you would run yourself.

    The first run is made twice. Raises `InputError` where the simulator fails, gives no number,
    lacks a channel or rows, or answers the same question in two ways.
    """
    found = _answers(simulator, design)
    again = _answers(simulator, {name: values[:1] for name, values in design.items()})
    for key in (k for k in found if k != "status"):
        size = float(np.ptp(found[key][np.isfinite(found[key])], axis=0)) if len(found[key]) else 0
        if abs(again[key][0] - found[key][0]) > SAME * max(size, 1e-300):
            raise InputError(
                f"the simulator gave {key} = {found[key][0]:.6g}, then {again[key][0]:.6g} for "
                "the same run; fix its seed, or average its runs"
            )
    return {**design, **found}


def _answers(simulator: Simulator, design: Mapping[str, Floats]) -> dict[str, Any]:
    """The outputs (n,) by column, checked."""
    try:
        answer = (_called if simulator.python else _commanded)(simulator, design)
    except SoilmlError:
        raise
    except Exception as error:
        said = " ".join(str(error).split())[:_SHOWN]
        raise InputError(f"the simulator failed: {type(error).__name__}: {said}") from None
    count = len(design["slip"])
    found: dict[str, Any] = {}
    for key in map(column, CHANNELS):
        if key in answer:
            found[key] = np.asarray(answer[key], dtype=np.float64).reshape(-1)
            if len(found[key]) != count:
                raise InputError(
                    f"the simulator gave {len(found[key])} values of {key} for {count} runs"
                )
    if not found:
        needed = ", ".join(map(column, CHANNELS))
        raise InputError(f"the simulator gave {', '.join(answer) or 'nothing'}; needed is {needed}")
    failed = np.zeros(count, bool)
    if "status" in answer:
        found["status"] = np.asarray(answer["status"]).astype(str)
        failed = found["status"] != "ok"
    for key, values in found.items():
        if key != "status" and (bad := ~np.isfinite(values) & ~failed).any():
            row = int(np.argmax(bad))
            at = ", ".join(f"{name} {own[row]:.4g}" for name, own in design.items())
            raise InputError(
                f"the simulator gave no number for {key} in run {row + 1} ({at}); it may say why "
                "in a column status"
            )
    return found


def _called(simulator: Simulator, design: Mapping[str, Floats]) -> Mapping[str, Any]:
    """The outputs of FILE.py:FUNCTION, which is called with the columns of the design."""
    path, function = simulator.python, simulator.function
    assert path is not None
    if not path.is_file():
        raise InputError(f"[simulator] python: {path}: there is no such file")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    if not callable(getattr(module, function, None)):
        raise InputError(f"[simulator] python: {path} has no function {function!r}")
    answer = getattr(module, function)({key: values.copy() for key, values in design.items()})
    if not isinstance(answer, Mapping):
        raise InputError(
            f"[simulator] python: {function} gave a {type(answer).__name__}; needed is a dict of "
            "columns, such as torque_Nm"
        )
    return answer


def _commanded(simulator: Simulator, design: Mapping[str, Floats]) -> Mapping[str, Any]:
    """The outputs of a command, which reads a table of the design and writes one of the runs."""
    with tempfile.TemporaryDirectory() as folder:
        asked, answered = Path(folder) / "design.csv", Path(folder) / "runs.csv"
        save_text(asked, csv_text(dict(design)))
        words = [
            word.replace("{design}", str(asked)).replace("{runs}", str(answered))
            for word in shlex.split(simulator.command)
        ]
        try:
            done = subprocess.run(
                words, cwd=simulator.folder, capture_output=True, text=True, timeout=LONGEST
            )
        except OSError as error:
            raise InputError(f"[simulator] command: {words[0]}: {error.strerror}") from None
        if done.returncode != 0:
            last = (done.stderr.strip().splitlines() or ["it says nothing"])[-1]
            raise InputError(f"the simulator ended with status {done.returncode}: {last[:_SHOWN]}")
        if not answered.is_file():
            raise InputError("the simulator wrote no table of {runs}")
        return dict(read_table(answered, ignore_extra=True).columns)


def emulator_lines(table: Table, gear: EmulatedGear, error: Floats) -> list[tuple[str, ...]]:
    """Channel, error of the emulator, and that as a share of the spread of the runs, in %."""
    spread = [max(float(np.std(table[column(name)])), 1e-300) for name in gear.channels]
    return [
        (column(name), f"{own:.3g}", f"{100.0 * own / all_:.2g}")
        for name, own, all_ in zip(gear.channels, error, spread, strict=True)
    ]
