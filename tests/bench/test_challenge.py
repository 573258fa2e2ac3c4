"""The challenge: what is sealed stays sealed, scores are proper, and bad entries are refused."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from soilml.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import challenge
from challenge import CAUSES, COLUMNS, NONE


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A challenge of two sets: its folder and its truth."""
    folder = tmp_path_factory.mktemp("challenge")
    challenge.make(folder / "blind", folder / "truth.json", count=2)
    return folder / "blind", folder / "truth.json"


@pytest.fixture
def entry(made, tmp_path):
    """A function that writes an entry of equal probabilities, with draws about the readings."""
    truth, rng = json.loads(made[1].read_text()), np.random.default_rng(0)

    def write(name="equal.json", **changed):
        content = {}
        for own, known in truth["sets"].items():
            readings = np.asarray(known["readings"])
            draws = readings + known["noise"] * rng.standard_normal((25, *readings.shape))
            content[own] = {
                "causes": dict.fromkeys(CAUSES, 1.0 / len(CAUSES)),
                "draws": {c: draws[..., i].tolist() for i, c in enumerate(COLUMNS)},
            } | changed
        (tmp_path / name).write_text(json.dumps(content))
        return tmp_path / name

    return write


def test_the_public_folder_has_no_truth(made):
    folder, sealed = made
    truth, public = (
        json.loads(sealed.read_text()),
        json.loads((folder / "challenge.json").read_text()),
    )
    texts = "\n".join(path.read_text() for path in folder.rglob("*") if path.is_file())
    assert truth["salt"] not in texts and public["causes"] == list(CAUSES)
    for name, own in truth["sets"].items():
        hidden = {f"{x:.8g}" for row in own["readings"] for x in row}
        lines = (folder / name / "held_out.csv").read_text()
        assert not {*lines.splitlines()[0].split(",")} & {*COLUMNS, "time_s"}
        assert not hidden & set(lines.replace("\n", ",").split(","))
        assert own["answer"] in CAUSES


def test_entries_are_scored_and_the_first_is_compared_with_the_others(made, entry):
    text = challenge.score(*made, [entry(), entry("again.json")])
    assert f"{-np.log(len(CAUSES)):.2f}" in text and "Differences to equal" in text


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"causes": {NONE: 1.0}}, "the least is nan"),
        ({"causes": dict.fromkeys(CAUSES, 0.5)}, "a sum of 1"),
        ({"draws": {c: [[0.0]] * 25 for c in COLUMNS}}, "finite draws"),
        ({"draws": {}}, "finite draws"),
    ],
)
def test_a_wrong_entry_is_refused_in_one_line(changed, said, made, entry):
    with pytest.raises(InputError, match=said) as error:
        challenge.score(*made, [entry(**changed)])
    assert "\n" not in str(error.value) and "equal.json, set s01" in str(error.value)


def test_a_truth_or_a_set_that_was_changed_is_refused(made, entry, tmp_path):
    folder, sealed = made
    other = tmp_path / "truth.json"
    other.write_text(sealed.read_text().replace("salt", "sugar"))
    with pytest.raises(InputError, match="was changed"):
        challenge.score(folder, other, [entry()])
    runs = folder / "s01/runs.csv"
    before = runs.read_text()
    runs.write_text(before + "\n")
    with pytest.raises(InputError, match=r"s01.runs.csv was changed"):
        challenge.score(folder, sealed, [entry()])
    runs.write_text(before)


def test_the_true_distribution_has_the_best_expected_crps():
    rng = np.random.default_rng(1)
    readings, mean = rng.standard_normal(4000), {}
    for shift, scale in ((0.0, 1.0), (0.5, 1.0), (0.0, 0.5), (0.0, 2.0)):
        draws = shift + scale * rng.standard_normal((40, 4000))
        mean[shift, scale] = float(challenge.crps(draws, readings).mean())
    assert min(mean, key=mean.__getitem__) == (0.0, 1.0)
    assert mean[0.0, 1.0] == pytest.approx(1.0 / np.sqrt(np.pi), abs=0.02)  # Gneiting et al. 2005
