"""The status of a gap by the probabilities of a posterior."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml.gap.decision import decide
from soilml.gap.estimates import likeliest


@pytest.mark.parametrize(("no_gap", "status"), [(0.3, "suspected"), (0.0, "unknown")])
def test_a_smooth_error_is_stated_where_it_is_likelier_than_each_effect(no_gap, status):
    def node(*effects):
        fit = SimpleNamespace(x=np.zeros(0), precision=np.zeros(0), coordinates=[])
        hypothesis = SimpleNamespace(effects=effects, wide_priors=False)
        return SimpleNamespace(hypothesis=hypothesis, fit=fit, at=None)

    sets = {(): 0.3, ("rate",): 0.2, ("slope",): 0.2}
    posterior = SimpleNamespace(
        no_effect=0.3,
        no_gap=no_gap,
        sets=sets,
        nodes=[node(*names) for names in sets],
        node_of=lambda names: node(*names),
        probability=lambda *names: sets[names],
        terms=SimpleNamespace(amplitude=lambda _: np.zeros(3)),
    )
    decision = decide(posterior, ())
    assert decision.status == status
    if status == "suspected":
        assert [r.code for r in decision.reasons] == ["gap-not-certain"]
        assert decision.listed == (("rate",), ("slope",))


def test_explanations_of_a_file_have_a_weight_there():
    weights = {"a": 0.8, "b": 0.1, "c": 4e-5, "d": 3e-5}
    posterior = SimpleNamespace(nodes=[*weights], node_weight=weights.get)
    assert likeliest(posterior) == [(0.8, "a"), (0.1, "b")]
