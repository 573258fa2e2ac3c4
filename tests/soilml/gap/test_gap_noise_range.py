"""For which noise the first suspect stays first."""

from types import SimpleNamespace

import numpy as np
import pytest

from soilml.gap.search.posterior import Posterior
from soilml.gap.verdict import noise_range as module
from soilml.gap.verdict.noise_range import noise_range


def analysed(values):
    """An analysis whose evidence by effects is given for each factor on the noise, 1 to 4."""

    def evidence(model, fit, amplitude):
        factor = float(np.sqrt(model.covariance.matrix[0, 0]))
        return SimpleNamespace(value=values[factor][fit])

    names = [(), ("a",), ("a", "b")]
    candidates = [
        SimpleNamespace(names=n, fit=n, amplitude=None, penalty=6.0 * len(n)) for n in names
    ]
    covariance = SimpleNamespace(matrix=np.eye(2), whiten=np.eye(2), components=None)
    problem = SimpleNamespace(covariance=covariance, discrepancy=SimpleNamespace(process=None))
    result = SimpleNamespace(candidates=candidates, posterior=Posterior({}))
    return SimpleNamespace(problem=problem, result=result), evidence, candidates[1]


WINS = {(): 50.0, ("a",): 10.0, ("a", "b"): 30.0}
WITH_ANOTHER = WINS | {("a", "b"): 0.0}
LOSES = WINS | {(): 10.0}


@pytest.mark.parametrize(
    ("by_factor", "said"),
    [
        ([WINS] * 4, "a stays first for 0.5 to 2 times the noise"),
        ([WITH_ANOTHER, WINS, WINS, WINS], "a stays first for 0.5 to 2 times the noise"),
        (
            [WINS, WINS, WINS, LOSES],
            "a stays first for 0.5 to 1.4 times the noise; with 2 times the noise, the soil alone "
            "is likelier",
        ),
        (
            [LOSES, LOSES, WINS, WINS],
            "a stays first for 1 to 2 times the noise; with 0.7 times the noise, the soil alone "
            "is likelier",
        ),
    ],
)
def test_the_range_ends_where_another_explanation_has_more_evidence(monkeypatch, by_factor, said):
    given, evidence, first = analysed(dict(zip(module.FACTORS, by_factor, strict=True)))
    monkeypatch.setattr(module.DiscrepancyModel, "evidence", evidence)
    found = noise_range(given, first)
    assert found.text == said and found.code == "noise-range" and found.about == ("a",)
