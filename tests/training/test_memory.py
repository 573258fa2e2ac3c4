"""Memory is stated before anything is fitted, and a fit that has too little is refused."""

import pytest

from soilml.cli import main


@pytest.mark.slow
def test_a_fit_that_does_not_fit_is_refused_before_anything_is_done(
    tmp_path, small_data, monkeypatch, capsys
):
    spec, out = tmp_path / "s.toml", tmp_path / "m.onnx"
    spec.write_text('[[regressor]]\ntype = "linear"\n[[regressor]]\ntype = "lssvm"\n')
    monkeypatch.setattr("training.train.available_memory", lambda: 1_000_000)
    assert main(["train", str(spec), str(small_data), str(out)]) == 2
    said = capsys.readouterr().err
    assert "lssvm: " in said and "exact, " in said and " and 0.001 GB are free" in said
    assert 'solution = "fixed-size"' in said and "fitting" not in said
    assert not list(tmp_path.glob("m.*"))
