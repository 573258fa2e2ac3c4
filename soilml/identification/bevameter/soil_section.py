"""The soil of a model file from plate and shear tests: values, priors, tests."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from soilml.config.case import Case
from soilml.config.write_case import case_as_toml, soil_as_toml
from soilml.identification.bevameter.laws import LEAST_SIZE_RATIO, PressureSinkageFit, ShearFit
from soilml.identification.bevameter.result import BevameterResult
from soilml.identification.bevameter.scatter import SpreadEstimate
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.physics.soils.soil_tests import PlatePressure, ShearStrength
from soilml.remarks import Remark, texts
from soilml.report.numbers import round_significant

#: Soil parameters that plates determine, and those that shear tests determine.
BEARING, SHEARING = ("kc", "kphi", "n"), ("cohesion", "friction_angle", "shear_modulus")
#: Least modulus of a width, as a fraction of the estimate, where tests at other widths leave it
#: open down to zero.
LEAST_MODULUS = 0.01
LOG_FACTOR = 3.0  # A prior above zero is logarithmic where its ends differ by this factor or more
#: Least width of a prior, as a fraction of its value: a test is not read better than this.
LEAST_WIDTH = 1e-3
#: Standard deviations that the range of 95 % of a normal distribution reaches from its middle.
Z_95 = 1.96
LEAST_SCATTER = 0.02  # Least scatter that is stated: no two places are more alike

Section = tuple[dict[str, float], dict[str, Prior], list[Remark]]


def plate_section(fit: PressureSinkageFit, case: Case | None) -> Section:
    """Values, priors and remarks on kc, kphi and n, for the widths of the case's gears.

    For gears of one width only k = kc / b + kphi at that width matters: kc is then fixed, and the
    prior of kphi is that of k. Plates of one size leave open how k varies with width; between the
    limits kphi = 0 and kc = 0 it is k times the ratio of the widths, and k itself.
    """
    kc, kphi = fit.moduli
    exponent = fit.estimates()["n"]
    values = {"kc": kc, "kphi": kphi, "n": exponent.value}
    prior = {"n": _prior("n", exponent.value, exponent.another_place_95)}
    widths = widths_of_gears(case)
    remarks: list[Remark] = []
    if len(widths) > 1 and fit.several_sizes:
        for name in ("kc", "kphi"):
            prior[name] = _prior(name, values[name], fit.estimates()[name].another_place_95)
        return values, prior, remarks
    ranges = []
    for width in widths or (fit.sizes[0],):
        k = fit.modulus(width if fit.several_sizes else fit.sizes[0])
        low, high = k.another_place_95
        if not fit.several_sizes:
            ratio = fit.sizes[0] / width
            low, high = low * min(1.0, ratio), high * max(1.0, ratio)
            if widths and abs(ratio - 1.0) > LEAST_WIDTH:
                text = (
                    f"the gear is {width:.3g} m wide and the plate {fit.sizes[0]:.3g} m: the range "
                    "of kphi covers all from kc = 0 to kphi = 0"
                )
                remarks.append(Remark("another-width", text, ("kphi",)))
        elif low < LEAST_MODULUS * abs(k.value):
            low = LEAST_MODULUS * abs(k.value)
            text = (
                f"the plates do not determine k at the width of the gear, {width:.3g} m; its range "
                "reaches down to a hundredth"
            )
            remarks.append(Remark("not-identified", text, ("kphi",)))
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
    found = fit.estimates()
    known = {name: own for name, own in found.items() if name != "shear_strength"}
    values = {name: own.value for name, own in known.items()}
    prior = {n: _prior(n, own.value, own.another_place_95) for n, own in known.items()}
    if fit.several_stresses:
        return values, prior, []
    sigma, (low, high) = fit.stresses[0], fit.strength.another_place_95
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
    text = f"the range of cohesion is {whose}, and that of the friction angle what this leaves"
    return values, prior, [Remark("assumed-range", text, ("cohesion", "friction_angle"))]


def within_bounds(values: Mapping[str, float]) -> dict[str, float]:
    """The values, kept within the bounds that the soil's parameters have."""
    bounds = declared(Soil)
    return {k: min(max(v, bounds[k].lower), bounds[k].upper) for k, v in values.items()}


