"""`soilml plan effects`: effects that a rig and an experimental design could identify."""

from __future__ import annotations

import argparse

from soilml.cli.options import InputFile, OutputFile

FORMATS = ("table", "json")
DESCRIPTION = """\
Determine which missing effects the planned runs of DESIGN.csv could identify
with the sensors of MODEL.toml, and which they could not. No measurement is
needed.

  soilml plan effects MODEL.toml DESIGN.csv
  soilml plan effects MODEL.toml DESIGN.csv --out audit.json

DESIGN.csv has the columns run, slip, load_N, and speed_m_s, pass,
slip_angle_rad where they are set. Channels are those whose noise is declared
in [noise].

In the table, `left` is the signal of an effect of its reference size in
standard deviations of the noise (sigma) after the free soil parameters have
absorbed what they can, and `apart` is the part of it that its most similar
rival cannot explain: an effect can be named from about 3. `detectable` is the
smallest size that is noticed in four of five data sets.
"""
ARGUMENTS = (
    ("model MODEL.toml", "gear, soil and noise", InputFile),
    ("design DESIGN.csv", "planned rows: CSV, Parquet or .xlsx", InputFile),
    "free",
    ("--out FILE.json", "write the audit to this file", OutputFile),
    "ignore-extra",
    "effects",
)


def run(args: argparse.Namespace) -> int:
    """Audit and print or write."""
    from soilml.cli.option_values import parse_names
    from soilml.cli.options import available_effects
    from soilml.cli.output import deliver, tell
    from soilml.cli.progress import working
    from soilml.cli.tables import read_long_table
    from soilml.config.case import read_case
    from soilml.fitting.covariance import ignored_discrepancy
    from soilml.gap import audit

    design = read_long_table(args.design, ("run", "slip", "load_N"), ignore_extra=args.ignore_extra)
    effects = available_effects(args)
    case = read_case(args.model, effects, with_explanations=True)
    with working(f"auditing {len(design)} rows"):
        found = audit(case, design, free=parse_names(args.free), effects=effects)
    deliver(args, found.report(), found.as_json())
    for line in ignored_discrepancy(case, "the audit", "effects are harder to name than it says"):
        tell(line.text)
    return 0
