"""A node of a graph with its inputs translated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from soilml.errors import ModelFileError
from training.export_c.program import Program
from training.export_c.tensor import Tensor


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
