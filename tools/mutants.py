"""Mutants of a source file by the operators of mutmut.

An operator, comparison, number or truth value is changed, a value that is assigned or given as an
argument becomes None, an argument, an augmented assignment or a case is left out, a condition is
held. Texts are left as they are.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import libcst as cst
import libcst.matchers as matchers
from mutmut.mutation.file_mutation import Mutation, create_mutations

#: Arguments that check what holds anyway, and change no result: no mutants of them.
CHECKS = ("strict", "frozen", "slots")


@dataclass(frozen=True)
class Mutant:
    """A changed source, the first line that differs, and what kind of node was changed.

    `scope` is the first line of the function that holds it, 0 outside of functions.
    """

    path: str
    source: str
    line: int
    scope: int
    kind: str


class MutantsOfFile:
    """All mutants of a file; each is written when it is asked for."""

    def __init__(self, path: str, source: str):
        self.path, self.source = path, source
        self.module, found, *_ = create_mutations(path, source)
        checks = _values_of_checks(self.module)
        self.mutations = [one for one in found if not _is_left_out(one, checks)]

    def __len__(self) -> int:
        """Number of mutants."""
        return len(self.mutations)

    def __getitem__(self, number: int) -> Mutant:
        """The mutant of a number from 0."""
        mutation = self.mutations[number]
        node = self.module.deep_replace(mutation.original_node, mutation.mutated_node)
        assert isinstance(node, cst.Module)
        old, new = self.source.splitlines(), node.code.splitlines()
        pairs = zip(old, new, strict=False)
        same = next((i for i, (a, b) in enumerate(pairs) if a != b), min(len(old), len(new)))
        kind = type(mutation.original_node).__name__
        return Mutant(self.path, node.code, same + 1, self._scope(same + 1), kind)

    def _scope(self, line: int) -> int:
        """First line of the innermost function that holds a line, with its decorators."""
        held = [begin for begin, end in self._functions if begin <= line <= end]
        return max(held, default=0)

    @cached_property
    def _functions(self) -> list[tuple[int, int]]:
        """First and last line of every function."""
        return [
            (min([node.lineno, *(d.lineno for d in node.decorator_list)]), node.end_lineno or 0)
            for node in ast.walk(ast.parse(self.source))
            if isinstance(node, ast.FunctionDef)
        ]


def _values_of_checks(module: cst.Module) -> list[cst.CSTNode]:
    """The values of arguments that only check."""
    arguments = matchers.Arg(keyword=matchers.OneOf(*map(matchers.Name, CHECKS)))
    found = matchers.findall(module, arguments)
    return [one.value for one in found if isinstance(one, cst.Arg)]


def _is_left_out(mutation: Mutation, checks: Sequence[cst.CSTNode]) -> bool:
    """Whether a mutation changes a text, or an argument that only checks."""
    old, new = mutation.original_node, mutation.mutated_node
    if isinstance(old, cst.BaseString) or any(old is value for value in checks):
        return True
    if not (isinstance(old, cst.Call) and isinstance(new, cst.Call)):
        return False
    return any(
        arg.keyword is not None and arg.keyword.value in CHECKS
        for arg in old.args
        if not any(arg is kept for kept in new.args)
    )
