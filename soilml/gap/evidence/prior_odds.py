"""Prior odds of effects: of their families first, then of the effects of a family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from soilml.physics.effects.base import Effect

#: Causes that a model is expected to lack before any row is seen, whatever the catalogue's size.
EXPECTED_CAUSES = 1.0


def effect_penalties(effects: Mapping[str, type[Effect]]) -> dict[str, float]:
    r"""-2 ln of the prior odds of each effect against its absence, by name.

    .. math:: -2 \ln \frac{\lambda}{F\,n}

    with F families, n effects in the effect's own one, and the expected number of causes,
    `EXPECTED_CAUSES`. An effect without a family is one of its own; on one of several gears, it is
    of the family that it has on all of them. A catalogue that grows, or a law of which more forms
    are listed, does not make a cause likelier.

    References: Scott and Berger, Bayes and empirical-Bayes multiplicity adjustment in the
    variable-selection problem, Annals of Statistics 38(5), 2010.
    """
    family = {n: e.about.family or n.partition("@")[0] for n, e in effects.items()}
    members = Counter(family.values())
    return {
        name: 2.0 * float(np.log(len(members) * members[own] / EXPECTED_CAUSES))
        for name, own in family.items()
    }
