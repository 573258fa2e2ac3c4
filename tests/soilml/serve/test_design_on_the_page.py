"""The question which wheels climb a slope: its form, and its answer."""

from pathlib import Path

import pytest

from soilml.errors import InputError
from soilml.serve.answers import design


def silent(*stage):
    """Progress that nobody sees."""


def field(answer, label):
    """Number and content of a figure of the form."""
    return next((i, f) for i, f in enumerate(answer["fields"]) if f["label"] == label)


def changed(label, value, text=None):
    """The text of the question after a change of one figure."""
    answer = design.question({"question": text})
    change = {"field": field(answer, label)[0], "value": value}
    return design.question({"question": answer["question"], "change": change})["question"]


@pytest.mark.slow
def test_the_answer_is_that_of_the_command(tmp_path, monkeypatch):
    from soilml import design as designed

    (tmp_path / "read").mkdir()
    monkeypatch.chdir(tmp_path / "read")
    monkeypatch.setitem(design.EFFORTS, "quick", (6, 60))
    text = changed("Slope", 8)
    found = design.answer({"question": text, "effort": "quick"}, silent)
    report = designed("rover.toml", designs=6, draws=60)
    share = f"{100 * report.best['probability']:.0f} %"
    assert share in found["verdict"] and found["met"] == report.met
    assert found["picture"]["image"].startswith("data:image/svg+xml")
    assert found["tables"][0]["title"] == "designs" and found["remarks"]
    assert set(found["files"]) == {"design_report.html", "design.json", "rover.toml"}
    assert (Path("../written") / "rover.toml").read_text() == text


def test_questions_that_the_page_does_not_take(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = design.question({})["question"]
    rows = text[: text.index("[soil]")] + '[soil]\nmodel = "/etc/m.toml"\nruns = "r.csv"\n'
    rows += text[text.index("[goal]") :]
    for model, runs, names, said in (
        (
            "/etc/m.toml",
            "r.csv",
            [],
            "model is '/etc/m.toml'; .* may name MODEL.toml: drop the table",
        ),
        ("/elsewhere/MODEL.toml", "r.csv", ["r.csv"], "may name MODEL.toml, r.csv"),
        ("MODEL.toml", "../r.csv", ["r.csv"], "runs is '../r.csv'"),
        ("MODEL.toml", "/etc/r.csv", ["r.csv"], "runs is '/etc/r.csv'"),
        ("r.csv", "r.csv", ["r.csv"], "needed is model = 'MODEL.toml'"),
    ):
        own = rows.replace("/etc/m.toml", model).replace('"r.csv"', f'"{runs}"')
        with pytest.raises(InputError, match=said):
            design.answer({"question": own, "names": names}, silent)
        Path("rover.toml").unlink()
    with pytest.raises(InputError, match="effort is 'endless'"):
        design.answer({"question": text, "effort": "endless"}, silent)
    Path("rover.toml").unlink()
    with pytest.raises(InputError, match=r"rover.toml \[rover\].*mass is missing"):
        design.answer({"question": text.replace("\nmass =", "\n# mass =")}, silent)
