"""Mutants of a source file: one operator, comparison, number or truth value changed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

#: Each operator with its replacement.
OPERATORS = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}
#: Arguments that check what holds anyway, and change no result: no mutants of them.
CHECKS = ("strict", "frozen", "slots")


@dataclass(frozen=True)
class Mutant:
    """A change of bytes `begin` to `end` of a file, in the function that begins in line `scope`."""

    path: str
    begin: int
    end: int
    text: str
    scope: int

    def of(self, source: bytes) -> bytes:
        """The changed source."""
        return source[: self.begin] + self.text.encode() + source[self.end :]


def mutants(path: str, source: bytes) -> Iterator[Mutant]:
    """Every mutant of a file."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def span(node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        begin = starts[node.lineno - 1] + node.col_offset
        return begin, starts[node.end_lineno - 1] + node.end_col_offset

    def replaced(operator: ast.AST, left: ast.expr, right: ast.expr) -> Iterator[tuple[int, ...]]:
        old, new = OPERATORS.get(type(operator), ("", ""))
        begin = source.find(old.encode(), span(left)[1], span(right)[0]) if old else -1
        if begin >= 0:
            yield begin, begin + len(old), new

    def changes(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        if isinstance(node, ast.BinOp):
            yield from replaced(node.op, node.left, node.right)
        elif isinstance(node, ast.BoolOp):
            for left, right in zip(node.values, node.values[1:], strict=False):
                yield from replaced(node.op, left, right)
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
                yield from replaced(operator, left, right)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
            yield span(node)[0], span(node.operand)[0], ""
        elif isinstance(node, ast.Constant) and type(node.value) is bool:
            yield *span(node), str(not node.value)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            value = node.value + 1 if type(node.value) is int else 1.5 * node.value or 1.0
            yield *span(node), repr(value)

    def visit(node: ast.AST, scope: int) -> Iterator[Mutant]:
        if isinstance(node, ast.keyword) and node.arg in CHECKS:
            return
        for begin, end, text in changes(node):
            yield Mutant(path, begin, end, text, scope)
        inner = scope
        if isinstance(node, ast.FunctionDef):
            inner = min([node.lineno, *(part.lineno for part in node.decorator_list)])
        for name, field in ast.iter_fields(node):
            for child in field if isinstance(field, list) else [field]:
                if isinstance(child, ast.AST) and name not in ("annotation", "returns"):
                    yield from visit(child, inner if name == "body" else scope)

    yield from visit(ast.parse(source), 0)
