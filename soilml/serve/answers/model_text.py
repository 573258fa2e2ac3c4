"""The model file of what the page has chosen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from soilml.config.measurement_noise import Noise
from soilml.config.write_case import case_as_toml
from soilml.numerics.prior import Prior
from soilml.serve.answers.chosen_case import forward_case, whole_case, with_sliders

#: Priors and noise of a model file that the page writes: those of `soilml init`.
PRIOR = {
    "cohesion": Prior(0.0, 5000.0),
    "friction_angle": Prior(0.35, 0.80),
    "shear_modulus": Prior(0.003, 0.05, log=True),
}
NOISE = {
    "torque_Nm": Noise(share=0.02),
    "drawbar_pull_N": Noise(share=0.02, constant=0.5),
    "sinkage_m": Noise(constant=0.001),
}
_COMMENTS = (
    "Wheel and soil as chosen on the page; docs/model-file.md explains every section. SI units.",
    "[soil.prior] is what may be true before the log: cohesion, friction angle and shear modulus",
    "are identified in it. [noise] is one standard deviation of each sensor: correct both.",
)


def model_text(request: dict[str, Any]) -> dict[str, str]:
    """The text of a model file: the one that was given, once checked, or the sliders' own.

    Raises `InputError` as `forward_case` does.
    """
    given = request.get("model")
    if isinstance(given, str) and given.strip() and not request.get("values"):
        whole_case(request)
        return {"text": given}
    case, _ = with_sliders(forward_case(request), request)
    own = replace(case, prior=case.prior or PRIOR, noise=case.noise or NOISE)
    return {"text": case_as_toml(own, _COMMENTS)}
