"""The engine dask: the same rows, workers that are killed, schedulers that are not there."""

import functools
import hashlib
import os
import signal

import pytest
from conftest import RECIPE

from datagen.dask_cluster import dask_map
from datagen.generate import generate, generate_folder
from datagen.recipe import read_recipe
from datagen.simulation import pieces
from soilml.errors import InputError

pytestmark = pytest.mark.slow

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def scheduler():
    """The address of a scheduler with two workers, which are started again when they die."""
    few = dask.config.set({"distributed.scheduler.allowed-failures": 1})
    options = {"threads_per_worker": 1, "memory_limit": None, "dashboard_address": "127.0.0.1:0"}
    with few, distributed.LocalCluster(n_workers=2, **options) as cluster:
        yield cluster.scheduler_address


def die_once(marker, number):
    """Kill the worker of one item, the first time."""
    if number == 5 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number, os.getpid()


def test_a_killed_worker_changes_no_result(scheduler, tmp_path):
    task = functools.partial(die_once, tmp_path / "died")
    with dask_map(task, range(40), scheduler=scheduler) as results:
        numbers, processes = zip(*results, strict=True)
    assert numbers == tuple(range(40)) and (tmp_path / "died").exists()
    assert os.getpid() not in processes


def test_the_bytes_are_those_of_the_other_engine(scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.generate.pieces", functools.partial(pieces, size=256))
    blocks = "[[runs]]\nrows = 1\nshare = 0.5\n[[runs]]\nrows = 8\nshare = 0.5\n"
    (tmp_path / "recipe.toml").write_text(RECIPE.format(rows=2000, seed=1) + blocks)
    recipe = read_recipe(tmp_path / "recipe.toml")
    engine = functools.partial(dask_map, scheduler=scheduler)
    generate(recipe, tmp_path / "a.parquet")
    generate(recipe, tmp_path / "b.parquet", engine=engine)
    digests = [hashlib.sha256((tmp_path / f"{n}.parquet").read_bytes()).digest() for n in "ab"]
    assert digests[0] == digests[1]
    generate_folder(recipe, tmp_path / "one", rows_per_file=256)
    result = generate_folder(recipe, tmp_path / "two", engine=engine, rows_per_file=256)
    assert (result.rows, result.kept) == (2000, 0)
    one, two = ({f.name: f.read_bytes() for f in (tmp_path / n).iterdir()} for n in ("one", "two"))
    assert one == two and len(one) == 8
    (tmp_path / "two" / "part-000004.parquet").unlink()
    result = generate_folder(recipe, tmp_path / "two", engine=engine, rows_per_file=256)
    assert result.kept == 2000 - 256
    assert one == {f.name: f.read_bytes() for f in (tmp_path / "two").iterdir()}


def test_effects_of_a_file_reach_the_workers(scheduler, tmp_path):
    from soilml.physics.effects import EFFECTS
    from soilml.physics.user_effects import load_effects

    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "other.py").write_text("1 / 0")  # which nothing here refers to
    with pytest.raises(InputError, match="ZeroDivisionError"):
        load_effects(tmp_path / "other.py")
    text = RECIPE.format(rows=64, seed=1) + '[[effect]]\nname = "half-torque"\nshare = 0.5\n'
    (tmp_path / "recipe.toml").write_text(text)
    effects = {**EFFECTS, **load_effects(tmp_path / "mine.py")}
    recipe = read_recipe(tmp_path / "recipe.toml", effects)
    generate(recipe, tmp_path / "a.parquet")
    generate(
        recipe, tmp_path / "b.parquet", engine=functools.partial(dask_map, scheduler=scheduler)
    )
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


MINE = """\
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from soilml import Effect, EffectCard, Parameter


@dataclass(frozen=True, kw_only=True)
class HalfTorque(Effect):
    name: ClassVar[str] = "half-torque"
    about: ClassVar[EffectCard] = EffectCard(
        text="a torque sensor that reads low",
        source="a test",
        kind="sensor",
        reference={"share": 0.5},
        signs={"torque": -1},
        isolate="a dead weight",
    )
    share: Annotated[float, Parameter("1", 0.0, 1.0, "missing share")] = 0.0

    def on_reading(self, force, load_case):
        return replace(force, torque=force.torque * (1.0 - self.share))
"""
