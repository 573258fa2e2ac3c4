"""Values and priors of a model file's soil from plate and shear tests."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from soilml.config.case import Case
from soilml.identification.bevameter.pressure_sinkage import PressureSinkageFit
from soilml.identification.bevameter.shear_strength import ShearFit
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.report.numbers import significant

#: Least modulus of a width, as a fraction of the estimate, where tests at other widths leave it
#: open down to zero.
LEAST_MODULUS = 0.01
#: A prior above zero is logarithmic where its ends differ by this factor or more.
LOG_FACTOR = 3.0
#: Least width of a prior, as a fraction of its value: a test is not read better than this.
LEAST_WIDTH = 1e-3

Section = tuple[dict[str, float], dict[str, Prior], list[str]]


def plate_section(fit: PressureSinkageFit, case: Case | None) -> Section:
    """Values, priors and remarks on kc, kphi and n, for the widths of the case's gears.

    For gears of one width only k = kc / b + kphi at that width matters: kc is then fixed, and the
    prior of kphi is that of k. Plates of one size leave open how k varies with width; between the
    limits kphi = 0 and kc = 0 it is k times the ratio of the widths, and k itself.
    """
    kc, kphi = fit.moduli
    values = {"kc": kc, "kphi": kphi, "n": fit.exponent}
    prior = {"n": _prior("n", fit.exponent, fit.estimates()["n"].place_range)}
    widths = widths_of_gears(case)
    remarks: list[str] = []
    if len(widths) > 1 and fit.several_sizes:
        for name in ("kc", "kphi"):
            prior[name] = _prior(name, values[name], fit.estimates()[name].place_range)
        return values, prior, remarks
    ranges = []
    for width in widths or (fit.sizes[0],):
        k = fit.modulus(width if fit.several_sizes else fit.sizes[0])
        low, high = k.place_range
        if not fit.several_sizes:
            ratio = fit.sizes[0] / width
            low, high = low * min(1.0, ratio), high * max(1.0, ratio)
            if widths and abs(ratio - 1.0) > LEAST_WIDTH:
                remarks.append(
                    f"the gear is {width:.3g} m wide and the plate {fit.sizes[0]:.3g} m: the range "
                    "of kphi covers all from kc = 0 to kphi = 0"
                )
        elif low < LEAST_MODULUS * abs(k.value):
            low = LEAST_MODULUS * abs(k.value)
            remarks.append(
                f"the plates do not determine k at the width of the gear, {width:.3g} m; its range "
                "reaches down to a hundredth"
            )
        ranges.append((low - kc / width, high - kc / width))
    span = min(low for low, _ in ranges), max(high for _, high in ranges)
    prior["kphi"] = _prior("kphi", kphi, span)
    return values, prior, remarks


def shear_section(fit: ShearFit, case: Case | None) -> Section:
    """Values, priors and remarks on cohesion, friction angle and shear modulus.

    At one normal stress the strength is shared between cohesion and friction: the cohesion keeps
    the value and the prior of the case, or is anything up to the strength, and the friction angle
    is what each cohesion leaves.
    """
    modulus = fit.shear_modulus
    values = {"shear_modulus": modulus.value}
    prior = {"shear_modulus": _prior("shear_modulus", modulus.value, modulus.place_range)}
    if fit.cohesion is not None and fit.friction_angle is not None:
        for name, estimate in (("cohesion", fit.cohesion), ("friction_angle", fit.friction_angle)):
            values[name] = estimate.value
            prior[name] = _prior(name, estimate.value, estimate.place_range)
        return values, prior, []
    sigma, (low, high) = fit.stresses[0], fit.strength.place_range
    own = case.prior.get("cohesion") if case is not None else None
    lowest, highest = (own.lower, min(own.upper, high)) if own is not None else (0.0, high)
    lowest = min(lowest, highest)
    c = min(float(case.soil.cohesion), highest) if case is not None else 0.0
    values["cohesion"] = c
    values["friction_angle"] = math.atan(max(fit.strength.value - c, 0.0) / sigma)
    span = math.atan(max(low - highest, 0.0) / sigma), math.atan(max(high - lowest, 0.0) / sigma)
    prior["friction_angle"] = _prior("friction_angle", values["friction_angle"], span)
    prior["cohesion"] = _prior("cohesion", c, (lowest, highest))
    whose = "the model file's" if own is not None else "0 to the whole strength"
    remark = f"the range of cohesion is {whose}, and that of the friction angle what this leaves"
    return values, prior, [remark]


def within_bounds(values: Mapping[str, float]) -> dict[str, float]:
    """The values, kept within the bounds that the soil's parameters have."""
    bounds = declared(Soil)
    return {k: min(max(v, bounds[k].lower), bounds[k].upper) for k, v in values.items()}


def widths_of_gears(case: Case | None) -> tuple[float, ...]:
    """Distinct widths of the gears of a case (m); none where a gear has no width."""
    if case is None:
        return ()
    models: Iterable[object] = (m.gear for m in case.gears.values()) if case.gears else ()
    gears = list(models) or [case.model.gear]
    return tuple(dict.fromkeys(float(g.width) for g in gears if hasattr(g, "width")))


def _prior(name: str, value: float, span: tuple[float, float]) -> Prior:
    """A prior over a range that contains the value, within the bounds of the parameter."""
    bounds = declared(Soil)[name]
    least = LEAST_WIDTH * abs(value) + 1e-12
    lower, upper = min(span[0], value - least), max(span[1], value + least)
    lower = min(max(lower, bounds.lower), bounds.upper - least)
    upper = max(min(upper, bounds.upper), lower + least)
    log = 0.0 < LOG_FACTOR * lower <= upper
    return Prior(significant(lower), significant(upper), log=log)
