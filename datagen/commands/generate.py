"""`soilml generate`: synthetic measured data from a recipe."""

from __future__ import annotations

import argparse
import os
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile
from soilml.errors import InputError
from soilml.io.atomic_files import output_files

if TYPE_CHECKING:
    from datagen.generate import Engine

#: Names of the engines: processes of this machine, or workers of dask.
ENGINES = ("processes", "dask")
DESCRIPTION = """\
Simulate the rover of RECIPE.toml and write what its sensors would measure,
with the true soil parameters in further columns.

  soilml generate recipe.toml data.parquet
  soilml generate wheel data.parquet --rows 20000 --seed 7
  soilml generate wheel data/ --rows 100000000
  soilml generate wheel data/ --rows 1000000000 --engine dask \
      --scheduler tcp://10.0.0.1:8786

`wheel` is a packaged recipe, like wheel_test, wheel_leg and benchmark.

A recipe is a model file with rows and seed at the top, and

  [operating]                ranges of slip (ratio) and load (N)
  slip = [0.05, 0.6]
  load_N = [30, 120]

  [bias]                     sensor biases, one random value for each run
  torque_Nm = "1 %"

  [[runs]]                   rows measured on one soil, share of all rows
  rows = 8
  share = 1.0

[soil.prior] gives the ranges of the parameters that vary. [stick_slip] adds
the vibration of a wheel-leg: ranges of stiffness (N/m) and of drop (fraction
of the friction angle that sliding soil loses), turning (rad/s), foot_mass
(kg), ...; or law = "line" alone. [worlds] adds runs in which an effect acts
that the model lacks (effect = 0.4) or a smooth error (error = 0.5). The same
recipe and seed give the same bytes, on any number of processes (--workers) and
with either engine.

OUT is a file, or with a slash at its end a folder of files that the workers
write. The same command completes a folder after an interruption: files that
are there and right are kept. `soilml train` reads the folder like one file.
docs/how-to/train.md describes generation on several machines.
"""


ARGUMENTS = (
    ("recipe RECIPE.toml", "recipe file, or the name of a packaged recipe", InputFile),
    ("out OUT.parquet", "file to write, or with a slash at its end a folder"),
    ("--rows N", "number of rows (default: that of the recipe)", whole_number_from(1)),
    ("--seed N", "of the random numbers (default: that of the recipe)", whole_number_from(0)),
    "workers",
    ("--engine NAME", "processes of this machine (default) or dask", {"choices": ENGINES}),
    ("--scheduler ADDRESS", "of dask (default for --engine dask: one on this machine)"),
    ("--device NAME", "solve by torch on this device, such as cuda; agrees to 1e-9"),
    "effects",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes, where they are not in a folder."""
    if args.scheduler is not None and args.engine != "dask":
        raise InputError("--scheduler is for --engine dask: add it, or omit --scheduler")
    if args.device is not None and (args.engine == "dask" or args.workers is not None):
        raise InputError("--device is solved on by one process: omit --workers and --engine dask")
    if args.scheduler is not None and args.workers is not None:
        raise InputError("--workers is for this machine; a scheduler has its own: omit --workers")
    if not args.out:
        raise InputError("OUT is empty; needed is a .parquet file or a folder")
    return [] if _is_folder(args.out) else output_files(args.out, ".parquet")


def _is_folder(out: str) -> bool:
    return out.endswith(("/", os.sep)) or Path(out).is_dir()


def run(args: argparse.Namespace) -> int:
    """Generate the file."""
    from soilml.optional_imports import need

    need("datagen.generate", "generate")
    from datagen.generate import generate, generate_folder
    from datagen.recipe import read_recipe
    from soilml.cli.options import available_effects
    from soilml.cli.output import tell
    from soilml.cli.progress import progress_bar
    from soilml.fitting.covariance import ignored_discrepancy
    from soilml.physics.computing_device import computing_on

    recipe = read_recipe(args.recipe, available_effects(args)).sized(args.rows, args.seed)
    if args.device is not None and recipe.case.simulator is not None:
        raise InputError("--device solves equations, and [simulator] has none: omit it")
    write = generate_folder if _is_folder(args.out) else generate
    try:
        on_device = nullcontext() if args.device is None else computing_on(args.device)
        with on_device, progress_bar("simulating", recipe.rows) as progress:
            result = write(recipe, args.out, progress, _engine(args))
    except (KeyboardInterrupt, SystemExit) as stop:
        if write is generate_folder and (files := len(list(Path(args.out).glob("part-*.parquet")))):
            stop.said = (  # type: ignore[union-attr]
                f"interrupted; {files} complete files are in {args.out}: the same command adds the "
                "others"
            )
        raise
    consequence = (
        "errors of the model are neither in the rows nor in the intervals of files trained on them"
    )
    if recipe.case.simulator is None or recipe.case.simulator.states_discrepancy:
        for line in ignored_discrepancy(recipe.case, "generate", consequence):
            print(line, file=sys.stderr)
    if recipe.case.simulator is not None:
        text = "the error of the simulator's emulator is in the rows, one draw of it a run"
        print(text, file=sys.stderr)
    if (learned := recipe.case.remainder) is not None:
        what = f"[remainder] of {', '.join(learned.columns)}"
        print(f"{what} is in the rows: its mean, and one draw of its error a run", file=sys.stderr)
    note = f", {result.failed} without equilibrium" if result.failed else ""
    kept = f", {result.kept} of them there before" if result.kept else ""
    tell(f"{result.rows} rows{note} written to {args.out}{kept}")
    return 0


def _engine(args: argparse.Namespace) -> Engine:
    """The engine of the options."""
    from functools import partial

    from datagen.dask_cluster import dask_map
    from soilml.processes import FORKS, process_map

    if args.engine == "dask":
        return partial(dask_map, workers=args.workers, scheduler=args.scheduler)
    if args.device is not None or (args.effects is not None and not FORKS):
        return partial(process_map, workers=1)  # processes cannot import the effects of a file
    return partial(process_map, workers=args.workers)
