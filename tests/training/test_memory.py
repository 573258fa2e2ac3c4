"""Memory is stated before anything is fitted, and a fit that has too little is refused."""

import pytest

from soilml.cli import main
from training import available_memory as memory


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


def test_free_memory_is_the_least_of_what_machine_group_and_process_allow(monkeypatch, tmp_path):
    free = memory.available_memory()
    assert free is None or 0 <= free < 1 << 50
    limit, used = tmp_path / "max", tmp_path / "current"
    monkeypatch.setattr(memory, "LIMIT", limit)
    monkeypatch.setattr(memory, "USED", used)
    limit.write_text("5000000\n")
    used.write_text("4000000\n")
    assert memory.available_memory() == 1_000_000
    limit.write_text("max\n")
    assert memory.available_memory() != 1_000_000
    for name in ("_free_of_machine", "_free_of_group", "_free_of_process"):
        monkeypatch.setattr(memory, name, lambda: None)
    assert memory.available_memory() is None
