"""The challenge: what is sealed stays sealed, scores are proper, and bad entries are refused."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from datagen.blind_sets import draw_blind_set, draw_plan
from datagen.challenge import Challenge, Entry, Truth, bootstrap, crps, make_challenge, score
from datagen.challenge.challenge_files import COLUMNS, LEAST_PROBABILITY, NONE, UNKNOWN
from datagen.challenge.house_entries import house_entry, regression_draws, stated
from datagen.challenge.linear_entries import gap_probabilities
from datagen.challenge.sealing import DEFAULT_TIERS, answer_of
from soilml.cli import main
from soilml.gap.report.results import GapReport

METHODS = ("gap", "stepwise", "lasso", "gp")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A challenge of two sets, as its command writes it: folder and truth."""
    folder = tmp_path_factory.mktemp("challenge")
    words = ["challenge", "make", str(folder / "blind"), "--truth", str(folder / "truth.json")]
    assert main([*words, "--sets", "2", "--seed", "3"]) == 0
    return folder / "blind", folder / "truth.json"


@pytest.fixture(scope="module")
def challenge(made):
    return Challenge.read(made[0])


@pytest.fixture(scope="module")
def truth(made, challenge):
    return Truth.read(made[1], challenge)


@pytest.fixture(scope="module")
def entry(challenge, truth):
    """An entry of equal probabilities, with draws about the readings."""
    rng = np.random.default_rng(0)
    equal = stated({}, challenge.causes)
    draws = {
        name: readings + truth.noise[name] * rng.standard_normal((25, *readings.shape))
        for name, readings in truth.readings.items()
    }
    return Entry("equal", dict.fromkeys(challenge.rows, equal), draws)


