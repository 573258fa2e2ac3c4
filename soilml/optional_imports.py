"""Modules that need libraries which are not installed on board, or not in every Python."""

from __future__ import annotations

import importlib
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from soilml.errors import InputError, MissingLibraryError

if sys.version_info >= (3, 11):  # noqa: UP036
    import tomllib
else:
    import tomli as tomllib

__all__ = ["load_matplotlib", "need", "quiet_matplotlib", "tomllib"]


def need(module: str, command: str, extra: str = "ground", *, what: str = "") -> None:
    """Import a module; raises `MissingLibraryError`, naming the extra, for a missing library.

    command: Of soilml, for the message; "" where `what` says what needs the module.
    """
    try:
        if module == "matplotlib":
            load_matplotlib()
        importlib.import_module(module)
    except MissingLibraryError:
        raise
    except ImportError as error:
        raise MissingLibraryError(
            f"{what or f'`soilml {command}`'} needs {error.name or 'a library'}, which is not "
            f"installed: "
            f"pip install '.[{extra}]'"
        ) from None


def load_matplotlib() -> None:
    """Import matplotlib, unless it is there already, whatever the user's settings of it are.

    Figures of soilml need no backend, so that a wrong one in MPLBACKEND does not matter; a right
    one holds for what the user draws later. Raises `InputError` where matplotlib fails.
    """
    if "matplotlib" in sys.modules:
        return
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        with quiet_matplotlib():
            matplotlib = importlib.import_module("matplotlib")
            importlib.import_module("matplotlib.figure")  # finds the fonts
        if backend:
            with suppress(ValueError):  # there is no such backend
                matplotlib.rcParams["backend"] = backend
    except ImportError:
        raise
    except Exception as error:  # of a settings file, or without a folder that can be written
        raise InputError(
            f"matplotlib, which draws pictures, cannot be loaded: {error}; look for a file "
            "matplotlibrc, and at MPLCONFIGDIR"
        ) from None
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend


@contextmanager
def quiet_matplotlib() -> Iterator[None]:
    """No messages of matplotlib on the terminal: of its settings, its folders and its fonts."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            yield
    finally:
        logger.setLevel(level)
