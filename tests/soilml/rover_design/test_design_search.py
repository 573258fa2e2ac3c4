"""Rounds of designs, the front, and the best design."""

from dataclasses import replace

import numpy as np
import pytest
from design_files import STUDY

from soilml import design
from soilml.rover_design.search import Designs, best_design, meets, pareto_front
from soilml.rover_design.study import Dimension, read_study


@pytest.fixture
def study(tmp_path):
    (tmp_path / "rover.toml").write_text(STUDY)
    return read_study(tmp_path / "rover.toml")


def designs_of(width, margin, probability):
    results = {
        "probability": np.asarray(probability),
        "margin_at_risk_N": np.asarray(margin),
    }
    return Designs({"width": np.asarray(width)}, results)


def test_the_front_is_what_no_other_design_beats(study):
    rng = np.random.default_rng(3)
    width, margin = rng.random((2, 60)).round(1)  # with ties
    found = set(pareto_front(study, designs_of(width, margin, margin)).tolist())
    points = {(width[i], margin[i]) for i in found}
    for i in range(60):
        beaten = np.any(
            (width <= width[i])
            & (margin >= margin[i])
            & ((width < width[i]) | (margin > margin[i]))
        )
        assert ((width[i], margin[i]) in points) == (not beaten)


def test_the_best_design_is_the_least_one_that_meets_the_goal(study):
    own = designs_of([0.05, 0.08, 0.10], [-1.0, 1.0, 2.0], [0.90, 0.96, 0.99])
    assert meets(study, own).tolist() == [False, True, True]
    assert best_design(study, own) == 1
    likeliest = designs_of([0.05, 0.08], [-3.0, -1.0], [0.2, 0.7])
    assert not meets(study, likeliest).any() and best_design(study, likeliest) == 1


@pytest.mark.slow
def test_later_rounds_find_a_smaller_wheel_than_the_first(study):
    study = replace(study, goal=replace(study.goal, slope=0.05, risk=0.2))
    found = design(study, designs=8, draws=40)
    designs = found.designs
    first = Designs(*({k: v[:8] for k, v in own.items()} for own in
                      (designs.dimensions, designs.results)))  # fmt: skip
    assert meets(study, first).any()
    width = found.best_dimensions["width"]
    assert width < first.dimensions["width"][meets(study, first)].min()
    assert width == designs.dimensions["width"][meets(study, designs)].min()
    assert found.as_json()["best"]["width"] == width
    # on the limit: a slightly narrower wheel of the same lugs does not meet it
    same = designs.dimensions["lug_height"] == found.best_dimensions["lug_height"]
    narrower = same & (designs.dimensions["width"] < width - 1e-9)
    assert not meets(study, designs)[narrower].any()


def test_listed_sizes_are_each_tried_once(study):
    sizes = {"width": Dimension((0.05, 0.08)), "lug_height": Dimension((0.0, 0.01))}
    study = replace(study, dimensions={**study.dimensions, **sizes})
    found = design(study, designs=32, draws=20).designs
    tried = set(zip(found.dimensions["width"], found.dimensions["lug_height"], strict=True))
    assert found.count == len(tried) == 4
