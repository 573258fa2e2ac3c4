"""`soilml plan runs`: the runs of another simulator that stand in for the equations."""

from __future__ import annotations

import argparse
from typing import Any

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile, OutputFile

DESCRIPTION = """\
Propose the runs of [simulator] in MODEL.toml: slip, load and the soil in the
ranges of its priors. With --trust, the python or command of [simulator] makes
the runs, which are written to its table; then identify, pull and gap use that
simulator. It is code from the model file, and may do all that you may.

  soilml plan runs MODEL.toml                    the runs, as a table
  soilml plan runs MODEL.toml --trust            makes them
  soilml plan runs MODEL.toml --trust --count 40 40 more where it is unsure
  soilml plan runs MODEL.toml --out design.csv   the runs, as a file

The first runs fill the space evenly. Where the table exists, further runs are
those at which the emulator of the runs is least sure. The error of the
emulator is printed: it is a part of every interval. A design of --out has no
outputs; add torque_Nm, drawbar_pull_N and sinkage_m, as far as the simulator
has them, and store it as the table of [simulator].
"""
ARGUMENTS = (
    ("model MODEL.toml", "gear, soil, priors and [simulator]", InputFile),
    ("--count N", "number (default: 20 for each input, then 5)", whole_number_from(1, 100_000)),
    ("--trust", "run the python or command of [simulator]"),
    "seed",
    ("--out DESIGN.csv", "write the design without making the runs", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Propose the runs; make them where the simulator can be called."""
    import numpy as np

    from soilml.cli.output import show, tell, write_columns
    from soilml.cli.progress import working
    from soilml.config.case import read_case
    from soilml.config.simulator import emulator_of, read_runs
    from soilml.errors import InputError
    from soilml.experiment_design import simulator_runs as runs
    from soilml.io.atomic_files import save_text
    from soilml.io.cell_text import one_line
    from soilml.io.text_tables import csv_text
    from soilml.optional_imports import need
    from soilml.report.aligned_text import format_table

    need("scipy", "plan runs")
    case = read_case(args.model, with_bias=True, with_simulator=False)
    inputs = runs.design_inputs(case)
    assert case.simulator is not None
    simulator, earlier = case.simulator, None
    if simulator.runs is None:
        raise InputError(
            f"{args.model} [simulator] has its runs within it; needed is table, the file of them"
        )
    if args.trust and not simulator.code:
        raise InputError(f"--trust: {args.model} [simulator] has neither python nor command")
    if simulator.runs.is_file():
        earlier = read_runs(simulator.runs)
        count = args.count or runs.FURTHER * len(inputs)
        design = runs.further_runs(case, earlier, count, args.seed)
    else:
        count = args.count or runs.FIRST * len(inputs)
        design = runs.space_filling_runs(case, count, args.seed)
    if args.out is not None or not args.trust:
        write_columns(design, args.out)
        if simulator.code and args.out is None:
            tell(f"nothing was run; with --trust this makes the runs: {one_line(simulator.code)}")
        return 0
    with working(f"running the simulator {count} times"):
        made: dict[str, Any] = runs.run_simulator(simulator, design)
    if earlier is not None:
        keys = [key for key in made if key in earlier or key == "status"]
        ok = np.full(len(earlier), "ok")
        before = {key: earlier.columns.get(key, ok) for key in keys}
        made = {key: np.concatenate([before[key], made[key]]) for key in keys}
    save_text(simulator.runs, csv_text(made))
    tell(f"{len(made['slip'])} runs in {simulator.runs}")
    table = read_runs(simulator.runs)
    gear, emulator = emulator_of(table, simulator.gear, case.prior)
    head = ("channel", "error of the emulator", "% of the spread of the runs")
    show(format_table(head, runs.emulator_lines(table, gear, emulator.error)))
    return 0
