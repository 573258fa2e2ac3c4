"""The stage of a remainder's cause: stated where all channels agree on it, else not."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
import pytest
from gap_sets import case_of, driven, fit_problem
from scipy.stats import multivariate_normal

from soilml import Model, Track
from soilml.arrays import namespace
from soilml.fitting.predictions import predict
from soilml.fitting.readings import stack_readings
from soilml.gap import gap
from soilml.gap.evidence.held_out import held_out_folds
from soilml.gap.evidence.stage_changes import stage_changes
from soilml.gap.report.remainder_cause import RemainderCause
from soilml.gap.search.posterior import IN_CATALOGUE
from soilml.gap.verdict.cause_of_remainder import (
    SEVERAL,
    Hypothesis,
    likeliest_stage,
    log_score,
)
from soilml.numerics.prior import UNIFORM_PRECISION
from soilml.parameters import Parameter
from soilml.physics.effects import Effect, EffectCard

CARD = EffectCard("a cause of no catalogue", "none", "soil", {"size": 0.2}, {}, "")


@dataclass(frozen=True, kw_only=True)
class Shaken(Effect):
    """Above a slip of a third the soil is weaker."""

    name: ClassVar[str] = "shaken"
    about: ClassVar[EffectCard] = CARD
    size: Annotated[float, Parameter("1", 0.0, 1.0)] = 0.0

    def on_stress(self, stress, load_case):
        xp = namespace(stress.shear)
        weaker = self.size / (1.0 + xp.exp(-(load_case.at.slip - 0.33) / 0.04))
        return replace(stress, shear=stress.shear * (1.0 - weaker))


@dataclass(frozen=True, kw_only=True)
class Cable(Effect):
    """A cable that pulls the harder, the heavier the wheel."""

    name: ClassVar[str] = "cable"
    about: ClassVar[EffectCard] = CARD
    size: Annotated[float, Parameter("N", 0.0, 100.0)] = 0.0

    def on_reading(self, force, load_case):
        pulled = self.size * (load_case.at.load / 80.0) ** 3
        return replace(force, drawbar_pull=force.drawbar_pull - pulled)


def report_of(*effects, seed=0):
    """The report on rows with hidden effects, by an analysis that knows none."""
    case = case_of()
    table = driven(case, effects, seed=seed)
    return gap(case, table, effects={})


@pytest.mark.slow
def test_a_weaker_soil_at_high_slip_is_a_change_of_the_shear_stress():
    found = report_of(Shaken(size=0.25)).remainder_cause
    assert found.stage == "shear stress"
    assert found.depends_on == "slip"
    assert IN_CATALOGUE * 10.0 / 11.0 < found.probability <= IN_CATALOGUE
    assert found.predictive_gain > 0.0
    assert "torque" in found.channels


@pytest.mark.slow
def test_a_force_of_one_channel_is_stated_as_such():
    report = report_of(Cable(size=6.0))
    assert report.remainder_cause.stage == "drawbar_pull"
    assert "an error of the drawbar pull alone" in str(report.remainder_cause.remark())
    (left,) = [line.text for line in report.lines if line.code == "left"]
    assert report.remainder_cause.remark().text in left and not report.remainder_cause.beside
    assert report.as_json()["remainder_cause"]["stage"] == "drawbar_pull"


@pytest.mark.slow
def test_nothing_is_stated_where_there_is_no_gap():
    assert report_of().remainder_cause is None


def test_nothing_is_stated_of_one_channel():
    case = case_of()
    table = driven(case, [Shaken(size=0.25)])
    alone = {k: v for k, v in table.columns.items() if k not in ("drawbar_pull_N", "sinkage_m")}
    assert gap(case, alone, effects={}).remainder_cause is None


def test_the_signature_of_a_larger_normal_stress_is_that_of_a_stiffer_soil():
    case = case_of()
    readings = stack_readings(case, driven(case))
    changes = {(c.stage, c.what, c.along): c.columns for c in stage_changes(case, readings)}
    (stiff,) = changes["normal stress", "its size", ""].T
    stiffer = case.with_values({"kc": 1.05 * case.soil.kc, "kphi": 1.05 * case.soil.kphi})
    y, y_stiffer = (predict(c, [], np.zeros((1, 0)), readings)[0] for c in (case, stiffer))
    # a step of half the reference size of 10 %
    expected = (y_stiffer - y) / 0.5
    assert stiff / readings.std == pytest.approx(expected / readings.std, rel=1e-4, abs=2e-3)


def test_changes_along_the_contact_make_up_the_change_of_the_whole():
    """The functions of depth overlap to a nearly constant sum, of 2.5 as their width has it."""
    case = case_of()
    readings = stack_readings(case, driven(case))
    changes = {(c.stage, c.along): c.columns for c in stage_changes(case, readings)}
    by_depth = changes["normal stress", "depth"]
    whole = changes["normal stress", ""][:, 0] * np.sqrt(2.0 * np.pi)
    deep = (readings.channel == 0) & (readings.load < 100.0)
    assert by_depth.sum(axis=1)[deep] == pytest.approx(whole[deep], rel=0.15)


def test_changes_of_a_wheel_are_not_those_of_a_track():
    case = case_of()
    track = replace(case, model=Model(Track(radius=0.1, width=0.12, base=0.6)))
    stages = {c.stage for c in stage_changes(track, stack_readings(track, driven(track)))}
    assert "contact geometry" not in stages
    assert {"normal stress", "shear stress"} <= stages


def hypothesis(stage, value, variable="slip"):
    return Hypothesis(stage, "its size", variable, np.zeros((0, 1)), value)


def test_the_probability_of_a_stage_counts_all_others_and_several_causes():
    """Values are -2 ln p; tempered by a half, 8 ln 10 make a factor of 100."""
    step = 8.0 * np.log(10.0)
    found = [hypothesis("normal stress", 0.0), hypothesis("torque", step)]
    stage, probability = likeliest_stage(step, found)
    assert stage == "normal stress"
    assert probability == pytest.approx(0.25 / (0.25 + 0.0025 + 0.005))
    # of two changes of a stage, each is half as probable before the readings
    both = [hypothesis("normal stress", 0.0), hypothesis("normal stress", 1e3), found[1]]
    assert likeliest_stage(step, both)[1] == pytest.approx(0.125 / (0.125 + 0.0025 + 0.005))
    assert likeliest_stage(0.0, [hypothesis("torque", 50.0)])[1] == 0.0
    assert likeliest_stage(0.0, []) == (SEVERAL, 0.0)


def test_the_sentence_names_stage_dependence_and_channels():
    contact = RemainderCause("contact geometry", "", ("torque", "sinkage"), 0.95, 2.0)
    assert str(contact.remark()) == (
        "The remainder beside the soil alone looks like a change of the contact geometry. Torque "
        "and sinkage share it."
    )
    force = RemainderCause("drawbar_pull", "", ("drawbar_pull",), 0.95, 2.0, ("slope", "camber"))
    assert str(force.remark()) == (
        "The remainder beside slope + camber looks like an error of the drawbar pull alone, of a "
        "force or of its sensor."
    )
    slip = RemainderCause("slip or load", "progress", ("torque",), 0.95, 2.0)
    assert "a slip or load other than the stated one that depends on time." in str(slip.remark())


def test_rows_kept_back_have_their_conditional_density():
    """By one inverse of the whole covariance, as by that of the rows that are left."""
    case = case_of()
    problem = fit_problem(case, driven(case, [Cable(size=6.0)]))
    fit = problem.fit_soil([np.full(len(problem.soil), 0.5)])
    amplitude = np.asarray([1.0, 2.5, 0.4])
    (name, folds), *_ = held_out_folds(problem.readings, 0).items()
    found = log_score(problem, fit, problem.discrepancy, amplitude, {name: folds})[name]
    prior = np.diag(fit.precision + UNIFORM_PRECISION)
    matrix = problem.discrepancy.matrix(amplitude)
    matrix = matrix + fit.derivatives @ np.linalg.inv(prior) @ fit.derivatives.T
    residual, total = problem.readings.measured - fit.prediction, 0.0
    for k in folds.predicted:
        out = folds.fold == k
        gain = matrix[np.ix_(out, ~out)] @ np.linalg.inv(matrix[np.ix_(~out, ~out)])
        left = matrix[np.ix_(out, out)] - gain @ matrix[np.ix_(~out, out)]
        density = multivariate_normal(gain @ residual[~out], left)
        total += density.logpdf(residual[out]) + 0.5 * out.sum() * np.log(2.0 * np.pi)
    assert found == pytest.approx(total, rel=1e-6)
