"""Range of the noise in which the first suspect stays first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilml.inference.explanation import Explanation
from soilml.inference.posterior import Names, Posterior
from soilml.remarks import Remark

#: Factors on the estimated noise and scatter that are tried: published figures are read to about
#: half or twice what is declared for them.
FACTORS = (0.5, 0.7, 1.4, 2.0)


def noise_range(posterior: Posterior, first: Names) -> Remark:
    """In which range of the noise the first suspect has more evidence than all others.

    The evidence of each explanation is computed anew for noise and scatter that are smaller or
    larger, with its fit linearised.
    """
    likeliest = {factor: _likeliest(posterior, factor) for factor in FACTORS}
    other = {f: names for f, names in likeliest.items() if not set(first) <= set(names)}
    low = min((f for f in (*FACTORS, 1.0) if not any(f <= o < 1.0 for o in other)), default=1.0)
    high = max((f for f in (*FACTORS, 1.0) if not any(f >= o > 1.0 for o in other)), default=1.0)
    text = f"{' + '.join(first)} stays first for {low:.2g} to {high:.2g} times the noise"
    if other:
        nearest = min(other, key=lambda f: abs(np.log(f)))
        rival = " + ".join(other[nearest]) or "the soil alone"
        text += f"; with {nearest:.2g} times the noise, {rival} is likelier"
    return Remark("noise-range", text, first, "note")


def _likeliest(posterior: Posterior, factor: float) -> Names:
    """The effects of the likeliest hypothesis where noise and scatter are multiplied."""
    terms = posterior.terms
    of_noise = np.arange(terms.groups + terms.channels) >= terms.channels

    def value(node: Explanation) -> float:
        at = replace(node.at, log=node.at.log + np.log(factor) * of_noise)
        return node.linear.evaluate(at).value + posterior.problem.penalty(node.hypothesis)

    return min(posterior.nodes, key=value).hypothesis.effects
