"""The question which wheels climb a slope: its form, and its answer."""

from importlib.resources import files
from pathlib import Path

import pytest
from served_page import ROOT, runs_file

from soilml.errors import InputError
from soilml.optional_imports import tomllib
from soilml.physics.gears import Wheel
from soilml.physics.model import Model
from soilml.rover_design.study import read_study
from soilml.serve.answers import design
from soilml.serve.answers.chosen_case import model_text


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


def test_the_form_begins_with_the_example():
    packaged = files("soilml.rover_design").joinpath("example.toml").read_text()
    assert packaged == (ROOT / "examples" / "design" / "rover.toml").read_text()
    answer = design.question({})
    assert answer["question"] == packaged
    shown = {f["label"]: f["value"] for f in answer["fields"]}
    assert shown["Width"] == [40, 140] and shown["Slope"] == 15 and shown["Mass"] == [12]
    assert shown["Centre of mass above the ground"] == 180 and shown["Gravity"] == "earth"
    assert shown["Soils, each as likely"][1] == "wang2016/kls1"


@pytest.mark.parametrize(
    ("label", "value", "table", "key", "written"),
    [
        ("Width", [50, 90], "wheel", "width", [0.05, 0.09]),
        ("Width", [60, 60], "wheel", "width", 0.06),
        ("Mass", [8, 8], "rover", "mass", 8),
        ("Centre of mass above the ground", 250, "rover", "centre_of_mass", [0.0, 0.25]),
        ("Gravity", "moon", "rover", "gravity", "moon"),
        ("Slope", 12.5, "goal", "slope", "12.5 deg"),
        ("Risk of failing that is accepted", 20, "goal", "risk", 0.2),
        ("Soils, each as likely", ["mckay1994/jsc-1"], "soil", "names", ["mckay1994/jsc-1"]),
    ],
)
def test_a_figure_is_written_into_the_text(tmp_path, label, value, table, key, written):
    text = changed(label, value)
    before, after = tomllib.loads(design.question({})["question"]), tomllib.loads(text)
    assert after[table][key] == written
    after[table][key] = before[table].get(key)
    before[table].setdefault(key, None)
    assert after == before
    assert "# m, from the first axle to the last" in text
    (tmp_path / "rover.toml").write_text(text)
    read_study(tmp_path / "rover.toml")


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


def test_the_soil_is_that_of_measured_rows_and_of_published_ones_again():
    before = design.question({})["question"]
    text = changed("Soils, each as likely", {"rows": "tests.xlsx#second"}, before)
    content = tomllib.loads(text)
    assert content["soil"] == {"model": "MODEL.toml", "runs": "tests.xlsx#second"}
    others = {k: v for k, v in tomllib.loads(before).items() if k != "soil"}
    assert {k: v for k, v in content.items() if k != "soil"} == others
    answer = field(design.question({"question": text}), "Soils, each as likely")[1]
    assert answer["value"] == [] and answer["rows"] == "tests.xlsx#second"
    again = changed("Soils, each as likely", ["wang2016/kls1"], text)
    assert tomllib.loads(again) == others | {"soil": {"names": ["wang2016/kls1"]}}


@pytest.mark.slow
def test_the_soil_of_measured_rows_is_that_of_the_page(tmp_path, monkeypatch):
    (tmp_path / "read").mkdir()
    monkeypatch.chdir(tmp_path / "read")
    monkeypatch.setitem(design.EFFORTS, "quick", (6, 60))
    runs_file(Path(), Model(Wheel(radius=0.15, width=0.12)))
    case = model_text({})["text"]
    question = changed("Soils, each as likely", {"rows": "RUNS.csv"}, changed("Slope", 8))
    request = {"question": question, "effort": "quick", "names": ["RUNS.csv"], "model": case}
    found = design.answer(request, silent)
    assert set(found["files"]) == {"design_report.html", "design.json", "rover.toml", "MODEL.toml"}
    assert (Path("../written") / "MODEL.toml").read_text() == case
    kinds = (Path("../written") / "design.json").read_text()
    assert "RUNS.csv" in kinds


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
