"""Estimated parameters on a page: sentences with units and intervals, and a table."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from soilml.arrays import Floats
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.report import numbers
from soilml.report.page import ReportTable


@dataclass(frozen=True)
class ParameterLine:
    """A parameter in its display unit; `left` is the width over that of the prior, or None.

    `doubted` is whether a warning says that the rows do not identify it.
    """

    name: str
    value: str
    ends: str
    unit: str
    left: float | None
    doubted: bool = False

    @property
    def known(self) -> bool:
        """Whether the rows determine it."""
        return not self.doubted and (self.left is None or self.left <= NOT_IDENTIFIED_ABOVE)

    @property
    def sentence(self) -> str:
        """What was found, with unit and interval."""
        range_ = numbers.with_unit(self.ends, self.unit)
        if not self.known:
            remains = ""
            if self.left is not None:
                remains = f": {100.0 * self.left:.0f} % of the width of its prior remains"
            return (
                f"{numbers.capitalised(self.name)} is not determined by these rows{remains} (90 %: "
                f"{range_})."
            )
        value = numbers.with_unit(self.value, self.unit).replace(" ", "\N{NO-BREAK SPACE}")
        return f"{numbers.capitalised(self.name)} = {value} (90 %: {range_})."


def headline(lines: Sequence[ParameterLine]) -> str:
    """All parameters in one sentence, without their intervals; what is not determined comes first.

    >>> known = ParameterLine("cohesion c", "1.3 ± 0.2", "1.0 to 1.6", "kPa", 0.4)
    >>> unknown = ParameterLine("modulus K", "20 ± 9", "6 to 35", "mm", 0.95)
    >>> headline([known, unknown]).replace(chr(160), " ")
    'Modulus K is not determined by these rows; cohesion c = 1.3 ± 0.2 kPa.'
    """
    parts = []
    unknown = [line.name for line in lines if not line.known]
    if unknown:
        others = "".join(f", nor {name}" for name in unknown[1:])
        parts.append(f"{unknown[0]} is not determined by these rows{others}")
    for line in lines:
        if line.known:
            value = numbers.with_unit(line.value, line.unit).replace(" ", "\N{NO-BREAK SPACE}")
            parts.append(f"{line.name} = {value}")
    return f"{numbers.capitalised('; '.join(parts))}."


def parameter_lines(
    names: Sequence[str],
    units: Sequence[str],
    values: Floats,
    std: Floats,
    low: Floats,
    high: Floats,
    left: Sequence[float | None],
    doubted: Container[str] = (),
) -> list[ParameterLine]:
    """A line for each of p parameters, from arrays (p,) in SI units."""
    found = []
    for name, unit, value, error, *ends, share in zip(
        names, units, values, std, low, high, left, strict=True
    ):
        factor, shown = numbers.display_unit(unit, float(abs(value)))
        found.append(
            ParameterLine(
                name=numbers.parameter_name(name),
                value=numbers.format_with_std(factor * value, factor * error),
                ends=numbers.format_interval(factor * ends[0], factor * ends[1], factor * error),
                unit=shown,
                left=share,
                doubted=name in doubted,
            )
        )
    return found


def parameter_table(lines: Mapping[str, list[ParameterLine]], by: str | None) -> ReportTable:
    """The lines of each group as a table, after a column of the groups."""
    rows = []
    for name, own in lines.items():
        for line in own:
            left = "" if line.left is None else f"{100.0 * line.left:.0f} %"
            value = line.value if line.known else "not determined"
            rows.append([*([name] if by else []), line.name, value, line.ends, line.unit, left])
    header = ["parameter", "value ± std", "90 % interval", "unit", "left of prior"]
    return ReportTable("Parameters", [*([by] if by else []), *header], rows, 1 + bool(by))
