"""Scores of signatures: what is projected off, what chance does, what a planted effect does."""

import numpy as np
import pytest

from soilml.gap.evidence.score_test import ScoreTest, score_test
from soilml.numerics.subspaces import project_out


def family(seed=1, readings=40, space=3, columns=12):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((readings, columns)), rng.standard_normal((readings, space))


def test_what_is_outside_a_space_is_at_right_angles_to_it():
    columns, space = family()
    beyond = project_out(columns, space)
    np.testing.assert_allclose(space.T @ beyond, 0.0, atol=1e-12)
    np.testing.assert_allclose(project_out(beyond, space), beyond, atol=1e-12)
    np.testing.assert_allclose(project_out(space @ np.ones((3, 2)), space), 0.0, atol=1e-12)


def test_projection_onto_empty_and_degenerate_spaces():
    columns, space = family()
    np.testing.assert_array_equal(project_out(columns, np.zeros((40, 0))), columns)
    twins = np.column_stack([space, space])
    np.testing.assert_allclose(project_out(columns, twins), project_out(columns, space), atol=1e-9)


@pytest.mark.parametrize("columns", [12, 60])
def test_p_values_of_pure_noise_are_uniform(columns):
    """Kolmogorov-Smirnov at 200 draws; 0.115 is the 1 % point. More columns than readings, too."""
    rng = np.random.default_rng(7)
    known, space = family(columns=columns)
    signs = np.where(np.arange(columns) % 3, 0.0, 1.0)
    found = score_test(rng.standard_normal(40), known, space, signs, 1e9, 0)
    beyond = project_out(known, space)
    unit = beyond / np.linalg.norm(beyond, axis=0)
    z = rng.standard_normal((200, 40)) @ unit
    largest = np.where(signs == 0, np.abs(z), signs * z).max(axis=1)
    p = np.sort([found.p_value(float(value)) for value in largest])
    even = np.arange(200) / 200
    assert max(np.abs(p - even).max(), np.abs(p - even - 1 / 200).max()) < 0.115


def test_estimated_noise_raises_the_p_value_of_large_scores():
    known, space = family()
    residual = np.random.default_rng(0).standard_normal(40)
    sure, unsure = (score_test(residual, known, space, np.zeros(12), f, 0) for f in (1e9, 8.0))
    assert unsure.p_value(4.0) > 2.0 * sure.p_value(4.0)


def test_a_planted_column_has_the_largest_score():
    known, space = family()
    beyond = project_out(known, space)
    rng = np.random.default_rng(3)
    residual = rng.standard_normal(40) + 8.0 * beyond[:, 4] / np.linalg.norm(beyond[:, 4])
    found = score_test(residual, known, space, np.zeros(12), 1e9, 0)
    assert int(np.argmax(found.z)) == 4
    assert found.z[4] == pytest.approx(8.0, abs=3.5)
    assert found.family_wise_p < 0.001
    np.testing.assert_allclose(found.projected_norm, np.linalg.norm(beyond, axis=0))


def test_a_column_of_one_sign_has_no_score_on_the_other_side():
    known, space = family()
    beyond = project_out(known, space)[:, :1]
    residual = -6.0 * beyond[:, 0] / np.linalg.norm(beyond)
    for sign, expected in ((1.0, -6.0), (-1.0, 6.0), (0.0, 6.0)):
        found = score_test(residual, known[:, :1], space, np.asarray([sign]), 1e9, 0)
        assert found.z[0] == pytest.approx(expected)
    up = score_test(residual, known[:, :1], space, np.ones(1), 1e9, 0)
    assert up.family_wise_p > 0.9


def test_a_column_that_the_soil_absorbs_scores_nothing():
    known, space = family()
    known[:, 0] = space @ np.asarray([1.0, -2.0, 0.5])
    found = score_test(100.0 * known[:, 0], known, space, np.zeros(12), 1e9, 0)
    assert found.z[0] == 0.0 and found.projected_norm[0] == 0.0
    assert found.absorbed[0] == pytest.approx(1.0)
    assert np.all((found.absorbed >= 0.0) & (found.absorbed <= 1.0 + 1e-12))


def test_the_same_seed_gives_the_same_level():
    known, space = family()
    one, two, other = (
        score_test(known[:, 0], known, space, np.zeros(12), 20.0, s) for s in (5, 5, 6)
    )
    np.testing.assert_array_equal(one.null_maxima, two.null_maxima)
    assert not np.array_equal(one.null_maxima, other.null_maxima)


def test_without_columns_the_p_value_is_one():
    none = score_test(np.ones(10), np.zeros((10, 0)), np.zeros((10, 0)), np.zeros(0), 5.0, 0)
    assert none.family_wise_p == 1.0


def test_a_p_value_counts_the_score_itself_among_the_draws():
    test = ScoreTest(np.zeros(0), np.asarray([1.0, 2.0, 3.0, 4.0]), np.zeros(0), np.zeros(0))
    assert test.p_value(2.5) == pytest.approx(3.0 / 5.0)
    assert test.p_value(4.0) == pytest.approx(2.0 / 5.0)
    assert test.p_value(4.1) == pytest.approx(1.0 / 5.0)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_scores_do_not_depend_on_the_unit_of_a_column(scale):
    columns, space = family()
    residual = np.random.default_rng(3).standard_normal(40)
    signs = np.asarray([1.0, -1.0, *np.zeros(10)])
    usual = score_test(residual, columns, space, signs, 30.0, 0)
    found = score_test(residual, scale * columns, space, signs, 30.0, 0)
    assert found.z == pytest.approx(usual.z) and found.absorbed == pytest.approx(usual.absorbed)
    assert found.projected_norm == pytest.approx(scale * usual.projected_norm)
    assert found.family_wise_p == usual.family_wise_p


@pytest.mark.parametrize("left, testable", [(2e-4, True), (0.5e-4, False)])
def test_a_column_of_which_a_ten_thousandth_is_left_can_be_tested(left, testable):
    space = np.eye(6)[:, :1]
    column = 1e3 * (np.eye(6)[:, 0] + left * np.eye(6)[:, 1])[:, None]
    found = score_test(np.full(6, 2.0), column, space, np.zeros(1), 9.0, 0)
    assert found.z == pytest.approx([2.0 if testable else 0.0])
    assert found.projected_norm == pytest.approx([1e3 * left if testable else 0.0])
