"""Sets beside the sample, for figures of causes that can be named of which it has too few."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from gap_case import read_model
from gap_records import FEW_ROWS, LATER_DESIGNS, NAMEABLE_SIGMA, SUSPECT_DESIGNS, Judged
from gap_separation import separation

from datagen.blind_sets.blind_set import draw_blind_set
from datagen.blind_sets.plans import Plan, benchmark_plans
from soilml.io.table import Table

#: Tiers whose causes are effects of the catalogue.
CATALOGUED_TIERS = ("A", "B", "S", "M")
SMALL, LARGE, ONE_LOAD = "discrepancy 1%", "discrepancy 4%", "one load"
#: Groups of causes that can be named, by the size of the discrepancy.
OF_DISCREPANCY = {SMALL: 0.01, LARGE: 0.04}
#: Plans of each group that is enlarged. All its sets with a cause that can be named are alike to
#: the figures that use it, and no other figure counts those that were added.
GROUPS: Mapping[str, Callable[[Plan], bool]] = {
    **{
        group: lambda p, level=level: (
            p.discrepancy == level
            and p.tier in CATALOGUED_TIERS
            and p.design not in SUSPECT_DESIGNS
        )
        for group, level in OF_DISCREPANCY.items()
    },
    ONE_LOAD: lambda p: (
        p.tier in CATALOGUED_TIERS and p.design in SUSPECT_DESIGNS and p.design not in LATER_DESIGNS
    ),
    FEW_ROWS: lambda p: p.tier in CATALOGUED_TIERS and p.design == FEW_ROWS,
}
#: Draws of the plans of few rows and of one load beside the first one, by numbers from that of the
#: seed times 100: one draw of few rows has six or seven with a cause that can be named.
FURTHER_DRAWS = (1, 2)


def further_plans(seeds: Sequence[int]) -> list[Plan]:
    """The plans of few rows and of one load of the further draws of these seeds."""
    drawn = [p for s in seeds for i in FURTHER_DRAWS for p in benchmark_plans(100 * s + i)]
    return [p for p in drawn if GROUPS[FEW_ROWS](p) or GROUPS[ONE_LOAD](p)]


def added(
    plans: Sequence[Plan],
    sample: Sequence[Plan],
    least: int,
    snr: Callable[[Plan], float] | None = None,
) -> Iterator[tuple[Plan, str]]:
    """Plans outside the sample, with their groups, until each has so many that can be named.

    plans: All plans; they are taken in random order.
    snr: The separating SNR of a plan's cause; by default, what its simulated runs show.
    """
    snr = snr or separating_snr
    for group, belongs in GROUPS.items():
        known = [p for p in sample if belongs(p)]
        count = sum(snr(p) >= NAMEABLE_SIGMA for p in known)
        left = [p for p in plans if belongs(p) and p not in known]
        for i in np.random.default_rng(0).permutation(len(left)):
            if count >= least:
                break
            if snr(left[i]) >= NAMEABLE_SIGMA:
                count += 1
                yield left[i], group


def separating_snr(plan: Plan) -> float:
    """The separating SNR of a plan's cause, before any analysis; 0 where no soil carries it."""
    try:
        drawn = draw_blind_set(plan)
    except RuntimeError:
        return 0.0
    return separation(read_model(drawn.model), Table(dict(drawn.columns)), drawn.truth).snr


def sampled(sets: Sequence[Judged], *groups: str) -> list[Judged]:
    """The sets of the sample, and those that were added to some groups."""
    return [s for s in sets if s.get("added_to", "") in ("", *groups)]
