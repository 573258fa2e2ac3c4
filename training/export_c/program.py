"""A C function under construction: statements, constants, kernels, and its working memory."""

from __future__ import annotations

import hashlib
from bisect import insort
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.errors import ModelFileError
from training.export_c.c_text import copied_rows, element_loops, leaves_of, offset
from training.export_c.tensor import Expression, Shape, Size, Tensor, kind_of_array, total

LONGEST_EXPRESSION = 6  # Tensors that one expression reads at most; longer ones are hard to read


@dataclass(frozen=True)
class Statement:
    """C text, what it is for, and the names of the working memory that it touches."""

    code: str
    comment: str
    names: tuple[str, ...]
    #: names whose elements are read before those of the first name are written, one by one
    replaceable: tuple[str, ...] = ()
    stage: int = 0  # number of the stage of points that it belongs to; 0 for none


Constant = tuple[str, NDArray[Any], str]  # Name, elements and C type of a constant array


@dataclass
class SharedParts:
    """What the functions of one C file share: constant arrays, and kernels by element type."""

    constants: dict[str, Constant] = field(default_factory=dict)
    kernels: dict[tuple[str, str], None] = field(default_factory=dict)
    unpacking: dict[str, None] = field(default_factory=dict)  # functions that unpack a memory

    def constant(self, values: NDArray[Any]) -> str:
        """The name of the C array with these elements; equal arrays are one."""
        kind = kind_of_array(values, "of the graph")
        key = hashlib.sha256(kind.encode() + values.tobytes()).hexdigest()
        if key not in self.constants:
            self.constants[key] = (f"w{len(self.constants)}", values, kind)
        return self.constants[key][0]

    def kernel(self, name: str, kind: str) -> str:
        """The name of a kernel for an element type, which the file then defines."""
        self.kernels[name, kind] = None
        return f"{name}_{kind}"


