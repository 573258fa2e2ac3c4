"""Modules that need libraries which are not installed on board, or not in every Python."""

from __future__ import annotations

import importlib
import sys

from soilml.errors import MissingLibraryError

if sys.version_info >= (3, 11):  # noqa: UP036
    import tomllib
else:
    import tomli as tomllib

__all__ = ["need", "tomllib"]


def need(module: str, command: str, extra: str = "ground") -> None:
    """Import a module; raises `MissingLibraryError`, naming the extra, for a missing library."""
    try:
        importlib.import_module(module)
    except MissingLibraryError:
        raise
    except ImportError as error:
        raise MissingLibraryError(
            f"`soilml {command}` needs {error.name or 'a library'}, which is not installed: "
            f"pip install 'soilml[{extra}]'"
        ) from None
