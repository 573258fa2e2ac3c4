"""Tables and text of the fault detection study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from faults import Fault

Floats = np.ndarray[Any, np.dtype[np.float64]]

#: Detection rate that counts as detected; rms error in sigma below which a fault is harmless; set
#: size of the summary.
DETECTED, HARMLESS, SUMMARY_SIZE = 0.95, 1.3, 16
CHANNELS = ("Torque only", "Torque, sinkage and drawbar pull")
ABOUT = (
    "Reference wheel, six slips at six loads, 2 % torque noise, 100 soils per fault; files with "
    "exact sensors. Detection "
    "rates in %: *flagged* by `wheel.onnx`; by a *chi-square* test of the exact model without "
    "knowledge of the fault; and by a *likelihood-ratio* test. That test knows the fault and "
    "its size, and is about the most powerful test there is. Both tests have a false alarm rate "
    "of 1 %. *Error*: rms "
    "error of c, phi and K in standard deviations reported by `wheel.onnx`, over the sets that it "
    "does not flag; 1 for valid sets. Left half: torque only; right half: sinkage and drawbar pull "
    "too."
)
BY_SIZE = (
    "Detection rates by set size, %: wheel.onnx / any_wheel.onnx / chi-square / likelihood ratio."
)
FALSE_ALARMS = "False alarms: valid sets that are flagged, in %, by wheel.onnx / any_wheel.onnx."


@dataclass(frozen=True)
class DetectionRates:
    """Detection rates of each file, of the chi-square test and of the likelihood-ratio test.

    `error` is the rms error of the sets that each file does not flag, in the standard deviations
    that it reports, (files, 3).
    """

    rates: tuple[float, ...]
    error: Floats


Rates = Mapping[tuple[Fault, bool, int], DetectionRates]


def header(first: str, sizes: Sequence[int]) -> str:
    """The header of a table with a column for each set size."""
    names = [first, *(f"{n} row{'s' if n > 1 else ''}" for n in sizes)]
    return f"| {' | '.join(names)} |\n|{'---|' * len(names)}"


def percent(share: float) -> str:
    """In percent, without a sign."""
    return f"{100 * share:.0f}"


def format_errors(error: Floats) -> str:
    """Rms errors in standard deviations."""
    return " ".join("-" if np.isnan(e) else f"{e:.1f}" for e in error)


def all_sizes_table(rates: Rates, sizes: Sequence[int]) -> str:
    """All set sizes, with torque only and with all channels."""
    parts = []
    for all_channels, title in enumerate(CHANNELS):
        lines = [f"**{title}**", "", header("fault", sizes)]
        for fault in dict.fromkeys(f for f, three, _ in rates if three == all_channels):
            cells = [rates[fault, bool(all_channels), n] for n in sizes]
            shares = ["/".join(map(percent, c.rates)) for c in cells]
            lines.append(f"| {fault.name} | {' | '.join(shares)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def summary_table(rates: Rates) -> str:
    """One set size: rates of the first file and of both tests, error, and a verdict."""
    columns = "flagged | chi-square | likelihood ratio | error, sigma | verdict"
    lines = [f"| fault, {SUMMARY_SIZE} rows | {columns} | {columns} |", "|---" * 11 + "|"]
    for fault in dict.fromkeys(f for f, _, _ in rates):
        line = f"| {fault.name} |"
        for all_channels in (False, True):
            if cell := rates.get((fault, all_channels, SUMMARY_SIZE)):
                shares = " | ".join(map(percent, (cell.rates[0], *cell.rates[-2:])))
                line += f" {shares} | {format_errors(cell.error[0])} | {verdict(cell)} |"
            else:
                line += " | | | | not read |"
        lines.append(line)
    return "\n".join(lines)


def verdict(cell: DetectionRates) -> str:
    """In words, for the first file."""
    file, chi_square, likelihood_ratio = cell.rates[0], *cell.rates[-2:]
    if file >= DETECTED:
        return "flagged"
    if chi_square >= DETECTED:
        return "could be flagged"
    if np.nanmax(cell.error[0]) < HARMLESS:
        return "harmless"
    if likelihood_ratio >= DETECTED:
        return "targeted test only"
    return "mimics another soil"
