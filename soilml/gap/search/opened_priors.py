"""Priors of the soil that a fit presses against, opened as far as natural soils vary."""

from __future__ import annotations

from dataclasses import dataclass, replace

from soilml.config.case import Case
from soilml.fitting.coordinates import Coordinate, free_soil_parameters, select_free
from soilml.fitting.least_squares import Solution
from soilml.gap.evidence.problem import FitProblem
from soilml.gap.search.stepwise import SearchResult
from soilml.numerics.prior import Prior
from soilml.quantities import SHEAR
from soilml.remarks import Remark
from soilml.report.numbers import format_quantity

#: Distance from a bound, as a fraction of the prior, at which a fit presses against it.
PRESSED = 0.02
#: Amplitude of a remainder, in usual ones, from which it is large.
LARGE_LEFT = 4.0
#: Parameters of the soil whose priors are opened together: with the bearing fixed, those of shear
#: press for what the bearing lacks, and the other way round.
OPENED = (*SHEAR, "kphi", "n")


@dataclass(frozen=True)
class OpenedPriors:
    """A case with the priors of its soil opened, its free soil parameters, and why."""

    case: Case
    soil: tuple[Coordinate, ...]
    remark: Remark


def open_priors(problem: FitProblem, result: SearchResult) -> OpenedPriors | None:
    """The priors opened, where the best explanation of a gap does not explain it within them.

    It then presses the soil against one of them, or leaves a large remainder. Each prior is opened
    to the range of natural soils, and a parameter that the case fixes gets that range.
    """
    if not result.has_gap:
        return None
    best = next((c for c in result.accepted if c.names), result.likeliest)
    pressed = pressed_priors(result.soil if best is None else best.fit)
    left = best is None or float(best.amplitude.max()) >= LARGE_LEFT
    wide = {c.path: c.prior for c in select_free(replace(problem.case, prior={}), OPENED)}
    known = problem.case.prior
    opened = {
        path: _both(prior, known[path]) if path in known else prior for path, prior in wide.items()
    }
    if not (pressed or left) or all(known.get(path) == prior for path, prior in opened.items()):
        return None
    case = replace(problem.case, prior=known | opened)
    why = "Within them, a large remainder is left"
    if pressed:
        why = f"The fit reached {'; '.join(pressed.values())}"
    text = f"the priors of the soil were opened. {why}"
    remark = Remark("prior-opened", text, tuple(pressed))
    return OpenedPriors(case, tuple(free_soil_parameters(case, None)), remark)


def _both(wide: Prior, own: Prior) -> Prior:
    """A prior over the range of two."""
    lower, upper = min(wide.lower, own.lower), max(wide.upper, own.upper)
    return Prior(lower, upper, log=wide.log and lower > 0.0)


def pressed_priors(fit: Solution) -> dict[str, str]:
    """The soil parameters that a fit has at an end of their prior, by path, in words."""
    found = {}
    for c, x in zip(fit.coordinates, fit.x, strict=True):
        if not c.effect and min(x - c.lower, c.upper - x) < PRESSED:
            end, bound = ("lower", c.prior.lower) if x < 0.5 else ("upper", c.prior.upper)
            value = format_quantity(bound, c.unit)
            found[c.path] = f"{c.name.replace('_', ' ')} at {value}, the {end} end of its prior"
    return found
