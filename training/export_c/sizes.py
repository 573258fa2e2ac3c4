"""Sizes of tensors that are known when the board runs: linear in a few named counts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import prod

from soilml.errors import ModelFileError


@dataclass(frozen=True)
class Size:
    """A whole number, or a linear form of counts such as ``3 * rows + kept``.

    Parameters
    ----------
    constant : int
        The part that is always there.
    parts : tuple of (str, int)
        Counts with their factors, sorted by name; no factor is zero.

    Examples
    --------
    >>> rows = Size.of("rows")
    >>> (rows * 3 + 2).c
    '(3 * rows + 2)'
    >>> (rows * 6).over(Size(3)).c
    '(2 * rows)'
    >>> (rows * 3 + 2).most({"rows": 32})
    98
    """

    constant: int
    parts: tuple[tuple[str, int], ...] = ()

    @staticmethod
    def of(count: str) -> Size:
        """The size that is one count."""
        return Size(0, ((count, 1),))

    @property
    def fixed(self) -> bool:
        """Whether no count takes part."""
        return not self.parts

    def __add__(self, other: Size | int) -> Size:
        other = Size(other) if isinstance(other, int) else other
        total = dict(self.parts)
        for name, factor in other.parts:
            total[name] = total.get(name, 0) + factor
        kept = tuple(sorted((name, factor) for name, factor in total.items() if factor))
        return Size(self.constant + other.constant, kept)

    def __mul__(self, other: Size | int) -> Size:
        other = Size(other) if isinstance(other, int) else other
        if not self.fixed and not other.fixed:
            raise ModelFileError(
                f"the graph has a tensor of two variable dimensions, {self.c} and {other.c}; "
                "export-c needs graphs with one"
            )
        form, factor = (self, other.constant) if other.fixed else (other, self.constant)
        parts = tuple((name, own * factor) for name, own in form.parts if factor)
        return Size(form.constant * factor, parts)

    def over(self, other: Size) -> Size:
        """The exact quotient; raises `ModelFileError` where there is none."""
        if other.fixed and other.constant:
            numbers = (self.constant, *(factor for _, factor in self.parts))
            if all(number % other.constant == 0 for number in numbers):
                parts = tuple((name, factor // other.constant) for name, factor in self.parts)
                return Size(self.constant // other.constant, parts)
        if self == other:
            return Size(1)
        raise ModelFileError(f"a tensor of {self.c} numbers cannot be reshaped by {other.c}")

    def most(self, bounds: Mapping[str, int]) -> int:
        """The largest value, from the largest value of each count."""
        return self.constant + sum(factor * bounds[name] for name, factor in self.parts)

    @property
    def c(self) -> str:
        """The size as a C expression."""
        terms = [name if factor == 1 else f"{factor} * {name}" for name, factor in self.parts]
        terms += [str(self.constant)] if self.constant or not terms else []
        text = " + ".join(terms)
        return f"({text})" if len(terms) > 1 or "*" in text else text


Shape = tuple[Size, ...]


def shape_of(numbers: Iterable[int]) -> Shape:
    """A shape whose sizes are all fixed."""
    return tuple(Size(int(number)) for number in numbers)


def total(shape: Shape) -> Size:
    """The number of elements of a tensor."""
    fixed = Size(prod(size.constant for size in shape if size.fixed))
    for size in shape:
        fixed = fixed if size.fixed else fixed * size
    return fixed


def broadcast(shapes: Iterable[Shape]) -> Shape:
    """The shape that these shapes have together; raises `ModelFileError` where there is none."""
    many = list(shapes)
    length = max(len(shape) for shape in many)
    padded = [(Size(1),) * (length - len(shape)) + shape for shape in many]
    result = []
    for sizes in zip(*padded, strict=True):
        others = {size for size in sizes if size != Size(1)}
        if len(others) > 1:
            named = " and ".join(sorted(size.c for size in others))
            raise ModelFileError(f"sizes {named} of an operator's inputs do not fit together")
        result.append(others.pop() if others else Size(1))
    return tuple(result)


def strides(shape: Shape) -> list[Size]:
    """Distance in memory between neighbours along each axis."""
    steps = [Size(1)] * len(shape)
    for axis in range(len(shape) - 2, -1, -1):
        steps[axis] = steps[axis + 1] * shape[axis + 1]
    return steps
