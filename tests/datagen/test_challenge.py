"""The challenge: what is sealed stays sealed, scores are proper, and bad entries are refused."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from datagen.challenge import Challenge, Entry, Truth, crps, score
from datagen.challenge.challenge_files import COLUMNS, LEAST_PROBABILITY, NONE, UNKNOWN
from datagen.challenge.house_entries import stated
from soilml.cli import main


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


def test_the_true_distribution_has_the_best_expected_crps():
    rng = np.random.default_rng(1)
    readings = rng.standard_normal(4000)
    mean = {}
    for shift, scale in ((0.0, 1.0), (0.5, 1.0), (0.0, 0.5), (0.0, 2.0)):
        draws = shift + scale * rng.standard_normal((40, 4000))
        mean[shift, scale] = float(crps(draws, readings).mean())
    assert min(mean, key=mean.__getitem__) == (0.0, 1.0)
    assert mean[0.0, 1.0] == pytest.approx(1.0 / np.sqrt(np.pi), abs=0.02)  # Gneiting et al. 2005


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
