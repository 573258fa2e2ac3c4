"""[remainder] of a model file: read, written, refused; its mean and variance; where it is used."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MODEL

from soilml import Operating, identify, read_case, simulate
from soilml.cli import main
from soilml.config.remainder import Remainder, RemainderPart
from soilml.config.write_case import case_as_toml
from soilml.errors import InputError
from soilml.fitting.coordinates import select_free
from soilml.fitting.predictions import linearise, predict
from soilml.fitting.readings import Readings

POINTS = ((0.1, 40.0), (0.5, 40.0), (0.3, 100.0))


def part(column="torque_Nm", gear="", **changed):
    own = RemainderPart(
        column=column,
        gear=gear,
        amplitude=0.2,
        usual=0.3,
        slip_length=0.3,
        log_load_length=0.6,
        slip=(0.1, 0.5),
        load=(40.0, 100.0),
        points=POINTS,
        mean=(1.0, -0.5, 0.25),
        known=((0.9, 0.0), (0.1, 0.7), (0.0, 0.3)),
        shared=((0.1,), (0.2,), (0.0,)),
    )
    return replace(own, **changed)


@pytest.fixture
def case(model_file):
    return replace(read_case(model_file), remainder=Remainder((part(),)))


def test_it_is_written_and_read_to_the_last_digit(case, tmp_path):
    again = tmp_path / "model.toml"
    again.write_text(case_as_toml(case))
    assert read_case(again) == case and read_case(again).remainder == case.remainder


def test_mean_and_variance_are_those_of_the_conditional_process():
    """Rasmussen and Williams, eqs. 2.25 and 2.26, for three readings without a model."""
    own = part(usual=0.1)
    z, noise = own.scaled(*np.asarray(POINTS).T), 0.05
    correlation = np.exp(-0.5 * ((z[:, None] - z) ** 2).sum(axis=-1))
    reading = np.asarray([0.3, -0.1, 0.2])
    white = 0.2 * np.linalg.cholesky(correlation) / noise
    spread = np.linalg.inv(np.eye(3) + white.T @ white)
    value, vector = np.linalg.eigh(np.eye(3) - spread)
    own = replace(
        own,
        mean=tuple(spread @ white.T @ (reading / noise)),
        known=tuple(map(tuple, vector * np.sqrt(value))),
    )
    slip, load = np.asarray([0.2, 0.45, 0.5]), np.asarray([50.0, 90.0, 100.0])
    at = own.scaled(slip, load)
    between = 0.04 * np.exp(-0.5 * ((at[:, None] - z) ** 2).sum(axis=-1))
    gain = between @ np.linalg.inv(0.04 * correlation + noise**2 * np.eye(3))
    mean, std = own.mean_and_std(slip, load)
    np.testing.assert_allclose(mean, gain @ reading, atol=1e-12)
    np.testing.assert_allclose(std**2, 0.04 - (gain * between).sum(axis=1), atol=1e-12)
    columns = own.columns(slip, load, fitted_anew=False)
    np.testing.assert_allclose((columns**2).sum(axis=1), std**2, atol=1e-9)


def test_outside_the_range_the_mean_fades_and_the_error_becomes_a_usual_one():
    own = part()
    for far in ((0.9, 5000.0), (-0.9, 0.5)):
        mean, std = own.mean_and_std(*(np.asarray([v]) for v in far))
        assert abs(mean[0]) < 1e-3
        assert std[0] == pytest.approx(0.3, rel=1e-2)
        columns = own.columns(*(np.asarray([v]) for v in far), fitted_anew=True)
        assert (columns**2).sum() == pytest.approx(0.09, rel=1e-2)
    small = replace(own, usual=0.1)  # an error that was larger than a usual one stays so
    std = small.mean_and_std(np.asarray([0.9]), np.asarray([5000.0]))[1]
    assert std[0] == pytest.approx(0.2, rel=1e-4)


@pytest.mark.parametrize("by_slip", [True, False])
def test_beyond_the_range_the_mean_only_falls_and_the_error_only_grows(by_slip):
    """A process that was fitted to rows rings beyond them: here the mean keeps its sign."""
    own = part(mean=(3.0, -3.0, 3.0))
    far = np.linspace(0.0, 4.0, 40)
    slip = 0.5 + 0.3 * far if by_slip else np.full(40, 0.3)
    load = np.full(40, 60.0) if by_slip else 40.0 * np.exp(-0.6 * far)
    mean, std = own.mean_and_std(slip, load)
    assert np.all(np.diff(np.abs(mean)) <= 0.0) and np.all(mean * mean[0] >= 0.0)
    assert np.all(np.diff(std) >= 0.0) and std[-1] == pytest.approx(0.3, rel=0.1)


def test_columns_have_the_covariance_of_the_process_given_the_points():
    """Rasmussen and Williams, eq. 2.19: what weights on the points leave is a process too."""
    own = part(usual=0.1)
    slip, load = np.asarray([0.15, 0.3, 0.42, 0.5]), np.asarray([50.0, 95.0, 70.0, 40.0])
    at = own.scaled(slip, load)
    prior = np.exp(-0.5 * ((at[:, None] - at) ** 2).sum(axis=-1))
    psi, known = own.functions(slip, load), np.asarray(own.known)
    expected = 0.04 * (prior - psi @ known @ known.T @ psi.T)
    columns = own.columns(slip, load, fitted_anew=False)
    np.testing.assert_allclose(columns @ columns.T, expected, atol=1e-9)


@pytest.mark.parametrize("ends", [((0.05, 0.6), (30.0, 120.0)), ((-0.3, 0.9), (20.0, 400.0))])
def test_functions_of_its_error_have_the_same_covariance(ends):
    """Beyond the range too, where the edge of the larger error is a kink."""
    (low, high), (light, heavy) = ends
    functions = Remainder((part(),)).error_functions("torque", *ends)
    u = np.random.default_rng(0).random((90, 2))
    slip, load = low + (high - low) * u[:, 0], light * (heavy / light) ** u[:, 1]
    columns, found = part().columns(slip, load, fitted_anew=True), functions.at(slip, load)
    difference = (found @ found.T - columns @ columns.T) / 0.3**2
    assert np.sqrt(np.mean(difference**2)) < 0.01


def test_predictions_and_simulated_rows_have_the_mean(case):
    slip, load = np.asarray([0.1, 0.3, 0.5]), np.full(3, 60.0)
    bare = case.model(case.soil, Operating(slip=slip, load=load))
    mean, std = case.remainder.mean_and_std("torque", slip, load)
    rows = simulate(case, slip, load, with_std=True)
    np.testing.assert_allclose(rows["torque_Nm"], bare.torque + mean, rtol=1e-9)
    np.testing.assert_allclose(rows["drawbar_pull_N"], bare.drawbar_pull, rtol=1e-9)
    np.testing.assert_array_equal(rows["torque_Nm_std"], std)
    readings = Readings.of_every_row(Operating(slip=slip, load=load))
    y = predict(case, [], np.zeros((1, 0)), readings)[0]
    np.testing.assert_allclose(y[:3], bare.torque + mean, rtol=1e-6)
    free = select_free(case, None)
    x = np.full(len(free), 0.5)
    plain = linearise(replace(case, remainder=None), free, x, readings)
    found = linearise(case, free, x, readings)
    np.testing.assert_allclose(found.prediction[:3] - plain.prediction[:3], mean, atol=1e-9)
    np.testing.assert_allclose(found.jacobian, plain.jacobian, rtol=1e-6, atol=1e-6)


MISTAKES = {
    "another version": ("format = 1", "format = 2", "reads 1"),
    "no version": ("format = 1", "", "format is missing"),
    "another channel": ('"torque_Nm"', '"torque"', "column is 'torque'"),
    "another gear": ("amplitude = ", 'gear = "lugged"\namplitude = ', "gear is 'lugged'"),
    "no number": ("mean = [1.0", "mean = [nan", "finite"),
    "infinite": ("amplitude = 0.2", "amplitude = inf", "it must lie"),
    "negative": ("usual = 0.3", "usual = -0.3", "it must lie"),
    "too few weights": ("mean = [1.0, ", "mean = [", "mean has 2 rows"),
    "rows that differ": ("[0.1, 0.7]", "[0.1]", "differ in length"),
    "more than is known": ("[0.9, 0.0]", "[1.9, 0.0]", "negative"),
    "a point twice": ("[0.5, 40.0]", "[0.1, 40.0]", "too near"),
    "a load of zero": ("[0.5, 40.0]", "[0.5, 0.0]", "pairs"),
    "a range upside down": ("slip = [0.1, 0.5]", "slip = [0.5, 0.1]", "[smallest, largest]"),
    "an unknown key": ("usual = ", "usuel = 1.0\nusual = ", "unknown key 'usuel'"),
    "a word for a list": ("mean = [1.0, -0.5, 0.25]", 'mean = "x"', "needed is a list"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_a_damaged_section_is_refused_in_one_line(case, tmp_path, what, capsys):
    right, wrong, said = MISTAKES[what]
    text = case_as_toml(case)
    assert right in text
    (tmp_path / "wrong.toml").write_text(text.replace(right, wrong, 1))
    with pytest.raises(InputError) as refused:
        read_case(tmp_path / "wrong.toml")
    assert said in str(refused.value)
    command = ["simulate", str(tmp_path / "wrong.toml"), "--slip", "0.1", "--load", "60"]
    assert main(command) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_an_empty_section_is_refused(model_file):
    model_file.write_text(MODEL + "[remainder]\nformat = 1\n")
    with pytest.raises(InputError, match="needed are 1 to"):
        read_case(model_file)


def test_the_command_writes_the_error_where_it_is_asked_for(case, model_file, tmp_path, capsys):
    (tmp_path / "learned.toml").write_text(case_as_toml(case))
    command = ["simulate", str(tmp_path / "learned.toml"), "--slip", "0.1,0.3", "--load", "60"]
    assert main(command) == 0
    assert "+-" not in capsys.readouterr().out
    assert main([*command, "--std"]) == 0
    assert "+-" in capsys.readouterr().out
    assert main([command[0], str(model_file), *command[2:], "--std"]) == 2
    assert "has no [remainder]" in capsys.readouterr().err


def test_identify_leaves_it_out_for_the_rows_that_it_was_learned_from(case):
    slip, load = np.tile([0.1, 0.2, 0.3, 0.4], 3), np.repeat([40.0, 70.0, 100.0], 4)
    rows, others = (simulate(case, slip, load, seed=seed) for seed in (1, 2))
    learned = replace(case, remainder=case.remainder.of_rows(rows))
    assert learned.remainder.learned_from(rows.rows(np.asarray([7, 2])))
    assert not learned.remainder.learned_from(others)
    assert not case.remainder.learned_from(rows)

    def fitted(own, table):
        fit = identify(own, table, ["friction_angle"], "nonlinear")
        return fit["friction_angle"], "same-rows" in [one.code for one in fit.warnings]

    without = replace(case, remainder=None)
    assert fitted(learned, rows) == (fitted(without, rows)[0], True)
    assert fitted(learned, others) == (fitted(case, others)[0], False)
    assert fitted(without, others)[0] != fitted(case, others)[0]