def widths_of_gears(case: Case | None) -> tuple[float, ...]:
    """Distinct widths of the gears of a case (m); none where a gear has no width."""
    models = () if case is None else tuple(case.gears.values()) or (case.model,)
    widths = (getattr(model.gear, "width", None) for model in models)
    return tuple(dict.fromkeys(float(width) for width in widths if width is not None))


def _prior(name: str, value: float, span: tuple[float, float]) -> Prior:
    """A prior over a range that contains the value, within the bounds of the parameter."""
    bounds = declared(Soil)[name]
    least = LEAST_WIDTH * abs(value) + 1e-12
    lower, upper = min(span[0], value - least), max(span[1], value + least)
    lower = min(max(lower, bounds.lower), bounds.upper - least)
    upper = max(min(upper, bounds.upper), lower + least)
    log = 0.0 < LOG_FACTOR * lower <= upper
    return Prior(round_significant(lower), round_significant(upper), log=log)


def pressure_test(fit: PressureSinkageFit, case: Case | None) -> PlatePressure | None:
    """The pressure at the reference depth, under the width of the gears or that of the plates.

    At this depth the errors of pressure and exponent are least correlated, so that the pressure and
    the range of n together say what the tests say of kc, kphi and n. None where plates of one size
    tell little of a gear of another width.
    """
    widths = widths_of_gears(case)
    if fit.several_sizes:
        width = widths[0] if len(widths) == 1 else 1.0 / float(np.mean(1.0 / np.array(fit.sizes)))
    else:
        width = fit.sizes[0]
        if any(max(w / width, width / w) > LEAST_SIZE_RATIO for w in widths):
            return None
    pressure = fit.draws.estimate(lambda d: d[0] + d[1] / width, "Pa")
    if (scatter := _scatter(pressure)) is None:
        return None
    width, depth, value = map(round_significant, (width, fit.depth, pressure.value))
    return PlatePressure(plate_width=width, sinkage=depth, pressure=value, scatter=scatter)


def strength_test(fit: ShearFit) -> ShearStrength | None:
    """The strength under the mean normal stress, where cohesion and friction trade off least."""
    if (scatter := _scatter(fit.strength)) is None:
        return None
    mean = float(np.mean([test.level for test in fit.tests]))
    stress, strength = map(round_significant, (mean, fit.strength.value))
    return ShearStrength(normal_stress=stress, strength=strength, scatter=scatter)


def _scatter(estimate: SpreadEstimate) -> float | None:
    """Standard deviation of the logarithm at another place; None where it may be zero or less."""
    low, high = estimate.another_place_95
    if not 0.0 < low < estimate.value < high:
        return None
    return round_significant(max(math.log(high / low) / (2.0 * Z_95), LEAST_SCATTER), 2)


def updated_soil(case: Case, result: BevameterResult) -> Case:
    """The case with the soil of the tests.

    Priors of what they determine, and earlier tests of the same kinds, are replaced.
    """
    determined = (BEARING if result.plates else ()) + (SHEARING if result.shear else ())
    # strengths alone leave K as the case has it
    determined = tuple(n for n in determined if n != "shear_modulus" or n in result.soil)
    kept = {name: prior for name, prior in case.prior.items() if name not in determined}
    measured = tuple(
        test
        for test in case.soil_tests
        if not (result.plates if isinstance(test, PlatePressure) else result.shear)
    )
    return replace(
        case.with_values(result.soil),
        prior={**kept, **result.prior},
        soil_tests=(*measured, *result.tests),
    )


def model_file_text(result: BevameterResult, case: Case | None, source: str) -> str:
    """The case with this soil as a model file; without a case, the soil alone.

    The remarks become comments; `source` names the tables.
    """
    comments = [f"soil from plate and shear tests: {source}", *texts(result.remarks)]
    if case is not None:
        return case_as_toml(updated_soil(case, result), comments)
    return soil_as_toml(result.soil, result.prior, comments, result.tests)


def missing_values(result: BevameterResult) -> list[str]:
    """Parameters of a soil that the tests did not determine and that have no default."""
    return [name for name in (*SHEARING, *BEARING) if name not in result.soil]
