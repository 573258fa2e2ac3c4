"""`soilml setup check`: whether this installation works, and what it can do."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from importlib import metadata

from soilml.errors import SoilmlError

DESCRIPTION = """\
Check this installation: which libraries are present and in which version, what
brings the missing ones (pip install '.[EXTRA]'), and whether the released
model files give their known answers on this machine. The exit status is 1
where something that the installed parts need does not work.
"""
#: Extras for those who develop soilml.
_DEVELOPMENT = ("browser", "coverage", "dev", "docs", "mutation")
#: The name of a library that the package asks for, and the extra that brings it.
_REQUIRED = re.compile(r"([\w.-]+)[^;]*(?:;.*extra == '(\w+)')?")
ARGUMENTS = ()


def run(args: argparse.Namespace) -> int:
    """Print the findings; 1 where something does not work."""
    import platform

    from soilml import __version__
    from soilml.processes import usable_cores
    from soilml.report.aligned_text import format_table

    print(f"soilml {__version__}, Python {platform.python_version()}, {platform.platform()}")
    print(f"{usable_cores()} usable cores; {sys.executable}\n")
    rows = [(name, _version(name) or "-", extra or "") for name, extra in _libraries()]
    print(format_table(("library", "version", "extra"), rows, text_columns=3))
    problems = list(_problems())
    print()
    for text in problems:
        print(f"! {text}")
    if not problems:
        print("released model files give their known answers; nothing is wrong")
    return 1 if problems else 0


def _libraries() -> Iterator[tuple[str, str | None]]:
    """Libraries and the extra of each, None where everything needs it."""
    try:
        needed = metadata.requires("soilml") or []
    except metadata.PackageNotFoundError:  # run from its folder, without being installed
        needed = ["numpy", "onnxruntime"]
    for text in needed:
        found = _REQUIRED.match(text)
        if found and found[1] != "tomli" and found[2] not in _DEVELOPMENT:
            yield found[1], found[2]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _problems() -> Iterator[str]:
    """What does not work: missing libraries, model files that fail."""
    missing = [name for name, extra in _libraries() if extra is None and not _version(name)]
    yield from (f"{name} is missing: pip install {name}" for name in missing)
    if missing:
        return
    from soilml.onboard.estimator import Estimator
    from soilml.onboard.model_file import released_models

    files = released_models()
    if not files:
        yield "no released model files are part of this installation"
    for file in files.values():
        try:
            Estimator.load(file)
        except SoilmlError as error:
            yield str(error)
