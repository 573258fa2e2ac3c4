"""Section "The soil": its parameters before and after, their change, and tests of the soil."""

from __future__ import annotations

import math
from typing import Any

from soilml.gap.report_parts import EstimatedValue
from soilml.gap.results import GapReport
from soilml.quantities import Z_90
from soilml.report.numbers import (
    display_unit,
    format_change,
    format_in_si,
    format_with_std,
    parameter_name,
    with_unit,
)


def soil_table(report: GapReport) -> list[dict[str, Any]]:
    """One row for each soil parameter."""
    rows = []
    for path, old in report.soil_before.items():
        new = report.soil_after.get(path, old)
        factor, unit = display_unit(old.unit, max(abs(old.value), abs(new.value)))
        step, std = factor * (new.value - old.value), factor * max(new.std, old.std)
        percent = 100.0 * (new.value / old.value - 1.0) if old.value else math.nan
        rows.append(
            {
                "name": parameter_name(path),
                "path": path,
                "unit": unit,
                "before": format_with_std(factor * old.value, factor * old.std),
                "after": format_with_std(factor * new.value, factor * new.std),
                "before_si": format_in_si(old),
                "after_si": format_in_si(new),
                "moved": with_unit(format_change(step, std), unit),
                "share": f"{percent:+.0f} %".replace("-", "−") if abs(percent) < 1000.0 else "",
                "strip": _strip(old, new),
            }
        )
    return rows


def soil_test_table(report: GapReport) -> list[dict[str, str]]:
    """One row for each plate or shear test that the model file has."""
    rows = []
    for test in report.soil_tests:
        factor, unit = display_unit(test.unit, test.measured)
        rows.append(
            {
                "name": test.label,
                "unit": unit,
                "measured": f"{factor * test.measured:.3g}",
                "before": f"{factor * test.before:.3g}",
                "after": f"{factor * test.after:.3g}",
                "sigma_before": f"{test.sigma_before:+.1f} σ".replace("-", "−"),
                "sigma_after": f"{test.sigma_after:+.1f} σ".replace("-", "−"),
            }
        )
    return rows


def _strip(old: EstimatedValue, new: EstimatedValue) -> list[dict[str, str]]:
    """Positions of value and 90 % interval on a strip 120 wide with margins of 5."""
    ends = [v.value + k * Z_90 * v.std for v in (old, new) for k in (-1, 1)]
    if not all(math.isfinite(e) for e in ends) or max(ends) <= min(ends):
        return []
    low, span = min(ends), max(ends) - min(ends)

    def position(x: float) -> str:
        return f"{5.0 + 110.0 * (x - low) / span:.1f}"

    return [
        {
            "low": position(v.value - Z_90 * v.std),
            "at": position(v.value),
            "high": position(v.value + Z_90 * v.std),
        }
        for v in (old, new)
    ]
