"""`soilml identify`: analytic identification from measured rows."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from soilml.cli.options import OutputFile

if TYPE_CHECKING:
    from soilml.identification.fit import Fit
    from soilml.io.table import Table

FORMATS = ("table", "json")
DESCRIPTION = """\
Identify the soil parameters with which MODEL.toml explains the rows of
RUNS.csv.

  soilml identify MODEL.toml RUNS.csv --out result.json
  soilml identify MODEL.toml RUNS.csv --free cohesion,friction_angle
  soilml identify MODEL.toml RUNS.csv --method linear --where run=sand_3
  soilml identify MODEL.toml RUNS.csv --by run

RUNS.csv has the columns run, slip, load_N, torque_Nm (blank where not
measured) and optionally drawbar_pull_N, sinkage_m and <column>_std. Rows whose
status is not ok are ignored. A channel is used where its noise is declared, in
[noise] or by <column>_std. All rows are assumed to come from one soil, unless
--by run asks for a result for each run. Rows of several wheels name theirs,
one of [gears.NAME] in MODEL.toml, in the column gear.

Methods:
  averaged   (default) the soil averaged over explanations of the rows, each
             weighted by its evidence: the model as it is, a smooth error of
             it, effects of the catalogue; typical errors of sensors beside all
The others assume a perfect model, and sensors with [noise] and [bias] alone:
  posterior  the exact posterior under the priors and the noise
  nonlinear  bounded least squares on the full model, from several starts
  linear     cohesion and friction angle from sinkage; shear modulus known
  newton     friction angle, shear modulus and kphi; cohesion known

The verdict comes first; -v shows all of it, and --out FILE.json has the result
in SI units. `left of prior` (remaining_fraction in the file) is the width of
the estimate divided by that of the prior. Read the warnings.
"""
ARGUMENTS = (
    "model-and-runs",
    ("--method NAME (averaged)", "averaged, posterior, nonlinear, linear or newton"),
    "free",
    "effects",
    "by",
    "rows",
    ("--out FILE.json", "write the result to this file", OutputFile),
    "report",
)


def run(args: argparse.Namespace) -> int:
    """Identify and write the result."""
    from dataclasses import replace

    from soilml.cli.option_values import parse_names
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver
    from soilml.cli.tables import (
        print_table_hints,
        read_case_of_rows,
        read_rows,
        result_by_group,
        tell_failures,
    )
    from soilml.io.read_table import RUNS
    from soilml.optional_imports import need

    need("scipy", "identify")
    from soilml.identification import identify
    from soilml.identification.report import fit_report, group_report, soil_entries

    table = read_rows(args, RUNS)
    case = read_case_of_rows(
        args, args.model, table, available_effects(args), with_explanations=True, several=True
    )
    print_table_hints(table, case)
    free = parse_names(args.free)

    def solve(rows: Table) -> tuple[Fit, dict[str, Any]]:
        fit = identify(case, rows, free, args.method)
        content = fit.as_json() | soil_entries(case, fit, with_draws=args.by is None)
        return replace(fit, samples=None), content  # not those of thousands of runs together

    found, failed = result_by_group(args, table, "identifying", solve)
    title = f"Soil of {Path(args.runs).name}, by the model {Path(args.model).name}"
    fits = {name: fit for name, (fit, _) in found.items()}
    runs = {name: own for name, (_, own) in found.items()}
    if args.by is None:
        (content,), (fit,) = runs.values(), fits.values()
        report = fit_report(fit, title)
    else:
        content = {"by": args.by, "runs": runs, "failed": failed}
        report = group_report(fits, failed, args.by, title)
    deliver(args, report, content)
    tell_failures(args.by, failed)
    return 0
