"""What every result shares: text, frames of pandas, values with their uncertainty."""

from html import escape

import numpy as np
import pytest

from soilml import (
    Estimator,
    Table,
    advise,
    estimate,
    gap,
    identify,
    pull,
    read_case,
    read_table,
    simulate,
)
from soilml.errors import InputError
from soilml.report.numbers import pretty
from soilml.results import EstimatedValue, Result

MODEL = """\
[gear]
type = "wheel"
radius = 0.15
width = 0.12
[soil]
name = "wong1989/dry_sand"
[soil.prior]
friction_angle = [0.3, 0.8]
kphi = [5e5, 5e6]
[noise]
torque_Nm = "2 %"
drawbar_pull_N = 0.3
"""
VOCABULARY = ("summary", "to_frame", "plot", "_repr_html_")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("results")
    (folder / "model.toml").write_text(MODEL)
    slip, load = np.tile(np.linspace(0.1, 0.6, 6), 3), np.repeat([40.0, 60.0, 90.0], 6)
    rows = simulate(folder / "model.toml", slip, load, run=np.repeat(["a", "b", "c"], 6), seed=3)
    lines = [f"run,{','.join(n for n in rows.columns if n not in ('run', 'status'))}"]
    for row in rows:
        numbers = [repr(float(v)) for k, v in row.items() if k not in ("run", "status")]
        lines.append(",".join([row["run"], *numbers]))
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def results(folder):
    model, runs = folder / "model.toml", str(folder / "runs.csv")
    estimator = Estimator.load("exported/wheel.onnx")
    return {
        "identify": identify(model, runs, method="posterior"),
        "gap": gap(str(model), runs),
        "pull": pull(model, runs, loads=[60.0], exact_model=True),
        "advise": advise(model, runs),
        "estimate": estimator.run(slip=[0.1, 0.3], torque=[1.6, 2.7], load=[60.0] * 2),
    }


@pytest.mark.slow
def test_every_result_has_a_verdict_first_and_a_table(results):
    for result in results.values():
        assert isinstance(result, Result) and all(hasattr(result, n) for n in VOCABULARY)
        first = result.summary().splitlines()[0]
        assert len(first.split()) <= 25 and first.endswith((".", "%)."))
        assert str(result) == result.summary()
        assert repr(result) == f"<{type(result).__name__}: {first}>"
        html = result._repr_html_()
        assert escape(pretty(first)) in html and "<table>" in html
        columns = result.frame_columns()
        assert len({len(values) for values in columns.values()}) == 1


@pytest.mark.slow
def test_one_vocabulary_of_parameters(results):
    for name in ("identify", "gap", "estimate"):
        result, key = results[name], "friction_angle"
        found = result[key]
        assert (found.mean, found.std) == tuple(found) and found.unit == "rad"
        low, high = found.interval()
        inner = found.interval(0.5)
        assert low < inner[0] < found.mean < inner[1] < high
        assert abs(found - float(found.mean)) == 0.0
        with pytest.raises(InputError, match="'porosity' is not"):
            result["porosity"]
    fit = results["identify"]
    assert (fit.mean == fit.values).all()
    assert [float(fit["kphi"].interval()[0]), float(fit["kphi"].interval(0.5)[0])] == [
        fit.interval[0][1],
        fit.interval(0.5)[0][1],
    ]
    with pytest.raises(InputError, match="the level of an interval is 90"):
        fit.interval(90)


def test_a_value_shows_the_digits_that_are_known():
    assert str(EstimatedValue(1255.36, 794.3, "Pa")) == "1260 +- 790 Pa"
    assert f"{EstimatedValue(0.57028, 0.0883, 'rad')}" == "0.570 +- 0.088 rad"
    assert f"{EstimatedValue(0.57028, 0.0883, 'rad'):.1f}" == "0.6"
    assert EstimatedValue(2.0, 0.0, "1") == EstimatedValue(2.0, 0.0, "1")
    assert EstimatedValue(2.0, 0.1, "1") != EstimatedValue(2.0, 0.2, "1")
    assert np.exp(EstimatedValue(0.0, 1.0, "1")) == 1.0


def test_a_fit_that_exceeds_the_noise_says_so_first(folder):
    rows = read_table(folder / "runs.csv")
    wrong = rows.columns | {"torque_Nm": rows["torque_Nm"] * np.where(rows["slip"] > 0.3, 2.0, 1.0)}
    fit = identify(folder / "model.toml", Table(wrong), method="nonlinear")
    verdict = fit.summary().splitlines()[0]
    assert verdict.startswith("The model does not fit these rows (")
    assert verdict.endswith(" times the noise; p < 0.001): run `soilml gap`.")
    assert fit.as_json()["verdict"] == verdict


@pytest.mark.slow
def test_frames_of_pandas_in_and_out(folder, results):
    pd = pytest.importorskip("pandas")
    frame = pd.read_csv(folder / "runs.csv", index_col=None).set_index(np.arange(100, 118))
    case = read_case(folder / "model.toml")
    assert identify(case, frame, method="nonlinear")["kphi"] == pytest.approx(
        float(identify(case, folder / "runs.csv", method="nonlinear")["kphi"])
    )
    for result in results.values():
        assert len(result.to_frame()) == len(next(iter(result.frame_columns().values())))
    soil = results["identify"].to_frame()
    assert soil.loc["friction_angle", "unit"] == "rad" and soil.index.name == "parameter"
    table = read_table(frame)
    assert pd.DataFrame(table)["torque_Nm"].tolist() == frame["torque_Nm"].tolist()
    pd.testing.assert_frame_equal(pd.DataFrame(table), table.to_frame(), check_dtype=False)


@pytest.mark.slow
def test_estimates_of_a_frame_keep_its_index(folder):
    pd = pytest.importorskip("pandas")
    frame = pd.read_csv(folder / "runs.csv").set_index(np.arange(100, 118))
    alone = estimate(frame, "exported/wheel.onnx")
    assert alone.index.tolist() == frame.index.tolist()
    by_run = estimate(frame, "exported/wheel.onnx", by="run")
    assert by_run.index.tolist() == ["a", "b", "c"] and by_run.index.name == "run"
