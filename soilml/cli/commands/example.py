"""`soilml example`: files to try the commands with."""

from __future__ import annotations

import argparse
from pathlib import Path

from soilml.cli.options import SEVERAL
from soilml.errors import InputError, did_you_mean

DESCRIPTION = """\
Write an example into a folder, and say which command to run on it.

  soilml example FOLDER               a campaign whose model lacks an effect
  soilml example log FOLDER           the recording of a rig, in its own units
  soilml example rover FOLDER         a rover, and rows of one of its wheels
  soilml example design FOLDER        a rover whose wheels are to be chosen

and what the source papers measured:

  soilml example sensor-wheel FOLDER  readings of four sensors in a wheel's rim
  soilml example climb FOLDER         gentle climbs of a rover with such wheels
  soilml example wheel-leg FOLDER     strides of a wheel-leg on two soils
  soilml example track FOLDER         the log of a tracked robot's pulls

All measurements are simulated, with noise. Existing files are not replaced.
"""
#: The command that comes next, by name of the example; {} is the folder.
NEXT = {
    "campaign": "gap {}/model.toml {}/runs.csv --out {}/gap",
    "log": "import --init {}/rig.csv --out {}/map.toml",
    "design": "plan wheels {}/rover.toml --picture {}/design.png",
    "rover": "pull {}/rover.toml {}/runs.csv --slope 0,10,20",
    "sensor-wheel": "paper sensor-wheel {}/model.toml {}/runs.csv --readings {}/readings.csv",
    "climb": "paper climb {}/rover.toml {}/runs.csv --stress {}/stress.csv",
    "wheel-leg": "paper wheel-leg {}/strides.csv --by run",
    "track": "paper track {}/model.toml {}/log.csv --mass 130 --spacing 0.6",
}
ARGUMENTS = (
    (
        "words [NAME] FOLDER",
        f"{', '.join(NEXT)} (default: campaign), and the folder for its files",
        SEVERAL,
    ),
)


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that the command writes."""
    from soilml.cli.options import folder_outputs

    name, folder = _name_and_folder(args)
    return folder_outputs("FOLDER", str(folder), [file.name for file in _files(name)])


def run(args: argparse.Namespace) -> int:
    """Write the files, and say what to do next."""
    from soilml.cli.output import show
    from soilml.io.atomic_files import write_files

    name, folder = _name_and_folder(args)
    texts = {folder / file.name: file.read_text(encoding="utf-8") for file in _files(name)}
    if taken := [str(file) for file in texts if file.exists()]:
        raise InputError(f"{taken[0]} exists; give another folder")
    write_files(texts, folders=[folder])
    command = NEXT[name].replace("{}", str(folder))
    show(f"{', '.join(map(str, texts))} written. Next: soilml {command}")
    return 0


def _name_and_folder(args: argparse.Namespace) -> tuple[str, Path]:
    name, folder = args.words if len(args.words) == 2 else ("campaign", args.words[0])
    if len(args.words) > 2 or name not in NEXT:
        near = did_you_mean(name, list(NEXT))
        raise InputError(f"no example {name!r}; {near}there are: {', '.join(NEXT)}")
    return name, Path(folder)


def _files(name: str) -> list[Path]:
    """The files of an example: in the package, or beside it in a checkout of the project."""
    package = Path(__file__).parents[2]
    folders = (package / "examples" / name, package.parent / "examples" / name)
    folder = next(folder for folder in folders if folder.is_dir())
    return sorted(file for file in folder.iterdir() if file.suffix in (".toml", ".csv"))
