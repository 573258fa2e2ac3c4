"""Exported C files compiled to shared libraries and called from Python."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
#: Warnings that an exported file must not cause.
WARNINGS = [
    *("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"),
    *("-Wconversion", "-Wfloat-equal", "-Wshadow"),
]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
PLAIN = (int, ctypes.Array, ctypes.c_float)  # Arguments that are not passed by reference
TYPES = {
    "float": ctypes.c_float,
    "double": ctypes.c_double,
    "int": ctypes.c_int,
    "unsigned int": ctypes.c_uint,
    "bool": ctypes.c_bool,
    "pointer": ctypes.c_void_p,
}


def compile_library(source: Path, out: Path, compiler: str, *flags: str) -> Path:
    """Compile one C file to a shared library, without any warning."""
    command = [compiler, *WARNINGS, "-O1", "-shared", "-fPIC", *flags, source, "-o", out, "-lm"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:4000]
    assert done.stderr == ""
    return out


class CompiledModel:
    """The functions of an exported file, and its structs as the header declares them."""

    def __init__(self, header: Path, library: Path) -> None:
        self.name = header.stem
        text = header.read_text()
        numbers = re.findall(r"#define (\w+) (\d+)", text)
        self.numbers = {name: int(number) for name, number in numbers}
        codes = re.findall(rf"{self.name.upper()}_(\w+) = (-?\d+)", text)
        self.codes = {name: int(number) for name, number in codes}
        self.structs = {}
        for body, name in re.findall(r"typedef struct \w*\s*\{(.*?)\} (\w+);", text, re.DOTALL):
            form = r"^    ([a-z0-9_ ]+?) (\*?\w+)((?:\[\w+\])*);"
            fields = re.findall(form, body, re.MULTILINE)
            members = [
                (field.lstrip("*"), self._type("pointer" if "*" in field else kind, sizes))
                for kind, field, sizes in fields
            ]
            self.structs[name] = type(name, (ctypes.Structure,), {"_fields_": members})
        self.library = ctypes.CDLL(str(library))
        for function, struct in (("empty_row", "row"), ("usual_context", "context")):
            made, whole = self.structs.get(f"{self.name}_{struct}"), f"{self.name}_{function}"
            if made and hasattr(self.library, whole):
                getattr(self.library, whole).restype = made
        if f"{self.name}_work" in self.structs:
            self.work = self.new("work")

    def _type(self, kind, sizes):
        found = TYPES.get(kind) or self.structs[kind]
        for size in reversed(re.findall(r"\[(\w+)\]", sizes)):
            found = found * (self.numbers[size] if size in self.numbers else int(size))
        return found

    def new(self, struct, **values):
        """A struct of this model, with fields set."""
        if struct == "context":  # what is not given has its usual value
            made = getattr(self.library, f"{self.name}_usual_context")()
        else:
            made = self.structs[f"{self.name}_{struct}"]()
        for name, value in values.items():
            setattr(made, name, value)
        return made

    def row(self, **readings):
        """A row with these readings; nothing else is measured."""
        made = getattr(self.library, f"{self.name}_empty_row")()
        for name, value in readings.items():
            setattr(made, name, value)
        return made

    def rows(self, **readings):
        """Rows with these readings, each an array."""
        count = len(next(iter(readings.values())))
        rows = [self.row(**{k: v[i] for k, v in readings.items()}) for i in range(count)]
        return (self.structs[f"{self.name}_row"] * count)(*rows)

    def call(self, function, *arguments):
        """The code that a function returns; structs and arrays are passed by reference."""
        passed = [a if a is None or isinstance(a, PLAIN) else ctypes.byref(a) for a in arguments]
        return getattr(self.library, f"{self.name}_{function}")(*passed)

    def single(self, row):
        """Code and estimate of one row."""
        estimate = self.new("estimate")
        return self.call("single", row, estimate, self.work), as_arrays(estimate)

    def start(self, **context):
        """A memory without rows."""
        memory, given = self.new("memory"), []
        if f"{self.name}_context" in self.structs:
            given = [self.new("context", **context) if context else None]
        assert self.call("set_start", memory, *given) == 0
        return memory

    def step(self, memory, rows):
        """Code, and which rows are in range."""
        inside = (ctypes.c_bool * max(len(rows), 1))()
        code = self.call("set_step", memory, rows, len(rows), inside, None, self.work)
        return code, list(inside)

    def update(self, memory, rows):
        """Code and estimate of a step and its answer in one."""
        estimate = self.new("set_estimate")
        code = self.call("set_step", memory, rows, len(rows), None, estimate, self.work)
        return code, as_arrays(estimate)

    def answer(self, memory):
        """Code and estimate of a set."""
        estimate = self.new("set_estimate")
        return self.call("set_answer", memory, estimate, self.work), as_arrays(estimate)


def as_arrays(struct):
    """Fields of a struct as numbers and arrays."""
    values = {name: getattr(struct, name) for name, _ in struct._fields_}
    return {
        name: np.array(value[:]) if isinstance(value, ctypes.Array) else value
        for name, value in values.items()
    }