def test_the_public_folder_has_no_truth(made):
    """No name, soil, reading kept back, plan, salt or seed of the truth is in a public file."""
    folder, sealed = made
    truth = json.loads(sealed.read_text())
    texts = {path: path.read_text() for path in folder.rglob("*") if path.is_file()}
    every = "\n".join(texts.values())
    assert truth["salt"] not in every
    for name, own in truth["sets"].items():
        of_set = "\n".join(text for path, text in texts.items() if path.parent.name == name)
        numbers = {float(x) for x in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", of_set)}
        assert str(own["plan"]["seed"]) not in every
        assert not re.search(r"grouser|sinkage-|gain|offset|unknown|none", of_set)
        hidden = [x for values in own["readings"].values() for x in values]
        assert not numbers & {float(f"{x:.8g}") for x in hidden}
        changed = [own["soil"][key] for key in ("cohesion", "friction_angle", "shear_modulus")]
        assert not numbers & {float(f"{x:.6g}") for x in changed}
        header = (folder / name / "held_out.csv").read_text().splitlines()[0].split(",")
        assert not {*header} & {*COLUMNS, "time_s"}


def test_without_a_seed_no_two_challenges_or_salts_are_alike():
    one, other = (make_challenge(1, ("N0",)) for _ in range(2))
    assert one.public["s1/runs.csv"] != other.public["s1/runs.csv"]
    assert json.loads(one.truth)["salt"] != json.loads(other.truth)["salt"]
    assert json.loads(one.truth)["sets"]["s1"]["plan"]["seed"] > 2**64


def test_the_same_seed_makes_the_same_challenge():
    assert make_challenge(1, seed=3) == make_challenge(1, seed=3)


def test_answers_are_of_the_list_and_the_truth_is_what_the_plan_simulates(made):
    content = json.loads(made[1].read_text())
    for own in content["sets"].values():
        assert own["answer"] in content["causes"]
    plans = [draw_plan(DEFAULT_TIERS, seed) for seed in range(200)]
    assert {plan.tier for plan in plans} == set(DEFAULT_TIERS)
    assert all((plan.discrepancy == 0.0) >= plan.tier.startswith("N") for plan in plans)
    assert all(plan.discrepancy > 0.0 for plan in plans if plan.tier == "D")
    answers = {
        p.tier: answer_of(p, draw_blind_set(p).truth["causes"])
        for p in {plan.tier: plan for plan in plans}.values()
    }
    assert answers["N0"] == answers["N1"] == NONE
    assert answers["D"] == UNKNOWN
    assert answers["S"] not in (NONE, UNKNOWN)


def test_the_true_distribution_has_the_best_expected_crps():
    rng = np.random.default_rng(1)
    readings = rng.standard_normal(4000)
    mean = {}
    for shift, scale in ((0.0, 1.0), (0.5, 1.0), (0.0, 0.5), (0.0, 2.0)):
        draws = shift + scale * rng.standard_normal((40, 4000))
        mean[shift, scale] = float(crps(draws, readings).mean())
    assert min(mean, key=mean.__getitem__) == (0.0, 1.0)
    assert mean[0.0, 1.0] == pytest.approx(1.0 / np.sqrt(np.pi), abs=0.02)  # Gneiting et al. 2005


def test_the_crps_does_not_depend_on_the_number_or_order_of_draws():
    rng = np.random.default_rng(2)
    draws, readings = rng.standard_normal((2000, 300)), rng.standard_normal(300)
    few = np.mean([crps(part, readings).mean() for part in np.split(draws, 100)])
    assert few == pytest.approx(float(crps(draws, readings).mean()), abs=0.01)
    mixed = draws[rng.permutation(len(draws))]
    np.testing.assert_allclose(crps(mixed, readings), crps(draws, readings), rtol=1e-9)


def test_the_true_probabilities_have_the_best_expected_score(challenge, truth, entry):
    """Answers drawn from known probabilities, scored for these and for distorted ones."""
    rng = np.random.default_rng(4)
    p = stated({NONE: 0.5, UNKNOWN: 0.3, "grousers": 0.2}, challenge.causes)
    flat, sharp = (x / x.sum() for x in (np.sqrt(p), p**2 + LEAST_PROBABILITY))
    means = []
    drawn = rng.choice(challenge.causes, size=(300, 2), p=p)
    for own in (p, flat, sharp):
        one = replace(entry, probabilities=dict.fromkeys(challenge.rows, own))
        of = [replace(truth, answer=dict(zip(challenge.rows, pair, strict=True))) for pair in drawn]
        means.append(np.mean([score(challenge, t, one).by_set["causes"].mean() for t in of]))
    assert means[0] > max(means[1:])


def test_rows_in_another_order_have_another_score(challenge, truth, entry):
    turned = replace(entry, draws={n: d[:, ::-1] for n, d in entry.draws.items()})
    right, wrong = (score(challenge, truth, own).by_set for own in (entry, turned))
    assert all((right[c] < wrong[c]).all() for c in COLUMNS)
    shuffled = replace(entry, draws={n: d[::-1] for n, d in entry.draws.items()})
    for c in COLUMNS:
        np.testing.assert_allclose(score(challenge, truth, shuffled).by_set[c], right[c])


def test_intervals_cover_the_mean_as_often_as_stated():
    rng = np.random.default_rng(5)
    ends = [bootstrap(rng.standard_normal(40))[1:] for _ in range(200)]
    assert 0.82 < np.mean([low < 0.0 < high for low, high in ends]) < 0.96


def test_draws_of_a_regression_have_the_known_mean_and_spread():
    """One weight of unit prior, seen once with unit noise: N(r / 2, 1 / 2), and noise on top."""
    columns, runs = np.ones((2, 1)), np.asarray([True, False])
    rng = np.random.default_rng(6)
    draws = regression_draws(columns, np.asarray([2.0, 0.0]), np.ones(2), runs, 40000, rng)
    assert draws.mean() == pytest.approx(1.0, abs=0.03)
    assert draws.var() == pytest.approx(1.5, abs=0.05)


def test_a_report_without_a_gap_leaves_its_probability_to_none():
    quiet = GapReport("no-gap", "", None, probabilities={"grousers": 0.1}, gap_probability=0.4)
    assert gap_probabilities(quiet)[NONE] == pytest.approx(0.9)
    seen = replace(quiet, status="unknown", gap_probability=0.9999)
    assert gap_probabilities(seen)[UNKNOWN] > 0.89
    crowded = replace(seen, probabilities=dict.fromkeys(("grousers", "rate", "slope"), 0.9))
    assert sum(gap_probabilities(crowded).values()) == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_entries_of_the_house_are_valid_and_repeatable(method, made, challenge, truth, tmp_path):
    out = tmp_path / "a.json"
    words = ["challenge", "enter", str(made[0]), "--method", method, "--out", str(out)]
    assert main(words) == 0
    read = Entry.read(out, challenge)
    assert house_entry(challenge, method, 0).as_json(challenge) == json.loads(out.read_text())
    assert all(np.isfinite(v).all() for v in score(challenge, truth, read).by_set.values())


@pytest.mark.slow
def test_simulation_based_inference_enters_where_it_is_installed(made, tmp_path, capsys):
    words = ["challenge", "enter", str(made[0]), "--method", "sbi"]
    try:
        import sbi  # noqa: F401
    except ImportError:
        assert main([*words, "--out", str(tmp_path / "e.json")]) == 2
        assert "pip install 'soilml[sbi]'" in capsys.readouterr().err
        return
    import datagen.challenge.simulation_entry as entries
    from datagen.challenge.house_entries import SetData

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(entries, "OF_CAUSE", 10)
        patch.setattr(entries, "RATIO_EPOCHS", 2)
        patch.setattr(entries, "FLOW_EPOCHS", 2)
        data = SetData.read(made[0] / "s1", Challenge.read(made[0]))
        answer = entries.simulation_entry(data, 0)
    assert set(answer.causes) <= set(data.causes)
    assert answer.draws.shape == (100, len(data.held), len(COLUMNS))
    assert np.isfinite(answer.draws).all()


def _without_set(content):
    del content["sets"]["s2"]


def _nan(content):
    content["sets"]["s1"]["draws"]["sinkage_m"][0][0] = float("nan")


def _sum(content):
    content["sets"]["s1"]["causes"]["none"] += 0.1


def _unknown_cause(content):
    content["sets"]["s1"]["causes"]["grouser"] = 0.1


def _zero(content):
    content["sets"]["s1"]["causes"]["none"] = 0.0


def _shape(content):
    content["sets"]["s1"]["draws"]["torque_Nm"] = [[1.0, 2.0]] * 25


def _ragged(content):
    content["sets"]["s1"]["draws"]["torque_Nm"][3].pop()


def _few(content):
    content["sets"]["s1"]["draws"] = {c: v[:5] for c, v in content["sets"]["s1"]["draws"].items()}


def _other(content):
    content["challenge"] = "0" * 16


def _text(content):
    content["sets"]["s1"]["causes"]["none"] = "much"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_without_set, "s2 is missing"),
        (_nan, "set s1: sinkage_m: a value is NaN"),
        (_sum, "sum to 1.1, not to 1"),
        (_unknown_cause, "did you mean 'grousers'"),
        (_zero, "the probability of none is 0"),
        (_shape, r"torque_Nm has the shape \(25, 2\)"),
        (_ragged, "differ in their number of rows"),
        (_few, "20 or more draws of 48 rows"),
        (_other, "is for challenge '0000000000000000'"),
        (_text, "something is not a number"),
    ],
)
def test_a_wrong_entry_is_one_line_and_status_2(
    spoil, said, made, challenge, entry, tmp_path, capsys
):
    content = entry.as_json(challenge)
    path = tmp_path / "entry.json"
    path.write_text(json.dumps(content))
    words = ["challenge", "score", *map(str, made), str(path)]
    assert main(words) == 0
    spoil(content)
    path.write_text(json.dumps(content))
    capsys.readouterr()
    assert main([*words, "--json", str(tmp_path / "s.json")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(said, line)
    assert not (tmp_path / "s.json").exists()


def test_a_changed_truth_or_set_is_refused(made, challenge, entry, tmp_path, capsys):
    folder, sealed = made
    path, changed = tmp_path / "entry.json", tmp_path / "truth.json"
    path.write_text(json.dumps(entry.as_json(challenge)))
    changed.write_text(sealed.read_text().replace('"answer": "', '"answer": "x', 1))
    assert main(["challenge", "score", str(folder), str(changed), str(path)]) == 2
    assert "it was changed, or belongs to another challenge" in capsys.readouterr().err
    runs = folder / "s1" / "runs.csv"
    before = runs.read_text()
    try:
        runs.write_text(before + before.splitlines()[-1] + "\n")
        assert main(["challenge", "score", str(folder), str(sealed), str(path)]) == 2
        assert "was changed since the challenge was made" in capsys.readouterr().err
    finally:
        runs.write_text(before)


def test_scores_are_written_with_differences_to_the_first(made, challenge, entry, tmp_path, capsys):
    sharp = replace(
        entry,
        name="late",
        draws={n: d + 1.0 for n, d in entry.draws.items()},
    )
    paths = []
    for own in (entry, sharp):
        paths.append(tmp_path / f"{own.name}.json")
        paths[-1].write_text(json.dumps(own.as_json(challenge)))
    out = tmp_path / "scores.json"
    assert main(["challenge", "score", *map(str, (*made, *paths)), "--json", str(out)]) == 0
    assert "Differences to equal, paired by set." in capsys.readouterr().out
    first, second = json.loads(out.read_text())["entries"]
    assert first["minus_first"]["torque_Nm"] == {"mean": 0.0, "p05": 0.0, "p95": 0.0}
    assert second["minus_first"]["torque_Nm"]["p05"] > 0.0
    assert second["minus_first"]["causes"]["mean"] == 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--truth", "{blind}/truth.json"], "which entrants get"),
        ([], "--truth is missing"),
        (["--truth", "{folder}/new.json", "--tiers", "A,Z"], "no tier 'Z'"),
        (["--truth", "{folder}/old.json"], "could not be scored without it"),
    ],
)
def test_a_challenge_that_cannot_be_made_writes_nothing(words, said, tmp_path, capsys):
    (tmp_path / "old.json").write_text("{}")
    blind = tmp_path / "blind"
    filled = [word.format(blind=blind, folder=tmp_path) for word in words]
    assert main(["challenge", "make", str(blind), *filled]) == 2
    assert said in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["old.json"]
