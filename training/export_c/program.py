"""A C function under construction: statements, constants, kernels, and its working memory."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from training.export_c.c_text import element_loops, leaves_of, wrapped
from training.export_c.tensor import DTYPES, REAL, Shape, Tensor

LONGEST_EXPRESSION = 6  # Tensors that one expression reads at most; longer ones are hard to read
#: Members of the working memory by element type.
ARRAYS = {"double": "doubles", "float": "floats", "int": "ints", "bool": "bools"}

Constant = tuple[str, NDArray[Any], str]  # Name, elements and C type of a constant array


@dataclass
class SharedParts:
    """What the functions of one C file share: constant arrays, and kernels by element type."""

    constants: dict[str, Constant] = field(default_factory=dict)
    kernels: dict[tuple[str, str], None] = field(default_factory=dict)

    def constant(self, values: NDArray[Any], kind: str) -> str:
        """The name of the C array with these elements; equal arrays are one."""
        values = np.ascontiguousarray(values.astype(DTYPES[kind]))
        key = hashlib.sha256(kind.encode() + values.tobytes()).hexdigest()
        if key not in self.constants:
            self.constants[key] = (f"w{len(self.constants)}", values, kind)
        return self.constants[key][0]

    def kernel(self, name: str, kind: str) -> str:
        """The name of a kernel for an element type, which the file then defines."""
        self.kernels[name, kind] = None
        return f"{name}_{kind}"

    def used_in(self, text: str) -> list[Constant]:
        """The constant arrays that a text reads."""
        names = {*re.findall(r"\bw\d+\b", text)}
        return [parts for parts in self.constants.values() if parts[0] in names]


class Program:
    """The statements of one function."""

    def __init__(self, shared: SharedParts) -> None:
        self.shared = shared
        self.statements: list[tuple[str, str, set[str]]] = []  # comment, code, memory it touches
        self.memory: dict[str, tuple[str, int]] = {}  # C type and number of elements
        self._stored: dict[Tensor, Tensor] = {}
        self._comment = ""

    def begin(self, comment: str) -> None:
        """Say what the next statements compute."""
        self._comment = comment

    def new(self, kind: str, shape: Shape) -> Tensor:
        """A tensor in the working memory."""
        made = Tensor(f"t{len(self.memory)}", kind, shape)
        self.memory[made.name] = kind, max(made.count, 1)
        return made

    def emit(self, code: str, *tensors: Tensor) -> None:
        """Append a statement that reads or writes these tensors."""
        names = {t.home for t in tensors if t.home in self.memory}
        self.statements.append((self._comment, code, names))
        self._comment = ""

    def computed(self, kind: str, shape: Shape, text: str, operands: Iterable[Tensor]) -> Tensor:
        """A tensor whose elements follow from those of others, by a C expression."""
        parts = tuple(
            t if (t.text and t.shape == shape) or (t.value is not None and t.count == 1)
            else self.stored(t) for t in operands
        )  # fmt: skip
        found = Tensor("", kind, shape, text=text, operands=parts)
        if len(leaves_of(found)) > LONGEST_EXPRESSION:
            found = replace(found, operands=tuple(self.stored(t) if t.text else t for t in parts))
        return found

    def stored(self, tensor: Tensor) -> Tensor:
        """The tensor in memory: computed now where it is an expression, named where constant."""
        if tensor.value is not None:
            return replace(tensor, name=self.shared.constant(tensor.value, tensor.kind))
        if not tensor.text:
            return tensor
        if tensor not in self._stored:
            out = self._stored[tensor] = self.new(tensor.kind, tensor.shape)
            self.emit(element_loops(out, tensor), out, *leaves_of(tensor))
        return self._stored[tensor]

    def places(self, kept: Iterable[str]) -> tuple[dict[str, int], dict[str, int]]:
        """Offset of each tensor in the array of its type, and the length of each array.

        Every tensor lies as low as others in its time allow, at first the largest.

        kept: Names that are needed after the last statement.

        References: Pisarchyk and Lee, arXiv:2001.03288, 2020 (greedy by size).
        """
        lives: dict[str, list[int]] = {}
        for index, (_, _, names) in enumerate(self.statements):
            for name in names:
                lives.setdefault(name, [index, index])[1] = index
        for name in kept:
            lives.setdefault(name, [len(self.statements)] * 2)[1] = len(self.statements)
        offsets: dict[str, int] = {}
        lengths: dict[str, int] = {}
        for name in sorted(lives, key=lambda n: (-self.memory[n][1], lives[n][0], n)):
            kind, need = self.memory[name]
            start, (born, dead) = 0, lives[name]
            others = (
                (offsets[o], offsets[o] + self.memory[o][1])
                for o in offsets
                if self.memory[o][0] == kind and lives[o][0] <= dead and lives[o][1] >= born
            )
            for begin, end in sorted(others):
                if begin - start >= need:
                    break
                start = max(start, end)
            offsets[name] = start
            lengths[kind] = max(lengths.get(kind, 0), start + need)
        return offsets, lengths


@dataclass(frozen=True)
class Function:
    """A function of C that computes a graph: its text, and how it is called."""

    text: str
    call: str  # with variables that have the names of its parameters
    outputs: dict[str, tuple[str, Shape]]  # C type and shape of each
    lengths: dict[str, int]  # elements of working memory by type

    @staticmethod
    def of(
        name: str,
        program: Program,
        outputs: Mapping[str, tuple[Tensor, str]],
        parameters: Mapping[str, str],
        checked: bool = False,
    ) -> Function:
        """From statements, and where each output is to lie (a C pointer).

        parameters: Declarations by name, of which those that the text reads are declared.
        checked: Whether nothing is written unless all numbers are finite, which it then returns.
        """
        made = {key: program.stored(tensor) for key, (tensor, _) in outputs.items()}
        kept = [tensor.home for tensor in made.values() if tensor.home in program.memory]
        offsets, lengths = program.places(kept)
        body: list[str] = []
        born: set[str] = set()

        def declare(names: Iterable[str]) -> None:
            for own in sorted({*names} - born, key=lambda n: int(n[1:])):
                kind = program.memory[own][0]
                body.append(f"    {kind} *const {own} = work->{ARRAYS[kind]} + {offsets[own]};")
                born.add(own)

        for comment, code, names in program.statements:
            body += wrapped(f"/* {comment} */", 4) if comment else []
            declare(names)
            body.append(code)
        declare(kept)
        if checked:
            numbers = [tensor for tensor in made.values() if tensor.kind in REAL]
            every = [f"all_finite_{t.kind}({t.name}, {t.count})" for t in numbers]
            body += [*wrapped(f"if (!({' && '.join(every)}))", 4), "        return false;"]
            for tensor in numbers:
                program.shared.kernel("all_finite", tensor.kind)
        for key, (_, place) in outputs.items():
            tensor = made[key]
            size = f"{max(tensor.count, 1)} * sizeof({tensor.kind})"
            body += wrapped(f"memmove({place}, {tensor.name}, {size});", 4)
        body += ["    return true;"] if checked else []
        text = "\n".join(body)
        read = [own for own in parameters if re.search(rf"\b{own}\b", text)]
        declared = ", ".join(parameters[own] for own in read)
        head = wrapped(f"static {'bool' if checked else 'void'} {name}({declared})", 0)
        shapes = {key: (tensor.kind, tensor.shape) for key, tensor in made.items()}
        whole = "\n".join([*head, "{", text, "}"])
        return Function(whole, f"{name}({', '.join(read)})", shapes, lengths)


@dataclass(frozen=True)
class Node:
    """A node under translation: its operator, inputs and attributes."""

    kind: str
    inputs: tuple[Tensor | None, ...]
    attributes: Mapping[str, Any]
    outputs: int

    def input(self, index: int) -> Tensor:
        """An input that must be there."""
        tensor = self.optional(index)
        if tensor is None:
            raise ModelFileError(f"operator {self.kind} lacks its input {index}")
        return tensor

    def optional(self, index: int) -> Tensor | None:
        """An input, or None where it was left out."""
        return self.inputs[index] if index < len(self.inputs) else None

    def given(self) -> list[Tensor]:
        """All inputs that are there."""
        return [tensor for tensor in self.inputs if tensor is not None]

    def axis(self, rank: int, default: int = 0) -> int:
        """The attribute `axis`, counted from the first axis."""
        return int(self.attributes.get("axis", default)) % max(rank, 1)

    def numbers(self, index: int, attribute: str) -> list[int] | None:
        """Whole numbers that are an input of newer operators and an attribute of older ones."""
        tensor = self.optional(index)
        if tensor is not None:
            return tensor.numbers(f"input {index} of operator {self.kind}")
        listed = self.attributes.get(attribute)
        return None if listed is None else [int(x) for x in listed]


#: Translation of an operator: appends statements to a program and returns the node's outputs.
Translation = Callable[[Program, Node], list[Tensor]]
