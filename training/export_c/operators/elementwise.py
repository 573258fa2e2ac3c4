"""Operators that compute every element by itself, as C expressions."""

from __future__ import annotations

from soilml.errors import ModelFileError
from training.export_c.program import Node, Program, Translation
from training.export_c.tensor import REAL, Tensor, broadcast, kind_of

#: Functions of the C library by operator, for double; float has them with an f appended.
FUNCTIONS = {
    "Abs": "fabs", "Asinh": "asinh", "Cos": "cos", "Exp": "exp", "Floor": "floor", "Log": "log",
    "Sin": "sin", "Sqrt": "sqrt", "Tanh": "tanh",
}  # fmt: skip
#: C expressions of the operands, or kernels; of `REPEATED` operators several operands in turn.
KEEPING = {
    "Add": "{0} + {1}", "Sub": "{0} - {1}", "Mul": "{0} * {1}", "Div": "{0} / {1}", "Neg": "-{0}",
    "Max": "larger", "Min": "smaller", "Sum": "{0} + {1}", "Where": "{0} ? {1} : {2}",
}  # fmt: skip
REPEATED = ("Max", "Min", "Sum")
TRUTH = {
    "Greater": "{0} > {1}", "GreaterOrEqual": "{0} >= {1}", "Less": "{0} < {1}",
    "LessOrEqual": "{0} <= {1}", "And": "{0} && {1}", "Or": "{0} || {1}", "Not": "!{0}",
}  # fmt: skip


def _computed(program: Program, kind: str, text: str, operands: list[Tensor]) -> list[Tensor]:
    if text.isidentifier():
        name = program.shared.kernel(text, operands[0].kind)
        text = f"{name}({', '.join(f'{{{k}}}' for k in range(len(operands)))})"
    shape = broadcast([operand.shape for operand in operands])
    return [program.computed(kind, shape, text, operands)]


def translate_function(program: Program, node: Node) -> list[Tensor]:
    """A function of the C library; of many hyperbolic tangents in float, one of our own."""
    x = node.input(0)
    if x.kind not in REAL:
        raise ModelFileError(f"operator {node.kind} of {x.kind} numbers is not known to export c")
    if node.kind == "Tanh" and x.kind == "float":
        x = program.stored(x)
        out = program.new(x.kind, x.shape)
        kernel = program.shared.kernel("tanh_of", x.kind)
        program.emit(f"    {kernel}({x.count}, {x.name}, {out.name});", out, x)
        return [out]
    name = FUNCTIONS[node.kind] + ("f" if x.kind == "float" else "")
    return _computed(program, x.kind, f"{name}({{0}})", [x])


def translate_expression(program: Program, node: Node) -> list[Tensor]:
    """An expression of one, two or three operands, or of several in turn."""
    given = node.given()
    if node.kind in TRUTH:
        return _computed(program, "bool", TRUTH[node.kind], given)
    text = KEEPING[node.kind]
    if node.kind not in REPEATED:
        return _computed(program, given[-1].kind, text, given)
    first, *others = given
    for other in others:
        (first,) = _computed(program, first.kind, text, [first, other])
    return [first]


def translate_clip(program: Program, node: Node) -> list[Tensor]:
    """The value limited to an interval, which may be open on either side; NaN stays NaN."""
    x = node.input(0)
    for bound, name in ((node.optional(1), "at_least"), (node.optional(2), "at_most")):
        if bound is not None:
            (x,) = _computed(program, x.kind, name, [x, bound])
    return [x]


def translate_cast(program: Program, node: Node) -> list[Tensor]:
    """The value as another element type."""
    x, kind = node.input(0), kind_of(int(node.attributes["to"]), node.kind)
    if kind == x.kind:
        return [x]
    if kind == "bool":
        return _computed(program, kind, "not_zero" if x.kind in REAL else "{0} != 0", [x])
    return _computed(program, kind, f"({kind}){{0}}", [x])


OPERATORS: dict[str, Translation] = {
    **dict.fromkeys(FUNCTIONS, translate_function),
    **dict.fromkeys((*KEEPING, *TRUTH), translate_expression),
    "Clip": translate_clip,
    "Cast": translate_cast,
}