class Program:
    """One function of the C file.

    shared: Constants and kernels of the file.
    bounds: Largest value of each count that sizes depend on.
    tile: Points that a stage takes at a time.
    """

    def __init__(self, shared: SharedParts, bounds: dict[str, int], tile: int = 1) -> None:
        self.shared = shared
        self.tile = tile
        self.bounds = dict(bounds)
        self.statements: list[Statement] = []
        self.memory: dict[str, tuple[str, Shape]] = {}
        self.given: set[str] = set()
        self.stages: dict[int, int] = {}  # points of each stage, by its number
        self._stage = 0
        self._stored: dict[Tensor, Tensor] = {}
        self._comment = ""

    def begin(self, comment: str) -> None:
        """Say what the next statements compute."""
        self._comment = comment

    def new(self, kind: str, shape: Shape) -> Tensor:
        """A tensor in the working memory."""
        name = f"t{len(self.memory)}"
        self.memory[name] = (kind, shape)
        return Tensor(name, kind, shape)

    def count(self, most: Size) -> str:
        """A new count, which statements must set; it is at most this size."""
        return self.count_up_to(most.most(self.bounds))

    def count_up_to(self, most: int) -> str:
        """A new count, which statements must set; it is at most this number."""
        name = f"n{len(self.bounds)}"
        self.bounds[name] = most
        return name

    def emit(self, code: str, *tensors: Tensor, replaceable: Iterable[Tensor] = ()) -> None:
        """Append a statement that reads or writes these tensors.

        The first tensor may take the place of a replaceable one that is not needed afterwards.
        """
        self.given |= {t.owner for t in tensors if t.value is None and t.owner not in self.memory}
        names = tuple(dict.fromkeys(t.owner for t in tensors if t.owner in self.memory))
        places = tuple(t.owner for t in replaceable if t.owner in self.memory and not t.block_of)
        self.statements.append(Statement(code, self._comment, names, places, self._stage))
        self._comment = ""

    @contextmanager
    def stage(self, points: int) -> Iterator[None]:
        """Statements within are those of some points at a time, those from `first` on."""
        self._stage = len(self.stages) + 1
        self.stages[self._stage] = points
        yield
        self._stage = 0

    def tile_of(self, whole: Tensor, points: int) -> Tensor:
        """The elements of some points, of those of all points along the last axis.

        Constants lie in memory tile by tile, so that those of a tile need no copy.
        """
        if whole.value is not None:
            tiles = whole.value.reshape(total(whole.shape[:-1]).constant, -1, points)
            name = self.shared.constant(np.ascontiguousarray(tiles.swapaxes(0, 1)))
            place = offset([Size(tiles.shape[0])], ["first"])
            return Tensor(f"({name} + {place})", whole.kind, (*whole.shape[:-1], Size(points)))
        whole = self.stored(whole)
        part = self.new(whole.kind, (*whole.shape[:-1], Size(points)))
        self.emit(_copied_points(part, whole, into_whole=False), part, whole)
        return part

    def whole_of(self, part: Tensor, points: int) -> Tensor:
        """A tensor of all points, in which the elements of some are written."""
        part = self.stored(part)
        whole = self.new(part.kind, (*part.shape[:-1], Size(points)))
        self.emit(_copied_points(part, whole, into_whole=True), whole, part)
        return whole

    def computed(self, kind: str, shape: Shape, text: str, operands: Iterable[Tensor]) -> Tensor:
        """A tensor whose elements follow from those of others, by a C expression."""
        parts = tuple(self._operand(operand, shape) for operand in operands)
        while len(leaves_of(Expression(text, parts))) > LONGEST_EXPRESSION:
            index = next((i for i, part in enumerate(parts) if part.expression is not None), None)
            if index is None:
                break
            parts = (*parts[:index], self.stored(parts[index]), *parts[index + 1 :])
        return Tensor("", kind, shape, expression=Expression(text, parts))

    def stored(self, tensor: Tensor) -> Tensor:
        """The tensor in memory: computed now where it is an expression, named where constant."""
        if tensor.value is not None:
            return replace(tensor, name=self.shared.constant(tensor.value))
        if tensor.sizes is not None:
            return self._stored_sizes(tensor, tensor.sizes)
        if tensor.source is not None:
            return self.stored(tensor.source).seen_as(tensor.shape)
        if tensor.expression is None:
            return tensor
        if tensor not in self._stored:
            out = self.new(tensor.kind, tensor.shape)
            code = element_loops(out.name, tensor.shape, tensor.expression)
            leaves = leaves_of(tensor.expression)
            same = [leaf for leaf in leaves if leaf.shape == tensor.shape]
            self.emit(code, out, *leaves, replaceable=same)
            self._stored[tensor] = out
        return self._stored[tensor]

    def _operand(self, operand: Tensor, shape: Shape) -> Tensor:
        """An operand of an expression of this shape."""
        if operand.expression is not None and operand not in self._stored:
            return operand if operand.shape == shape else self.stored(operand)
        if operand.value is not None and operand.value.size == 1:
            return operand
        return self.stored(operand)

    def _stored_sizes(self, tensor: Tensor, sizes: tuple[Size, ...]) -> Tensor:
        if all(size.fixed for size in sizes):
            dtype = {"int": np.int32, "float": np.float32, "double": np.float64}[tensor.kind]
            values = np.asarray([size.constant for size in sizes], dtype)
            return self.stored(Tensor.constant(values.reshape(len(sizes)), ""))
        out = self.new(tensor.kind, tensor.shape)
        cast = "" if tensor.kind == "int" else f"({tensor.kind})"
        lines = [f"    {out.name}[{i}] = {cast}{size.c};" for i, size in enumerate(sizes)]
        self.emit("\n".join(lines), out)
        return out


def _copied_points(part: Tensor, whole: Tensor, into_whole: bool) -> str:
    """C text that copies the points of a tile out of a tensor, or into it."""
    sizes = (total(part.shape[:-1]), part.shape[-1])
    of_part, of_whole = ("0", sizes[1]), ("first", whole.shape[-1])
    if into_whole:
        return copied_rows(whole, of_whole, part, of_part, sizes)
    return copied_rows(part, of_part, whole, of_whole, sizes)


@dataclass(frozen=True)
class Node:
    """One node: operator, inputs (None where an optional one is left out), attributes, outputs."""

    kind: str
    inputs: tuple[Tensor | None, ...]
    attributes: dict[str, Any] = field(default_factory=dict)
    outputs: int = 1

    def input(self, index: int) -> Tensor:
        """An input that must be there."""
        tensor = self.optional(index)
        if tensor is None:
            raise ModelFileError(f"operator {self.kind} lacks its input {index}")
        return tensor

    def optional(self, index: int) -> Tensor | None:
        """An input that may be left out."""
        return self.inputs[index] if index < len(self.inputs) else None

    def given(self) -> list[Tensor]:
        """The inputs that are there."""
        return [tensor for tensor in self.inputs if tensor is not None]

    def axis(self, rank: int, default: int = 0) -> int:
        """The attribute `axis`, counted from the first one."""
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


