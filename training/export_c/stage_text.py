"""Functions of C that each compute a part of a graph."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from training.export_c.program import MemoryPlan, Program, Statement

WIDTH = 100  # Width of lines of C
LONGEST = 90  # Lines of one function, without its head and its declarations, about
#: Names of the arrays of the working memory, by the type of their elements.
ARRAYS = {"double": "doubles", "float": "floats", "int": "ints", "bool": "bools"}


#: What a part computes, by a kernel that it calls: the first of these. Name, and sentence.
SUBJECTS = (
    ("shares?_below", "intervals", "Moments and intervals of the posterior, from all points."),
    ("gauss_newton_sums", "points_at_mode", "Points whose last coordinate is solved for by "
     "Gauss-Newton steps, and their weights: of a tile of points, from `first` on."),
    ("solved_sums", "points_at_mode", "Points whose last coordinate is solved for by "
     "Gauss-Newton steps, and their weights: of a tile of points, from `first` on."),
    ("solved_squares", "points_weighed", "Sums of squared residuals of points, and the log "
     "weights that follow from them: of a tile of points, from `first` on."),
    ("squares_of_product", "points_weighed", "Sums of squared residuals of points, and the log "
     "weights that follow from them: of a tile of points, from `first` on."),
    ("reflect", "errors_apart", "Errors of the model, of each scale, in the first rows of the "
     "system: |(I + s^2 E E^T)^(-1/2) A b|^2 then differs by scale in these alone."),
    ("factor_rows", "fewer_rows", "A system of fewer rows with the same sums of squares."),
    ("integrate_out", "errors_integrated_out", "Errors of the sensors, which all readings share, "
     "integrated out of the linear system of residuals."),
    ("softmax", "weights", "Normalised weights of the points of a round, and their moments."),
    ("largest_few", "tempered", "The power of the density that enough points share."),
    ("add_product_transposed", "moments", "Moments of the weighted points, and what follows."),
)  # fmt: skip
BEFORE = "readings", "From readings to rows of the linear system of residuals."
AFTER = "between_rounds", "What follows from all points of a round: the proposal of the next one."
OF_POINTS = "points", "Of a tile of points, from `first` on."


@dataclass
class _Part:
    """Consecutive statements that become one function."""

    stage: int  # number of the stage of points; 0 for none
    statements: list[Statement] = field(default_factory=list)
    lines: int = 0

    @property
    def code(self) -> str:
        """The text of the statements."""
        return "\n".join(statement.code for statement in self.statements)

    @property
    def count(self) -> str:
        """The count that a statement sets, if one does."""
        found = re.search(r"\bint (n\d+) = 0;", self.code)
        return found[1] if found else ""


def stage_functions(
    graph: str, program: Program, plan: MemoryPlan, inputs: Mapping[str, str]
) -> tuple[list[str], list[str]]:
    """Texts of the functions of a program, and the lines of C that call them.

    graph: Name of the function that calls them.
    program, plan: Statements, and where their tensors lie.
    inputs: Element types by name of the C parameters that are inputs of the graph.
    """
    texts: list[str] = []
    calls: list[str] = []
    stage = 0
    names: Counter[str] = Counter()
    for part in _parts(program):
        subject, sentence = _subject(part, after=bool(calls) and any("first" in c for c in calls))
        names[subject] += 1
        number = f"_{names[subject]}" if names[subject] > 1 else ""
        name = f"{graph.removesuffix('_graph')}_{subject}{number}"
        used = _used(part, program, inputs)
        parameters = [declaration for declaration, _ in used]
        arguments = ", ".join(argument for _, argument in used)
        kind = "int" if part.count else "void"
        head = f"static {kind} {name}({', '.join(parameters)})"
        about = f"/* {sentence} */"
        lines = textwrap.wrap(about, WIDTH, subsequent_indent=" " * 3)
        lines += [*textwrap.wrap(head, WIDTH, subsequent_indent=" " * 4), "{"]
        lines += _statements(part, program, plan)
        lines += [f"    return {part.count};"] if part.count else []
        texts.append("\n".join([*lines, "}"]))
        if part.stage and part.stage != stage:
            points = program.stages[part.stage]
            calls.append(f"    for (int first = 0; first < {points}; first += {program.tile}) {{")
        call = f"{f'const int {part.count} = ' if part.count else ''}{name}({arguments});"
        indent = "        " if part.stage else "    "
        calls += textwrap.wrap(
            call, WIDTH, initial_indent=indent, subsequent_indent=f"{indent}    "
        )
        stage = part.stage
        calls.append("    }" if stage else "")
    return texts, _joined(calls)


def _subject(part: _Part, after: bool) -> tuple[str, str]:
    """The name of a part, and a sentence on what it computes."""
    for kernel, name, sentence in SUBJECTS:
        if re.search(rf"\b{kernel}_(float|double)\(", part.code):
            return name, sentence
    return OF_POINTS if part.stage else AFTER if after else BEFORE


def _joined(calls: list[str]) -> list[str]:
    """Lines of calls, with those of one stage in one loop."""
    lines: list[str] = []
    for line in calls:
        if line.startswith("        ") and lines[-1:] == ["    }"]:
            lines.pop()
        if line:
            lines.append(line)
    return lines


def _parts(program: Program) -> list[_Part]:
    """The statements of a program in parts that are not too long; each sets one count at most."""
    parts: list[_Part] = []
    for statement in program.statements:
        length = statement.code.count("\n") + 2
        sets = bool(re.search(r"\bint n\d+ = 0;", statement.code))
        last = parts[-1] if parts else None
        if (
            last is None
            or last.stage != statement.stage
            or last.lines + length > LONGEST
            or (sets and last.count)
        ):
            last = _Part(statement.stage)
            parts.append(last)
        last.statements.append(statement)
        last.lines += length
    return parts


def _used(part: _Part, program: Program, inputs: Mapping[str, str]) -> list[tuple[str, str]]:
    """Parameters of a part, and what they are given: memory, counts and inputs that it reads."""
    code = re.sub(r"/\*.*?\*/", "", part.code)
    used = [("WORK *work", "work")]
    if re.search(r"\bmemory,", code):
        used.append(("const MEMORY *memory", "memory"))
    for count in program.bounds:
        if re.search(rf"\b{count}\b", code) and count != part.count:
            used.append((f"int {count}", count))
    used += [
        (f"const {kind} *{name}", name)
        for name, kind in inputs.items()
        if re.search(rf"\b{name}\b", code)
    ]
    tile = part.stage and re.search(r"\bfirst\b", code)
    return used + ([("int first", "first")] if tile else [])


def _statements(part: _Part, program: Program, plan: MemoryPlan) -> list[str]:
    """The statements of a part, each tensor declared where it is named first."""
    lines: list[str] = []
    born: set[str] = set()
    for statement in part.statements:
        if statement.comment:
            text = f"/* {statement.comment} */"
            lines += textwrap.wrap(text, WIDTH, initial_indent=" " * 4, subsequent_indent=" " * 7)
        for own in statement.names:
            if own not in born:
                kind = program.memory[own][0]
                place = f"work->{ARRAYS[kind]} + {plan.offsets[own]}"
                lines.append(f"    {kind} *const {own} = {place};")
                born.add(own)
        lines.append(statement.code)
    return lines
