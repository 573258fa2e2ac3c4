"""`soilml advise`: which measurement to make next."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from soilml.cli.advice_text import mean_covariates
from soilml.cli.option_values import available_effects, parse_names, parse_numbers
from soilml.cli.output import tell, write_columns
from soilml.cli.progress import working
from soilml.cli.table_reading import read_rows
from soilml.cli.table_remarks import print_table_hints
from soilml.config.case import Case, read_case_of_one_gear
from soilml.config.measurement_noise import Noise
from soilml.errors import InputError
from soilml.experiment_design import (
    Advice,
    RatedRow,
    advise,
    candidate_grid,
    samples_of_prior,
    samples_of_rows,
)
from soilml.experiment_design.candidate_rows import channel_label
from soilml.experiment_design.messages import next_row_messages
from soilml.fitting.free_parameters import select_free
from soilml.fitting.observations import Observations, read_observations
from soilml.io.read_table import RUNS
from soilml.optional_imports import need
from soilml.quantities import column
from soilml.remarks import texts

#: Largest number of rows planned in a sequence, and of operating points (slips times loads).
MAX_COUNT, MAX_POINTS = 5, 1000


def _with_noise_of_rows(case: Case, data: Observations) -> Case:
    """The case with the noise of the rows' columns where it declares none: their median."""
    noise = dict(case.noise)
    for channel in data.channels:
        key = column(channel.name)
        if key not in noise and channel.declared:
            std = float(np.nanmedian(channel.std[np.isfinite(channel.reading)]))
            noise[key] = Noise(constant=std)
            print(f"the noise of further {key} is taken from {key}_std: {std:.3g}", file=sys.stderr)
    return replace(case, noise=noise)


def run(args: argparse.Namespace) -> int:
    """Rate all candidates and write the table."""
    if args.picture is not None:
        need("matplotlib", "advise --picture")
    if not 1 <= args.count <= MAX_COUNT:
        raise InputError(f"--count is {args.count}; needed is a whole number from 1 to {MAX_COUNT}")
    if args.where is not None and args.runs is None:
        raise InputError("--where selects rows of RUNS.csv; give RUNS.csv too")
    case = read_case_of_one_gear(args.model, available_effects(args), args.gear)
    free = select_free(case, parse_names(args.free))
    slips, loads = (
        None if text is None else parse_numbers(option, text).tolist()
        for option, text in (("--slips", args.slips), ("--loads", args.loads))
    )
    if args.runs is None:
        ranges, at = candidate_grid(slips, loads), None
    else:
        table = read_rows(args, RUNS)
        print_table_hints(table, case)
        data = read_observations(case, table)
        case = _with_noise_of_rows(case, data)
        ranges, at = candidate_grid(slips, loads, data.load), data.at
    if len(ranges.slips) * len(ranges.loads) > MAX_POINTS:
        raise InputError(
            f"{len(ranges.slips)} slips times {len(ranges.loads)} loads are too many to try; "
            f"at most {MAX_POINTS} operating points are possible"
        )
    with working("rating the rows that could be next"):
        if at is None:
            samples = samples_of_prior(free, case=case)
        else:
            samples = samples_of_rows(case, data, free)
        known = {} if at is None else mean_covariates(at)
        advice = advise(case, samples, ranges, measured=at, count=args.count, covariates=known)
    if args.picture is not None:
        from soilml.experiment_design.plot import save_maps

        save_maps(args.picture, advice, at)
    if args.all:
        ranked = sorted(advice.choices, key=lambda c: c.overall)
        write_columns(_columns(advice, [("candidate", c) for c in ranked]), args.out)
    else:
        write_columns(_columns(advice, _best_rows(advice)), args.out)
    notes = [] if at is None else [*next_row_messages(advice), *texts(data.notes)]
    if case.discrepancy:
        notes.append(
            "the [discrepancy] of a next row counts as independent of that of other rows: "
            "repetitions are overrated"
        )
    if advice.excluded_points:
        notes.append(
            f"{advice.excluded_points} of {len(ranges.slips) * len(ranges.loads)} operating points "
            "are excluded: a twentieth or more of the posterior samples does not carry the wheel"
        )
    tell("\n".join(notes))
    return 0


def _best_rows(advice: Advice) -> list[tuple[str, RatedRow]]:
    """The rows of the table: reason and candidate."""
    rows = [("best in all", advice.best())]
    rows += [
        (f"best in all with {own[1]}", advice.best(None, own)) for own in advice.channel_sets[1:]
    ]
    rows += [(f"best for {name}", advice.best(name)) for name in advice.names]
    repeat = advice.best_repetition()
    if repeat is not None:
        rows.append(("best repeat", repeat))
    if len(advice.sequence) > 1:
        rows += [
            (f"row {i} of {len(advice.sequence)}", c) for i, c in enumerate(advice.sequence, 1)
        ]
    return rows


def _columns(advice: Advice, rows: Sequence[tuple[str, RatedRow]]) -> dict[str, Any]:
    """The table's columns."""
    choices = [choice for _, choice in rows]
    columns: dict[str, Any] = {
        "row": [why.replace("_", " ") for why, _ in rows],
        "channels": [channel_label(c.candidate.channels) for c in choices],
        "slip": np.asarray([c.candidate.slip for c in choices]),
        "load_N": np.asarray([c.candidate.load for c in choices]),
    }
    for i, name in enumerate(advice.names):
        columns[f"{name}_left"] = np.asarray([c.remaining_fraction[i] for c in choices])
    columns["all_left"] = np.asarray([c.overall for c in choices])
    return columns