#: Elements to a multiple of which places of large tensors are rounded: a cache line of 64 bytes has
#: 16 floats.
GRAIN = 16
TRIES = 40  # Orders in which tensors are placed, at most


@dataclass(frozen=True)
class MemoryPlan:
    """Offset of each tensor in the array of its type, and the length of each array."""

    offsets: dict[str, int]
    lengths: dict[str, int]


def plan_memory(program: Program, kept: frozenset[str]) -> MemoryPlan:
    """Place every tensor of a program, as low as others in its time allow, at first the largest.

    program: Statements with the tensors that they touch.
    kept: Names that are needed after the last statement.

    References: Pisarchyk and Lee, arXiv:2001.03288, 2020 (greedy by size).
    """
    first: dict[str, int] = {}
    last: dict[str, int] = {}
    for index, statement in enumerate(program.statements):
        for name in statement.names:
            first.setdefault(name, index)
            last[name] = len(program.statements) if name in kept else index
    for begin, end in _spans(program):  # what a stage shares with others lives during all of it
        within = {n for s in program.statements[begin : end + 1] for n in s.names}
        for name in within:
            if first[name] < begin or last[name] > end:
                first[name], last[name] = min(first[name], begin), max(last[name], end)
    needs = {name: _elements(program, name) for name in first}
    taken: dict[str, str] = {}  # whose place a tensor takes
    for index, statement in enumerate(program.statements):
        for other in statement.replaceable:
            name, place = statement.names[0], taken.get(other, other)
            fits = (program.memory[name][0], needs[name]) == (
                program.memory[place][0],
                needs[place],
            )
            if fits and name not in taken and first[name] == last[place] == index:
                taken[name], last[place] = place, last[name]
    own = {name: program.memory[name][0] for name in first if name not in taken}
    offsets: dict[str, int] = {}
    lengths: dict[str, int] = {}
    for kind in dict.fromkeys(own.values()):
        lives = {n: (first[n], last[n], needs[n]) for n in first if own.get(n) == kind}
        placed, lengths[kind] = _places(lives)
        offsets |= placed
    offsets |= {name: offsets[place] for name, place in taken.items()}
    return MemoryPlan(offsets, lengths)


def _places(lives: Mapping[str, tuple[int, int, int]]) -> tuple[dict[str, int], int]:
    """Offsets of tensors in one array, and its length, from first and last statement and size.

    The one that ends last in the array is placed earlier, and so on, while there is hope.
    """
    least = _most_at_once(lives)
    order = sorted(lives, key=lambda name: (-lives[name][2], lives[name][0]))
    best, length = _placed_in_turn(order, lives)
    found = best
    for _ in range(TRIES):
        if length == least:
            break
        ends = {name: found[name] + lives[name][2] for name in order}
        worst = max(order, key=ends.__getitem__)
        order.remove(worst)
        order.insert(0, worst)
        found, own = _placed_in_turn(order, lives)
        if own < length:
            best, length = found, own
    return best, length


def _most_at_once(lives: Mapping[str, tuple[int, int, int]]) -> int:
    """Elements of the tensors that live at the same time, at most."""
    changes: Counter[int] = Counter()
    for born, dead, size in lives.values():
        changes[born] += size
        changes[dead + 1] -= size
    return max(accumulate(changes[at] for at in sorted(changes)))


def _placed_in_turn(
    order: Sequence[str], lives: Mapping[str, tuple[int, int, int]]
) -> tuple[dict[str, int], int]:
    """Offsets of tensors that are placed one by one, as low as those before allow, and the end."""
    offsets: dict[str, int] = {}
    placed: list[tuple[int, int, int, int]] = []  # offset, end, first and last statement
    for name in order:
        born, dead, need = lives[name]
        start = 0
        for begin, end, first, last in placed:
            if first <= dead and last >= born:
                if begin - start >= need:
                    break
                start = max(start, end)
        offsets[name] = start
        insort(placed, (start, start + need, born, dead))
    return offsets, max(offsets[name] + lives[name][2] for name in order)


def _spans(program: Program) -> list[tuple[int, int]]:
    """First and last statement of each stage of points."""
    places: dict[int, list[int]] = {}
    for index, statement in enumerate(program.statements):
        if statement.stage:
            places.setdefault(statement.stage, []).append(index)
    return [(found[0], found[-1]) for found in places.values()]


def _elements(program: Program, name: str) -> int:
    """Elements that a tensor needs, rounded up if it is large."""
    need = max(total(program.memory[name][1]).most(program.bounds), 1)
    return need if need < GRAIN else -(-need // GRAIN) * GRAIN
