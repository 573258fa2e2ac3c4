"""Held-out rows: what the model that the analysis returns predicts, beside other methods."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from gap_records import Figure, Judged, reaches, share, table

#: Distance of the soil alone from the truth, in noise, from which a prediction is judged: below it
#: nothing is left to improve.
LEFT = 1.0
#: Ratio that counts as worse than the soil alone, and growth that counts: beyond rounding.
WORSE, GREW = 1.05, 1.0 + 1e-9
PARTS = {
    "between": "Rows of the same runs at other slips",
    "region": "Rows at 1.3 to 1.6 times the heaviest load",
}
#: What predicts, as records have it and as tables do.
METHODS = {
    "soil": "soil alone",
    "named": "returned model",
    "Gaussian process": "soil + process",
    "quadratic": "soil + quadratic ridge",
    "process of readings": "process alone",
    "ridge": "quadratic ridge",
    "boosted trees": "boosted trees",
}


def ratios(sets: Sequence[Judged], part: str, over: str, of: str = "named") -> np.ndarray:
    """(n,) distance of a model to the truth over that of a method, where a gap is."""
    own = [s[part] for s in sets if over in s.get(part, {}) and s[part]["soil"] > LEFT]
    return np.asarray([at[of] / at[over] for at in own if of in at])


def figures(sets: Sequence[Judged]) -> Iterator[Figure]:
    """The figures with their gates."""
    shown = [pair for s in sets for part in _shown(s) for pair in part.values()]
    grew = sum(after > GREW * before for before, after in shown)
    yield share("figures that grow while shown as reduction", grew, len(shown), "<= 0.0")
    of_soil = ratios(sets, "between", "soil")
    yield _figure("held out between, returned model over soil alone: median", of_soil, "<= 0.50")
    yield _figure(
        "held out between, returned model over soil alone: worst set", of_soil, "<= 1.0", np.max
    )
    worse = int(np.sum(of_soil > WORSE))
    yield share("held out between, worse than the soil alone by 5 %", worse, len(of_soil))
    for level in (0.0, 0.02, 0.04):
        at = [s for s in sets if s["discrepancy"] == level]
        yield _figure(
            f"held out between, over a Gaussian process alone, discrepancy {level:.0%}: median",
            ratios(at, "between", "process of readings"),
            "<= 1.0",
        )
    yield _figure(
        "held out between, over soil + process: median",
        ratios(sets, "between", "Gaussian process"),
    )
    heavy = ratios(sets, "region", "soil")
    yield _figure("heavier loads, returned model over soil alone: median", heavy)
    yield _figure("heavier loads, returned model over soil alone: worst set", heavy, of=np.max)
    worse = int(np.sum(heavy > WORSE))
    yield share("heavier loads, worse than the soil alone by 5 %", worse, len(heavy))
    yield _figure(
        "heavier loads, over soil + process: median", ratios(sets, "region", "Gaussian process")
    )


def _shown(s: Judged) -> tuple[dict[str, tuple[float, float]], ...]:
    return s.get("gap", {}), s.get("beside_remainder", {})


def _figure(name: str, values: np.ndarray, gate: str = "", of=np.median) -> Figure:  # type: ignore[no-untyped-def]
    if not len(values):
        return Figure(name, "-", gate)
    found = round(float(of(values)), 3)  # as shown; values of a model file are rounded too
    return Figure(
        name, f"{found:.3f} ({len(values)} sets)", gate, reaches(found, gate) if gate else None
    )


def text(sets: Sequence[Judged]) -> str:
    """Median distance to the truth, by status and method."""
    parts = [
        "## Held-out rows, whatever was said\n\nRMS distance to the noise-free readings, in "
        "standard deviations of the noise: median over the sets of a status. *Soil + ...* are "
        "regressions of what the soil alone leaves; the last three know no physics.\n"
    ]
    for part, words in PARTS.items():
        own = [s for s in sets if METHODS.keys() <= s.get(part, {}).keys()]
        rows = []
        for status in [*dict.fromkeys(s["status"] for s in own)]:
            at = [s[part] for s in own if s["status"] == status]
            cells = [f"{np.median([x[m] for x in at]):.2f}" for m in METHODS]
            rows.append((f"`{status}`", str(len(at)), *cells))
        if rows:
            every = [f"{np.median([s[part][m] for s in own]):.2f}" for m in METHODS]
            rows.append(("all", str(len(own)), *every))
            parts.append(f"{words}:\n\n{table(('status', 'sets', *METHODS.values()), rows)}")
    return "\n".join(parts) if len(parts) > 1 else ""
