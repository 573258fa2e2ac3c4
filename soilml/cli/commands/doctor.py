"""`soilml setup check`: whether this installation works, and what it can do."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from importlib import metadata

from soilml.errors import SoilmlError

DESCRIPTION = """\
Check this installation: which libraries are present and in which version, what
cannot be done without the missing ones, and whether a released model file
gives its known answers on this machine. The exit status is 1 where something
that the installed parts need does not work.
"""
#: What needs each library, beside the board's own two.
USES = {
    "numpy": "everything",
    "onnxruntime": "estimate: model files",
    "scipy": "identify, gap, pull, generate",
    "pyarrow": "Parquet tables; generate, train",
    "python-calamine": "spreadsheets (.xlsx)",
    "pint": "import",
    "h5py": "import of MATLAB 7.3",
    "mcap": "import of MCAP",
    "rosbags": "import of ROS bags",
    "matplotlib": "pictures",
    "jinja2": "report of gap; export c",
    "onnx": "train, export c",
    "torch": "generate --device; gradients of the forward model",
    "scikit-learn": "train",
    "array-api-compat": "the forward model on torch tensors",
    "shtab": "completion",
    "tornado": "serve",
    "tifffile": "drive map",
    "threadpoolctl": "gap, generate, train",
}
NEEDED = ("numpy", "onnxruntime")  # The libraries without which nothing works
ARGUMENTS = ()


def run(args: argparse.Namespace) -> int:
    """Print the findings; 1 where something does not work."""
    import platform

    from soilml import __version__
    from soilml.processes import usable_cores
    from soilml.report.aligned_text import format_table

    print(f"soilml {__version__}, Python {platform.python_version()}, {platform.platform()}")
    print(f"{usable_cores()} usable cores; {sys.executable}\n")
    rows = [(name, _version(name) or "-", use) for name, use in USES.items()]
    print(format_table(("library", "version", "needed for"), rows, text_columns=3))
    problems = list(_problems())
    print()
    for text in problems:
        print(f"! {text}")
    if not problems:
        print("released model files give their known answers; nothing is wrong")
    return 1 if problems else 0


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _problems() -> Iterator[str]:
    """What does not work: missing or too old libraries, model files that fail."""
    for name in NEEDED:
        if not _version(name):
            yield f"{name} is missing: pip install {name}"
    if not all(_version(name) for name in NEEDED):
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
