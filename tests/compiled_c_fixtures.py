"""Released files, exported and compiled once for all tests and workers."""

from __future__ import annotations

from pathlib import Path

import pytest
from compiled_c import COMPILERS, ROOT, CompiledModel, compile_library
from shared_files import shared_folder


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Folder with the C file and header of a released file, by its name."""
    from soilml.cli import main

    def export(name: str) -> Path:
        def fill(folder: Path) -> None:
            model, out = ROOT / "exported" / f"{name}.onnx", folder / f"{name}.c"
            assert main(["export", "c", str(model), str(out)]) == 0

        return shared_folder(tmp_path_factory, f"exported_{name}", fill)

    return export


@pytest.fixture(scope="session")
def library(exported, tmp_path_factory):
    """A released file as a shared library, by its name and, if need be, the compiler."""
    if not COMPILERS:
        pytest.skip("no C compiler")

    def shared_library(name: str, compiler: str = COMPILERS[0]) -> Path:
        source, file = exported(name) / f"{name}.c", f"lib{name}.so"

        def fill(folder: Path) -> None:
            compile_library(source, folder / file, compiler)

        return shared_folder(tmp_path_factory, f"library_{name}_{compiler}", fill) / file

    return shared_library


@pytest.fixture(scope="session")
def compiled(exported, library):
    """A released file as compiled C, by its name and, if need be, the compiler."""
    made: dict[tuple[str, str], CompiledModel] = {}

    def compiled_model(name: str, compiler: str = COMPILERS[0]) -> CompiledModel:
        if (name, compiler) not in made:
            header = exported(name) / f"{name}.h"
            made[name, compiler] = CompiledModel(header, library(name, compiler))
        return made[name, compiler]

    return compiled_model
