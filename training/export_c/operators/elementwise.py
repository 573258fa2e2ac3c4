"""Operators that compute every element by itself, as C expressions."""

from __future__ import annotations

import numpy as np

from soilml.errors import ModelFileError
from training.export_c.c_text import number
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import Shape, Size, Tensor, broadcast, kind_of

#: Functions of the C library by operator, for double; float has them with an f appended.
FUNCTIONS = {
    "Abs": "fabs", "Acos": "acos", "Acosh": "acosh", "Asin": "asin", "Asinh": "asinh",
    "Atan": "atan", "Atanh": "atanh", "Ceil": "ceil", "Cos": "cos", "Cosh": "cosh", "Erf": "erf",
    "Exp": "exp", "Floor": "floor", "Log": "log", "Round": "rint", "Sin": "sin", "Sinh": "sinh",
    "Sqrt": "sqrt", "Tan": "tan", "Tanh": "tanh",
}  # fmt: skip
#: C operators of two operands that keep their type, and of those that give a truth value.
ARITHMETIC = {"Add": "+", "Sub": "-", "Mul": "*", "Div": "/"}
TRUTH = {
    "Equal": "==", "Greater": ">", "GreaterOrEqual": ">=", "Less": "<", "LessOrEqual": "<=",
    "And": "&&", "Or": "||",
}  # fmt: skip
REAL = ("float", "double")  # Types whose comparison for equality is a kernel, which says how
PAIRS = {"Max": "larger", "Min": "smaller"}  # Kernels of two operands that keep their type


def translate_function(program: Program, node: Node) -> list[Tensor]:
    """A function of the C library; of many hyperbolic tangents in float, one of our own."""
    x = node.input(0)
    if x.kind not in REAL:
        if node.kind == "Abs":
            return _computed(program, x.kind, "{0} < 0 ? -{0} : {0}", [program.stored(x)])
        raise ModelFileError(f"operator {node.kind} of {x.kind} numbers is not known to export-c")
    if node.kind == "Tanh" and x.kind == "float":
        x = program.stored(x)
        out = program.new(x.kind, x.shape)
        kernel = program.shared.kernel("tanh_of", x.kind)
        code = f"    {kernel}({x.count.c}, {x.name}, {out.name});"
        program.emit(code, out, x, replaceable=[x])
        return [out]
    name = FUNCTIONS[node.kind] + ("f" if x.kind == "float" else "")
    return _computed(program, x.kind, f"{name}({{0}})", [x])


def translate_arithmetic(program: Program, node: Node) -> list[Tensor]:
    """Sum, difference, product, quotient; sizes of tensors stay sizes where they can."""
    a, b = node.input(0), node.input(1)
    if (a.sizes is not None or b.sizes is not None) and a.kind == "int":
        sizes = _combined_sizes(node.kind, a, b)
        if sizes is not None:
            return [Tensor("", "int", broadcast([a.shape, b.shape]), sizes=sizes)]
    return _computed(program, a.kind, f"{{0}} {ARITHMETIC[node.kind]} {{1}}", [a, b])


def translate_truth(program: Program, node: Node) -> list[Tensor]:
    """Comparisons and logical operators."""
    operands = [node.input(0), node.input(1)]
    text = f"{{0}} {TRUTH[node.kind]} {{1}}"
    if node.kind == "Equal" and operands[0].kind in REAL:
        text = f"{program.shared.kernel('equal', operands[0].kind)}({{0}}, {{1}})"
    return _computed(program, "bool", text, operands)


def translate_not(program: Program, node: Node) -> list[Tensor]:
    """Logical negation."""
    return _computed(program, "bool", "!{0}", [node.input(0)])


def translate_negative(program: Program, node: Node) -> list[Tensor]:
    """The negative."""
    return _computed(program, node.input(0).kind, "-{0}", [node.input(0)])


def translate_reciprocal(program: Program, node: Node) -> list[Tensor]:
    """One over the value."""
    one = "1.0f" if node.input(0).kind == "float" else "1.0"
    return _computed(program, node.input(0).kind, f"{one} / {{0}}", [node.input(0)])


def translate_activation(program: Program, node: Node) -> list[Tensor]:
    """Functions of networks that the C library lacks."""
    x = node.input(0)
    if node.kind == "Sigmoid":
        name = program.shared.kernel("sigmoid", x.kind)
        return _computed(program, x.kind, f"{name}({{0}})", [x])
    zero, larger = number(0.0, x.kind), program.shared.kernel("larger", x.kind)
    return _computed(program, x.kind, f"{larger}({{0}}, {zero})", [x])


