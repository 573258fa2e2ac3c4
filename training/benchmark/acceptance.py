"""What the benchmark is to show, each goal with the figure that was measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soilml.quantities import SHEAR
from training.benchmark.methods import ANALYTIC, JOINED, PRIOR
from training.benchmark.paired_results import Result

Floats = NDArray[np.float64]

#: Most that RMSE may be of the limit's: of one row, and of every size.
ONE_ROW, EVERY_SIZE = 1.01, 1.05
#: What 90 % intervals are to hold, and the share that a region of the limit holds.
HELD, REGION = (0.88, 0.92), 0.9
#: RMSE that 18 rows are to leave of SHEAR (Pa, rad, m), for cohesions (Pa) in a range.
LEFT = (90.0, float(np.radians(0.8)), 0.0009)
COHESIONS = (100.0, 2000.0)
EIGHTEEN = 18
#: By the name of their line: files that one row's goal is for, and those that have no goal.
ALONE = ("lssvm", "mlp")
BASELINES = ("linear", JOINED)
#: Figures and units of SHEAR for people.
SHOWN = ((1e-3, "kPa"), (180.0 / np.pi, "deg"), (1e3, "mm"))
SYMBOLS = ("c", "phi", "K")


@dataclass(frozen=True)
class Goal:
    """One goal of one method: what was measured, what the limit itself has, and whether it is met.

    `error` is the standard error of the figures where it is known, in words; else blank.
    """

    what: str
    method: str
    measured: str
    error: str
    limit: str
    met: bool


def goals(results: Sequence[Result], limit: str) -> list[Goal]:
    """All goals of the model files and of methods of one's own, computed from their results.

    `limit` is the line of the limit. Sets with an effect that no method knows take no part.
    """
    known = [r for r in results if not r.effect]
    least = [r for r in known if r.method == limit]
    labels = list(dict.fromkeys(r.method for r in known))
    found = [_sound(least)]
    for label in labels:
        own = [r for r in known if r.method == label]
        if label in (PRIOR, limit) or label.startswith(ANALYTIC):
            continue
        if any(kind in label for kind in ALONE):
            found += _near(
                own, f"1 row: RMSE / limit <= {ONE_ROW}", ONE_ROW, lambda rows: rows == 1
            )
            continue
        if any(kind in label for kind in BASELINES):
            continue
        found += _near(own, f"every size: RMSE / limit <= {EVERY_SIZE}", EVERY_SIZE, lambda r: True)
        found += _held(own, least)
        found += _left(own, least)
    return found


def _sound(least: Sequence[Result]) -> Goal:
    """The limit's own check: truths in the smallest region that holds 90 % of each posterior."""
    inside = np.concatenate([r.denser for r in least]) < REGION
    low, high = HELD
    return Goal(
        f"smallest region of 90 % of the posterior: {low:.0%} to {high:.0%}",
        least[0].method,
        f"{inside.mean():.1%}",
        f"{np.sqrt(0.09 / inside.size):.1%}",
        "",
        bool(low <= inside.mean() <= high),
    )


def _near(
    own: Sequence[Result], what: str, most: float, sized: Callable[[int], bool]
) -> Iterator[Goal]:
    """The worst ratio of the designs of some sizes."""
    some = [r for r in own if sized(r.design.rows)]
    if not some:
        return
    worst = max(some, key=lambda r: float(np.nan_to_num(r.ratio, nan=np.inf).max()))
    k = int(np.argmax(np.nan_to_num(worst.ratio, nan=np.inf)))
    where = f"{SYMBOLS[k]}, {worst.design.text}" if len(some) > 1 else SYMBOLS[k]
    yield Goal(
        what,
        worst.method,
        f"{worst.ratio[k]:.3f} ({where})",
        f"{worst.ratio_std[k]:.3f}",
        "1",
        bool(worst.ratio[k] <= most),
    )


def thirds(result: Result) -> Floats:
    """Share (3, q) of truths that the 90 % interval holds, by third of the prior's range."""
    found = np.full((3, len(result.priors)), np.nan)
    for k, prior in enumerate(result.priors):
        ends = prior.at(np.asarray([0.0, 1 / 3, 2 / 3, 1.0]))
        for third in range(3):
            truth = result.truth[:, k]
            inside = (truth >= ends[third]) & (truth <= ends[third + 1])
            if inside.any():
                found[third, k] = result.where(inside).cover90[k]
    return found


def _held(own: Sequence[Result], least: Sequence[Result]) -> Iterator[Goal]:
    """Coverage of 90 % intervals, mean of all designs: overall, and by third of the prior."""
    low, high = HELD
    needed = f"{low:.0%} to {high:.0%}"
    parts: list[tuple[str, Callable[[Result], Floats]]] = [("overall", lambda r: r.cover90)]
    for third, name in enumerate(("lower", "middle", "upper")):
        parts.append((f"{name} third", lambda r, third=third: thirds(r)[third]))  # type: ignore[misc]
    for name, figure in parts:
        mean, limit = (np.nanmean([figure(r) for r in rs], axis=0) for rs in (own, least))
        sets = len(own) ** 2 / sum(1.0 / r.sets for r in own) / (1 if name == "overall" else 3)
        yield Goal(
            f"90 % intervals, {name}: {needed}",
            own[0].method,
            _list(f"{v:.1%}" for v in mean),
            f"about {np.sqrt(0.09 / sets):.1%}",
            _list(f"{v:.1%}" for v in limit),
            bool(((mean >= low) & (mean <= high)).all()),
        )


def _left(own: Sequence[Result], least: Sequence[Result]) -> Iterator[Goal]:
    """RMSE of the largest sets, where cohesion is in the range that the goal is for."""
    most = _list(f"{x * f:.2g} {u}" for x, (f, u) in zip(LEFT, SHOWN, strict=True))
    low, high = COHESIONS
    for method, limit in zip(own, least, strict=True):
        if method.design.rows != EIGHTEEN:
            continue
        truth = method.truth[:, SHEAR.index("cohesion")]
        inside = (truth >= low) & (truth <= high)
        some = method.where(inside)
        yield Goal(
            f"18 rows, c {low / 1e3:g} to {high / 1e3:g} kPa: RMSE <= {most}",
            method.method,
            _rmse(some.rmse),
            _rmse(spread_of(some)),
            _rmse(limit.where(inside).rmse),
            bool((some.rmse <= np.asarray(LEFT)).all()),
        )


def spread_of(result: Result) -> Floats:
    """Standard error (q,) of the RMSE over sets."""
    square = result.error**2
    return np.asarray(square.std(axis=0) / np.sqrt(result.sets) / (2.0 * result.rmse))


def _rmse(values: Floats) -> str:
    return _list(f"{v * factor:.2g}" for v, (factor, _) in zip(values, SHOWN, strict=True))


def _list(words: Iterator[str] | Sequence[str]) -> str:
    return ", ".join(words)
