"""Time of a solution by size of a call and by error, as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from soilml.io.atomic_files import atomic_output

PICTURE = Path(__file__).parents[1] / "docs" / "speed.png"

Curves = Mapping[str, Sequence[tuple[float, float]]]


def draw(by_size: Curves, by_error: Curves) -> None:
    """Two panels of curves (size or error, seconds of a row), by name of the way."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axis, curves in ((left, by_size), (right, by_error)):
        for name, points in curves.items():
            x, seconds = zip(*points, strict=True)
            axis.plot(x, [1e6 * s for s in seconds], "o-", ms=4, label=name)
        axis.set(xscale="log", yscale="log")
        axis.grid(alpha=0.3)
    left.set(xlabel="rows in a call", ylabel="processor time of a row, us")
    right.set(xlabel="largest relative error of the torque")
    right.invert_xaxis()
    left.legend(fontsize=8)
    with atomic_output(PICTURE) as part:
        figure.savefig(part, format="png", dpi=110, metadata={"Software": "soilml"})
