"""What `estimate --by` says while it works, and of many runs."""

import numpy as np
import pytest

from datagen.recipe import read_recipe
from soilml import Estimator, simulate
from soilml.cli import main, progress


@pytest.mark.parametrize("name", ["wheel", "wheel_linear"])
def test_progress_counts_the_rows_that_the_graph_is_given(monkeypatch, name):
    done = []

    class Bar:
        def __init__(self, text, total):
            assert (text, total) == ("estimating", 600)

        def __enter__(self):
            return done.append

        def __exit__(self, *error):
            pass

    monkeypatch.setattr(progress, "progress_bar", Bar)
    estimator = Estimator.load(name)
    slip = np.linspace(0.1, 0.5, 300)
    rows = {"slip": slip, "torque": 1.0 + 3.0 * slip, "load": np.full(300, 60.0)}
    with progress.row_progress("estimating", estimator, 600) as counted:
        inside, found = counted.rows_in_range(**rows), counted.run(**rows)
    assert done == sorted(done) and done[-1] == 600
    assert inside.shape == (300,)
    np.testing.assert_array_equal(found.mean, estimator.run(**rows).mean)


@pytest.mark.parametrize(("factor", "said"), [(1.0, False), (0.7, True)])
def test_rows_that_disagree_with_the_exact_model_are_named(tmp_path, capsys, factor, said):
    table = simulate(read_recipe("wheel").case, np.linspace(0.1, 0.5, 16), [60.0, 90.0] * 8, seed=3)
    columns = ("slip", "load_N", "torque_Nm", "sinkage_m", "drawbar_pull_N")
    rows = np.stack([np.asarray(table[name], float) for name in columns], axis=1)
    rows[:, 2] *= factor
    file = tmp_path / "rows.csv"
    lines = ["run," + ",".join(columns), *("a," + ",".join(f"{x:.6g}" for x in r) for r in rows)]
    file.write_text("\n".join(lines) + "\n")
    assert main(["estimate", "wheel", str(file), "--by", "run"]) == 0
    output = capsys.readouterr()
    assert ("disagree with the exact model" in output.out + output.err) == said
