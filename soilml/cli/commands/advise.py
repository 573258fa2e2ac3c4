"""`soilml advise`: which measurement to make next."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from soilml.cli.advice_text import covariates
from soilml.cli.commands.identify import add_row_options, chosen_rows
from soilml.cli.commands.simulate import numbers
from soilml.cli.effects_option import add_effects_option, chosen_effects
from soilml.cli.output import deliver
from soilml.config.case import read_case
from soilml.errors import InputError
from soilml.experiment_design import (
    Advice,
    RatedRow,
    advise,
    candidate_grid,
    samples_of_prior,
    samples_of_rows,
)
from soilml.experiment_design.candidate_rows import channel_words
from soilml.experiment_design.messages import next_row_messages
from soilml.identification.free_parameters import select_free
from soilml.identification.observations import read_observations
from soilml.io.atomic_files import named
from soilml.io.read_table import RUNS
from soilml.optional_imports import need

#: Most rows that are planned ahead, and most slips times loads that are tried.
MOST_AHEAD, MOST_POINTS = 5, 1000

HELP = "which row to drive next, and what it would leave open"
DESCRIPTION = """\
Say what the rows of RUNS.csv leave open of each parameter with a prior in MODEL.toml, and which
next row, at another slip or load or with another sensor, would narrow it most.

  soilml advise MODEL.toml RUNS.csv
  soilml advise MODEL.toml RUNS.csv --slips 0.1,0.3,0.5 --loads 30:120:4 --count 3
  soilml advise MODEL.toml --loads 30:120:4 --picture map.png     before anything is measured

Each candidate is judged by the width that it is expected to leave: its readings are simulated for
soils that are still possible, and the exact posterior of each is averaged. <parameter>_left is that
width over the prior's: 1 where nothing is known. Rows of the answer: the best in all, the best
for each parameter, the best repetition of what was driven, then the best --count rows one after
the other, whose widths are what is left after all of them. --all gives every candidate instead.
Channels are those whose noise [noise] declares: torque, and torque with each other one. Without
--loads, loads from half to twice those driven are tried. Points where a twentieth of the soils that
are still possible would not carry the wheel are left out. It believes the model, as the posterior
does.
"""


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("model", metavar="MODEL.toml")
    parser.add_argument("runs", metavar="RUNS.csv", nargs="?", help="rows measured so far")
    parser.add_argument("--slips", metavar="A,B,...", help="slips that can be driven")
    parser.add_argument("--loads", metavar="A,B,...", help="loads that can be driven, N")
    parser.add_argument("--count", type=int, default=3, help="rows to plan ahead, 1 to 5")
    parser.add_argument("--free", metavar="A,B,...", help="parameters to find")
    parser.add_argument("--all", action="store_true", help="every candidate, the best first")
    add_effects_option(parser)
    add_row_options(parser)
    parser.add_argument("--out", metavar="FILE.csv", help="where to write the table")
    parser.add_argument("--picture", metavar="FILE.png", type=Path, help="maps over slip and load")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    picture = None if args.picture is None else str(args.picture)
    return [*named(args.out, ".csv"), *named(picture, ".png")]


def run(args: argparse.Namespace) -> int:
    """Score all candidates and deliver the table."""
    if args.picture is not None:
        need("matplotlib", "advise --picture")
    if not 1 <= args.count <= MOST_AHEAD:
        raise InputError(
            f"--count is {args.count}; needed is a whole number from 1 to {MOST_AHEAD}"
        )
    if args.where is not None and args.runs is None:
        raise InputError("--where chooses rows of RUNS.csv; give that too")
    case = read_case(args.model, chosen_effects(args))
    free = select_free(
        case, None if args.free is None else [n.strip() for n in args.free.split(",")]
    )
    slips, loads = (
        None if text is None else numbers(option, text).tolist()
        for option, text in (("--slips", args.slips), ("--loads", args.loads))
    )
    if args.runs is None:
        ranges, at, belief = candidate_grid(slips, loads), None, None
    else:
        data = read_observations(case, chosen_rows(args, RUNS))
        ranges, at = candidate_grid(slips, loads, data.load), data.at
    if len(ranges.slips) * len(ranges.loads) > MOST_POINTS:
        raise InputError(
            f"{len(ranges.slips)} slips and {len(ranges.loads)} loads are too many to try; at most "
            f"{MOST_POINTS} together"
        )
    belief = samples_of_prior(free) if at is None else samples_of_rows(case, data, free)
    known = {} if at is None else covariates(at)
    found = advise(case, belief, ranges, driven=at, count=args.count, covariates=known)
    if args.picture is not None:
        from soilml.experiment_design.plot import save_maps

        save_maps(args.picture, found, at)
    if args.all:
        ranked = sorted(found.choices, key=lambda c: c.overall)
        deliver(_columns(found, [("candidate", c) for c in ranked]), args.out)
    else:
        deliver(_columns(found, _chosen(found)), args.out)
    said = [] if at is None else [*next_row_messages(found), *data.notes]
    if found.stuck:
        said.append(
            f"{found.stuck} of {len(ranges.slips) * len(ranges.loads)} points are left out: of the "
            "soils that are still possible, a twentieth or more would not carry the wheel there"
        )
    print("\n".join(said), file=sys.stderr)
    return 0


def _chosen(found: Advice) -> list[tuple[str, RatedRow]]:
    """What the table shows of all choices: why, and which."""
    rows = [("best in all", found.best())]
    rows += [(f"best in all with {own[1]}", found.best(None, own)) for own in found.sets[1:]]
    rows += [(f"best for {name}", found.best(name)) for name in found.names]
    repeat = found.repeat()
    if repeat is not None:
        rows.append(("best repeat", repeat))
    if len(found.sequence) > 1:
        rows += [(f"row {i} of {len(found.sequence)}", c) for i, c in enumerate(found.sequence, 1)]
    return rows


def _columns(found: Advice, rows: Sequence[tuple[str, RatedRow]]) -> dict[str, Any]:
    """The table's columns."""
    choices = [choice for _, choice in rows]
    columns: dict[str, Any] = {
        "row": [why.replace("_", " ") for why, _ in rows],
        "channels": [channel_words(c.candidate.channels) for c in choices],
        "slip": np.asarray([c.candidate.slip for c in choices]),
        "load_N": np.asarray([c.candidate.load for c in choices]),
    }
    for i, name in enumerate(found.names):
        columns[f"{name}_left"] = np.asarray([c.left[i] for c in choices])
    columns["all_left"] = np.asarray([c.overall for c in choices])
    return columns
