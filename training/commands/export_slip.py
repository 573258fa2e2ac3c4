"""`soilml export slip`: the filter of `soilml drive slip` for the board, as ONNX and as C."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.option_values import NumberFrom, whole_number_from
from soilml.cli.options import InputFile, OutputFile
from soilml.io.atomic_files import output_files

DESCRIPTION = """\
Write one step of the filter of `soilml drive slip` for a rover: belief and
readings in, belief, speed, slips and flags out. All shapes are numbers, so
that memory and time of a step are fixed.

  soilml export slip ROVER.toml rover_slip.onnx
  soilml export slip ROVER.toml rover_slip.onnx --c rover_slip.c --draws 512

ROVER.toml is that of `soilml drive slip`. The table of its forces is part of
the file: fewer --draws are smaller and coarser. soilml.onboard.slip_stream
runs OUT.onnx with numpy and onnxruntime alone; OUT.c needs the C library
alone.
"""
SOILS = 1024
STEEPEST = 25.0  # Degrees; pitch to either side for which loads are tabulated
ARGUMENTS = (
    ("rover ROVER.toml", "rover and prior", InputFile),
    ("out OUT.onnx", "file to write", OutputFile),
    ("--c OUT.c", "C file to write too; OUT.h is beside it"),
    (f"--draws N ({SOILS})", "draws of the prior", whole_number_from(32, 16384)),
    ("--least-speed M/S (0.005)", "of a rim that turns", NumberFrom(1e-4, 10.0, "m/s")),
    "effects",
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    return [Path(args.out), *output_files(args.c, ".c", ".h")]


def run(args: argparse.Namespace) -> int:
    """Make the table and write the files."""
    from soilml.cli.options import available_effects
    from soilml.cli.output import tell
    from soilml.cli.progress import working
    from soilml.config.case import read_case
    from soilml.io.atomic_files import write_files
    from soilml.optional_imports import need
    from training.export_c.c_names import check_c_name
    from training.slip_step.files import slip_files

    need("onnx", "export slip")
    need("jinja2", "export slip")
    if args.c is not None:
        check_c_name(Path(args.c))
    case = read_case(args.rover, available_effects(args))
    with working(f"tabulating forces on {args.draws} soils"):
        found = slip_files(case, args.draws, STEEPEST, args.least_speed, args.c, args.out)
    paths = outputs(args)

    def model(path: Path) -> None:
        path.write_bytes(found.model)

    texts = [found.source, found.header] if args.c is not None else []
    write_files(dict(zip(paths, [model, *texts], strict=True)))
    tell(
        f"written: {', '.join(map(str, paths))}; {found.grounds} grounds, "
        f"{found.state_bytes / 1000:.0f} kB of state, {len(found.model) / 1e6:.1f} MB"
    )
    return 0
