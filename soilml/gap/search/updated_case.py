"""The model with what was found added to it, as a case and as a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from soilml.config.case import Case
from soilml.gap.statistics.coordinates import SHAPE_STD
from soilml.gap.statistics.least_squares import GapFit
from soilml.numerics.prior import Prior
from soilml.parameters import declared
from soilml.physics.soils import Soil

#: Standard deviations to either side of an effect's size that its prior reaches.
KNOWN = 3.0


def grown_case(fit: GapFit) -> Case:
    """The fitted case: soil and effects at their optimum, priors and noise as they were.

    An effect's size gets a prior of three standard deviations to either side, so that those who
    use the model carry on what is open about it.
    """
    fitted, prior, stds = fit.fitted(), dict(fit.case.prior), fit.stds()
    for path, value in fit.values().items():
        name, _, parameter = path.rpartition(".")
        if not name or parameter in SHAPE_STD:
            continue
        bounds = fitted.parameters()[path][0]
        lower = max(bounds.lower, value - KNOWN * stds[path])
        upper = min(bounds.upper, value + KNOWN * stds[path])
        if lower < upper:
            prior[path] = Prior(lower, upper)
    return replace(fitted, prior=prior, noise=dict(fit.case.noise))


def model_text(case: Case, comments: Sequence[str] = ()) -> str:
    """The case as the text of a model file."""
    lines = [f"# {line}" for line in comments]
    lines += ["[gear]", f'type = "{case.model.gear.name}"']
    lines += [
        f"{k} = {_number(getattr(case.model.gear, k))}" for k in declared(type(case.model.gear))
    ]
    lines += ["", "[soil]"]
    lines += [f"{k} = {_number(getattr(case.soil, k))}" for k in declared(Soil)]
    own = {path: prior for path, prior in case.prior.items() if "." not in path}
    if own:
        lines += ["", "[soil.prior]"]
        lines += [f"{path} = {_setting(prior.as_setting())}" for path, prior in own.items()]
    if case.noise:
        lines += ["", "[noise]"]
        lines += [f"{key} = {_setting(noise.as_setting())}" for key, noise in case.noise.items()]
    for effect in case.model.effects:
        lines += ["", "[[effect]]", f'name = "{effect.name}"']
        default = type(effect)()
        for key in declared(type(effect)):
            if float(getattr(effect, key)) != float(getattr(default, key)):
                lines.append(f"{key} = {_number(getattr(effect, key))}")
        priors = {p: v for p, v in case.prior.items() if p.startswith(f"{effect.name}.")}
        if priors:
            lines.append("[effect.prior]")
            for path, prior in priors.items():
                lines.append(f"{path.rpartition('.')[2]} = {_setting(prior.as_setting())}")
    return "\n".join(lines) + "\n"


def _number(value: object) -> str:
    text = repr(float(value))  # type: ignore[arg-type]
    return text if any(c in text for c in ".en") else f"{text}.0"


def _setting(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        inner = ", ".join(f"{k} = {_setting(v)}" for k, v in value.items())
        return "{ " + inner + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_number(v) for v in value) + "]"
    return _number(value)
