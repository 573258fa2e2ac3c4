"""Range of the noise in which the first suspect stays first."""

from __future__ import annotations

import numpy as np

from soilml.gap.evidence.covariance import Covariance
from soilml.gap.evidence.marginal_likelihood import DiscrepancyModel
from soilml.gap.search.explanation import Explanation
from soilml.gap.search.passes import Analysis
from soilml.remarks import Remark

#: Factors on the estimated noise and scatter that are tried: published figures are read to about
#: half or twice what is declared for them.
FACTORS = (0.5, 0.7, 1.4, 2.0)


def noise_range(analysis: Analysis, first: Explanation) -> Remark:
    """In which range of the noise the first suspect has more evidence than all others.

    The evidence of each explanation is computed anew for noise and scatter that are smaller or
    larger, with its fit linearised; see `DiscrepancyModel.evidence`.
    """
    likeliest = {factor: _likeliest(analysis, factor) for factor in FACTORS}
    other = {f: names for f, names in likeliest.items() if not set(first.names) <= set(names)}
    low = min((f for f in (*FACTORS, 1.0) if not any(f <= o < 1.0 for o in other)), default=1.0)
    high = max((f for f in (*FACTORS, 1.0) if not any(f >= o > 1.0 for o in other)), default=1.0)
    text = f"{' + '.join(first.names)} stays first for {low:.2g} to {high:.2g} times the noise"
    if other:
        nearest = min(other, key=lambda f: abs(np.log(f)))
        rival = " + ".join(other[nearest]) or "the soil alone"
        text += f"; with {nearest:.2g} times the noise, {rival} is likelier"
    return Remark("noise-range", text, first.names, "note")


def _likeliest(analysis: Analysis, factor: float) -> tuple[str, ...]:
    """The effects of the likeliest suspect, or none, where the noise is multiplied."""
    problem, result = analysis.problem, analysis.result
    found = problem.covariance
    scaled = Covariance(found.matrix * factor**2, found.whiten / factor, found.components)
    model = DiscrepancyModel(scaled, problem.discrepancy.process)
    listed = [c for c in result.candidates if c.names not in result.posterior.unlisted]
    values = {c.names: model.evidence(c.fit, c.amplitude).value + c.penalty for c in listed}
    return min(values, key=lambda names: values[names])
