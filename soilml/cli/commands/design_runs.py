"""`soilml plan runs`: the runs of another simulator that stand in for the equations."""

from __future__ import annotations

import argparse

from soilml.cli.option_values import whole_number_from
from soilml.cli.options import InputFile, OutputFile

DESCRIPTION = """\
Propose the runs of [simulator] in MODEL.toml: slip, load and the soil in the
ranges of its priors. Make them with the simulator, add torque_Nm,
drawbar_pull_N and sinkage_m, as far as it has them, and store the rows as the
table of [simulator]; then identify, pull and gap use that simulator.

  soilml plan runs MODEL.toml --out design.csv             the first runs
  soilml plan runs MODEL.toml --count 40 --out more.csv    40 more

The runs fill the space evenly. Where the table exists, further runs fill it
anew, to be added to it. The error of the emulator is printed: it is a part of
every interval.
"""
ARGUMENTS = (
    ("model MODEL.toml", "gear, soil, priors and [simulator]", InputFile),
    ("--count N", "number (default: 20 for each input, then 5)", whole_number_from(1, 100_000)),
    "seed",
    ("--out DESIGN.csv", "write the design to this file", OutputFile),
)


def run(args: argparse.Namespace) -> int:
    """Propose the runs."""
    from soilml.cli.output import tell, write_columns
    from soilml.config.case import read_case
    from soilml.config.simulator import emulator_of, read_runs
    from soilml.errors import InputError
    from soilml.experiment_design import simulator_runs as runs
    from soilml.io.atomic_files import check_outputs
    from soilml.optional_imports import need
    from soilml.quantities import column

    need("scipy", "plan runs")
    case = read_case(args.model, with_bias=True, with_simulator=False)
    inputs = runs.design_inputs(case)
    assert case.simulator is not None
    simulator = case.simulator
    if simulator.runs is None:
        raise InputError(
            f"{args.model} [simulator] has its runs within it; needed is table, the file of them"
        )
    if simulator.runs.is_file():
        check_outputs([args.out] if args.out else [], [str(simulator.runs)])
        earlier = read_runs(simulator.runs)
        made = emulator_of(earlier, simulator.gear, case.prior)
        if missing := [c for c in map(column, made[0].inputs) if c not in inputs]:
            raise InputError(
                f"{earlier.source} varies {missing[0]}, which has no prior in [soil.prior]"
            )
        tell("\n".join(runs.emulator_errors(earlier, *made)))
        most, seed = runs.FURTHER, args.seed + len(earlier)  # not the runs of before
    else:
        most, seed = runs.FIRST, args.seed
    count = args.count or most * len(inputs)
    write_columns(runs.space_filling_runs(case, count, seed), args.out)
    return 0