def translate_power(program: Program, node: Node) -> list[Tensor]:
    """A power; squares are products."""
    x, exponent = node.input(0), node.input(1)
    if exponent.value is not None and np.array_equal(exponent.value.reshape(-1), [2.0]):
        x = program.stored(x)
        shape = broadcast([x.shape, exponent.shape])
        return [program.computed(x.kind, shape, "{0} * {1}", [x, x])]
    name = "powf" if x.kind == "float" else "pow"
    if x.kind not in REAL or exponent.kind != x.kind:
        raise ModelFileError(f"operator Pow of {x.kind} and {exponent.kind} is not known")
    return _computed(program, x.kind, f"{name}({{0}}, {{1}})", [x, exponent])


def translate_pairs(program: Program, node: Node) -> list[Tensor]:
    """The largest or smallest of several values."""
    first, *others = node.given()
    kernel = program.shared.kernel(PAIRS[node.kind], first.kind) if others else ""
    for other in others:
        (first,) = _computed(program, first.kind, f"{kernel}({{0}}, {{1}})", [first, other])
    return [first]


def translate_sum(program: Program, node: Node) -> list[Tensor]:
    """The sum of several values."""
    total, *others = node.given()
    for other in others:
        (total,) = _computed(program, total.kind, "{0} + {1}", [total, other])
    return [total]


def translate_clip(program: Program, node: Node) -> list[Tensor]:
    """The value limited to an interval, which may be open on either side; NaN stays NaN."""
    x, low, high = node.input(0), node.optional(1), node.optional(2)
    for bound, name in ((low, "at_least"), (high, "at_most")):
        if bound is not None:
            kernel = program.shared.kernel(name, x.kind)
            (x,) = _computed(program, x.kind, f"{kernel}({{0}}, {{1}})", [x, bound])
    return [x]


def translate_where(program: Program, node: Node) -> list[Tensor]:
    """One value or the other, by a condition."""
    condition, x, y = (node.input(k) for k in range(3))
    return _computed(program, x.kind, "{0} ? {1} : {2}", [condition, x, y])


def translate_cast(program: Program, node: Node) -> list[Tensor]:
    """The value as another element type."""
    x, kind = node.input(0), kind_of(int(node.attributes["to"]), node.kind)
    if kind == x.kind:
        return [x]
    if x.sizes is not None and kind != "bool":
        return [Tensor("", kind, x.shape, sizes=x.sizes)]
    text = "{0} != 0" if kind == "bool" else f"({kind}){{0}}"
    if kind == "bool" and x.kind in REAL:
        text = f"{program.shared.kernel('not_zero', x.kind)}({{0}})"
    return _computed(program, kind, text, [x])


def _computed(program: Program, kind: str, text: str, operands: list[Tensor]) -> list[Tensor]:
    shape: Shape = broadcast([operand.shape for operand in operands])
    return [program.computed(kind, shape, text, operands)]


def _combined_sizes(kind: str, a: Tensor, b: Tensor) -> tuple[Size, ...] | None:
    """Sizes after an operation on sizes; None where they are no linear form of counts."""
    left, right = (t.as_sizes("a size") for t in (a, b))
    left, right = left * max(len(right) // len(left), 1), right * max(len(left) // len(right), 1)
    pairs = zip(left, right, strict=True)
    try:
        if kind == "Add":
            return tuple(x + y for x, y in pairs)
        if kind == "Sub":
            return tuple(x + y * -1 for x, y in pairs)
        if kind == "Mul":
            return tuple(x * y for x, y in pairs)
        return tuple(x.over(y) for x, y in pairs)
    except ModelFileError:
        return None


OPERATORS: dict[str, Translation] = {
    **dict.fromkeys(FUNCTIONS, translate_function),
    **dict.fromkeys(ARITHMETIC, translate_arithmetic),
    **dict.fromkeys(TRUTH, translate_truth),
    **dict.fromkeys(PAIRS, translate_pairs),
    "Not": translate_not,
    "Neg": translate_negative,
    "Reciprocal": translate_reciprocal,
    "Relu": translate_activation,
    "Sigmoid": translate_activation,
    "Sum": translate_sum,
    "Pow": translate_power,
    "Clip": translate_clip,
    "Where": translate_where,
    "Cast": translate_cast,
}
