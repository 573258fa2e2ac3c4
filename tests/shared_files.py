"""Files that are made once for all workers of a test run."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock


def shared_folder(
    factory: pytest.TempPathFactory, name: str, fill: Callable[[Path], object]
) -> Path:
    """A folder that the first of all workers fills, and that the others read.

    It lies in `SOILML_TEST_FILES`, where that is set, and outlives the tests.
    """
    root = Path(os.environ.get("SOILML_TEST_FILES") or factory.getbasetemp())
    if "PYTEST_XDIST_WORKER" in os.environ and "SOILML_TEST_FILES" not in os.environ:
        root = root.parent
    folder = root / name
    with FileLock(root / f"{name}.lock"):
        if not folder.exists():
            part = root / f"{name}.part"
            part.mkdir()
            fill(part)
            part.rename(folder)
    return folder
