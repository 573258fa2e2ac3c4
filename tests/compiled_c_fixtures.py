"""Released files, exported and compiled once for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from compiled_c import COMPILERS, ROOT, CompiledModel, compile_library


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """Folder with the C file and header of a released file, by its name."""
    from soilml.cli import main

    folder = tmp_path_factory.mktemp("exported")

    def export(name: str) -> Path:
        if not (folder / f"{name}.c").exists():
            model, out = ROOT / "exported" / f"{name}.onnx", folder / f"{name}.c"
            assert main(["export-c", str(model), str(out)]) == 0
        return folder

    return export


@pytest.fixture(scope="session")
def compiled(exported):
    """A released file as compiled C, by its name and, if need be, the compiler."""
    if not COMPILERS:
        pytest.skip("no C compiler")
    made: dict[tuple[str, str], CompiledModel] = {}

    def compiled_model(name: str, compiler: str = COMPILERS[0]) -> CompiledModel:
        if (name, compiler) not in made:
            folder = exported(name)
            library = compile_library(
                folder / f"{name}.c", folder / f"{name}.{compiler}.so", compiler
            )
            made[name, compiler] = CompiledModel(folder / f"{name}.h", library)
        return made[name, compiler]

    return compiled_model
