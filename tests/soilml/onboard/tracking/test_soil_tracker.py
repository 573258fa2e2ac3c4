"""Rows of a drive, one by one: glitches, another soil, stuck sensors, drift, a stored state."""

import json
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[4] / "bench"))

from conftest import simulated_run
from driven_days import SLIP_STD, Kind, simulate_day

from soilml import Estimator, SoilTracker
from soilml.errors import InputError
from soilml.onboard.tracking import Event, read_state, write_state
from soilml.onboard.tracking.misfit import MOST_VARIANCE
from soilml.onboard.tracking.state_file import FORMAT


def sealed(content, old, new):
    """A state in which a text is replaced, with the checksum of what it has now."""
    text = content[8:].replace(old.encode(), new.encode(), 1)
    assert text != content[8:]
    return b"%08x" % zlib.crc32(text) + text


def rows_of(posterior, count, seed=0, x=(0.2, -0.3, 0.1)):
    run, _ = simulated_run(posterior, count, seed, x)
    return [{name: float(values[i]) for name, values in run.items()} for i in range(count)]


def driven(tracker, rows):
    return [tracker.read(**row) for row in rows]


@pytest.fixture(scope="module")
def after_40_rows(wheel_sets, wheel_posterior):
    """The state of a tracker after 40 rows of one soil."""
    tracker = SoilTracker(wheel_sets)
    states = driven(tracker, rows_of(wheel_posterior, 40))
    assert {state.event for state in states} == {Event.ACCEPTED}
    return tracker.save()


@pytest.fixture
def settled(wheel_sets, after_40_rows):
    """A tracker after 40 rows of one soil."""
    return SoilTracker.restore(wheel_sets, after_40_rows)


def test_sound_rows_give_the_estimate_of_a_run(settled, wheel_sets, wheel_posterior):
    run, _ = simulated_run(wheel_posterior, 40)
    exact = wheel_sets.on(model_error=0.0)
    tracker, together = SoilTracker(exact), exact.run(**run)
    driven(tracker, rows_of(wheel_posterior, 40))
    assert tracker.state.estimate.mean == pytest.approx(together.mean, rel=0.02)
    assert tracker.state.estimate.std == pytest.approx(together.std, rel=0.1)
    # errors of the model are linear at the soil that is known when a row arrives: of 120 sets of
    # the released wheel, nine in ten have 0.6 to 1.25 of the width, and both cover alike
    found, together = settled.state.estimate, wheel_sets.run(**run)
    assert (np.abs(found.mean - together.mean) < 0.6 * together.std).all()
    assert found.std == pytest.approx(together.std, rel=0.4)
    assert (settled.state.rows_remembered, settled.state.rows_since_change) == (40, 40)


@pytest.mark.parametrize("factor", [2.0, 0.5, 0.0])
def test_a_glitch_leaves_the_estimate_as_it_is(settled, wheel_posterior, factor):
    before = settled.state.estimate
    good, *more = rows_of(wheel_posterior, 12, seed=1)
    glitch = settled.read(**good | {"torque": factor * good["torque"]})
    assert glitch.event in (Event.SET_ASIDE, Event.UNUSABLE)
    assert np.array_equal(glitch.estimate.mean, before.mean)
    states = driven(settled, more)
    assert {state.event for state in states} == {Event.ACCEPTED}
    assert states[-1].rows_in_question == 0 and states[-1].rows_since_change == 51


def test_another_soil_is_told_and_the_rows_before_are_forgotten(settled, wheel_posterior):
    x = (-0.5, 0.6, -0.4)
    states = driven(settled, rows_of(wheel_posterior, 20, seed=2, x=x))
    events = [state.event for state in states]
    at = events.index(Event.SOIL_CHANGED)
    assert at <= 6 and events.count(Event.SOIL_CHANGED) == 1
    assert set(events[:at]) <= {Event.SET_ASIDE, Event.ACCEPTED}
    assert states[at].rows_remembered == states[at].rows_since_change <= at + 1
    axes = wheel_posterior.family.axes
    truth = np.asarray([axis.value(np.asarray(v)) for axis, v in zip(axes, x, strict=True)])
    found = states[-1].estimate
    assert found.in_range and (np.abs(found.mean - truth) < 3.0 * found.std).all()


def test_a_stuck_torque_is_told_and_sound_rows_are_used_again(settled, wheel_posterior):
    rows = rows_of(wheel_posterior, 16, seed=4)
    last = rows[0]["torque"]
    stuck = [settled.read(**row | {"torque": last}) for row in rows[:10]]
    assert [state.event for state in stuck[2:]] == [Event.STUCK] * 8
    assert "torque repeats" in stuck[-1].words
    assert {state.event for state in driven(settled, rows[10:])} == {Event.ACCEPTED}


def test_a_stuck_slip_is_told_where_slip_has_noise(wheel_sets, wheel_posterior):
    rows = rows_of(wheel_posterior, 60)
    noisy, exact = SoilTracker(wheel_sets.on(noise={"slip": (0.02, 0.0)})), SoilTracker(wheel_sets)
    driven(noisy, rows[:40])
    slip = rows[39]["slip"]
    stuck = [noisy.read(**row | {"slip": slip}) for row in rows[40:55]]
    assert {state.event for state in stuck[1:]} == {Event.STUCK}
    assert "slip repeats" in stuck[-1].words
    assert Event.STUCK not in {exact.read(**row | {"slip": slip}).event for row in rows[:9]}


def test_a_constant_load_with_declared_noise_is_not_stuck(wheel_sets, wheel_posterior):
    """Two rows were used, and none after them."""
    noisy = wheel_sets.on(noise={"slip": (0.02, 0.0), "load": (0.5, 0.01)})
    tracker, rows = SoilTracker(noisy), rows_of(wheel_posterior, 40)
    ratio = [60.0 / row["load"] for row in rows]  # a wheel of another load has such a torque
    rows = [
        row | {"load": 60.0, "torque": row["torque"] * r}
        for row, r in zip(rows, ratio, strict=True)
    ]
    rows[10]["load"], rows[11]["load"] = 200.0, 201.0  # glitches
    states = driven(tracker, rows)
    events = [state.event for state in states]
    assert Event.STUCK not in events
    assert states[-1].rows_remembered >= 36
    again = SoilTracker.restore(noisy, tracker.save())
    assert again.read(**rows[0] | {"slip": 0.3}).event is not Event.STUCK


def test_noise_above_that_stated_widens_the_estimate_up_to_a_limit(wheel_sets, wheel_posterior):
    rng, rows = np.random.default_rng(0), rows_of(wheel_posterior, 60)
    widths = {}
    for times in (1.0, 1.6, 4.0):
        tracker = SoilTracker(wheel_sets)
        more = 0.02 * np.sqrt(times**2 - 1.0) * rng.standard_normal(len(rows))
        noisy = [
            row | {"torque": row["torque"] * (1.0 + part)}
            for row, part in zip(rows, more, strict=True)
        ]
        states = driven(tracker, noisy)
        widths[times] = states[-1].estimate.std, tracker._filter.variance
        if times < 2.0:
            used = [s for s in states[20:] if s.event is Event.ACCEPTED]
            assert len(used) > 35 and all(bool(s.estimate.in_range) for s in used)
    assert widths[1.0][1] < 1.3 < widths[1.6][1] < MOST_VARIANCE
    assert np.prod(widths[1.6][0] / widths[1.0][0]) > 1.0
    assert widths[4.0][1] == MOST_VARIANCE


def test_the_same_row_again_counts_once(settled, wheel_posterior):
    row = rows_of(wheel_posterior, 1, seed=5)[0]
    count = settled.read(**row).rows_remembered
    again = driven(settled, [row] * 5)
    assert {state.event for state in again} == {Event.REPEATED}
    assert again[-1].rows_remembered == count


def test_what_is_wrong_in_a_program_raises_an_error(settled, wheel_sets):
    with pytest.raises(InputError, match="load is missing; a row needs slip, torque, load"):
        settled.read(slip=0.3, torque=2.0)
    with pytest.raises(InputError, match="'speed' is not read by this model"):
        settled.read(slip=0.3, torque=2.0, load=60.0, speed=1.0)
    with pytest.raises(InputError, match="torque has 2 elements; needed is one number"):
        settled.read(slip=0.3, torque=[2.0, 2.1], load=60.0)
    with pytest.raises(InputError, match="length is 5; needed is a whole number of 16 or more"):
        SoilTracker(wheel_sets, length=5)
    with pytest.raises(InputError, match="length is 15;"):
        SoilTracker(wheel_sets, length=15)
    assert SoilTracker(wheel_sets, length=16).length == 16
    with pytest.raises(InputError, match=r"wheel_linear\.onnx has no set posterior"):
        SoilTracker(Estimator.load("wheel_linear")).read(slip=0.3, torque=2.0, load=60.0)


def test_what_is_remembered_does_not_grow(wheel_sets, wheel_posterior):
    tracker = SoilTracker(wheel_sets, length=32)
    rows = rows_of(wheel_posterior, 90)
    sizes, remembered = [], []
    for row in rows:
        state = tracker.read(**row)
        remembered.append(state.rows_remembered)
        sizes.append(len(tracker.save()))
    assert max(sizes[60:]) <= 1.01 * max(sizes[:60])
    assert 32 <= min(remembered[40:]) <= max(remembered) <= 34 and state.rows_since_change == 90


def test_a_stored_state_continues_where_it_stopped(settled, wheel_sets, wheel_posterior, tmp_path):
    rows = rows_of(wheel_posterior, 30, seed=7, x=(-0.5, 0.6, -0.4))
    driven(settled, rows[:2])
    assert settled.state.rows_in_question > 0
    other = SoilTracker.restore(wheel_sets, settled.save())
    for row in rows[2:]:
        ours, theirs = settled.read(**row), other.read(**row)
        assert ours.event is theirs.event and ours.words == theirs.words
        assert theirs.estimate.mean == pytest.approx(ours.estimate.mean, rel=1e-3)


def test_a_state_of_another_file_or_a_damaged_one_is_refused(settled, wheel_sets):
    content = settled.save()
    other = replace(wheel_sets, metadata=wheel_sets.metadata | {"graph_sha256": "0" * 64})
    with pytest.raises(InputError, match="which is another file, wheel, prior"):
        SoilTracker.restore(other, content)
    for place in range(0, len(content), len(content) // 40):
        bad = bytearray(content)
        bad[place] ^= 1
        with pytest.raises(InputError, match="this state of a tracker is damaged"):
            SoilTracker.restore(wheel_sets, bytes(bad))
    for size in (0, 7, 8, len(content) - 1):
        with pytest.raises(InputError, match="this state of a tracker is damaged"):
            SoilTracker.restore(wheel_sets, content[:size])
    shape = json.loads(content[8:])["state"]["window"]["blocks"][0]["system"]["shape"]
    for old, new in (
        (f'"shape": {shape}', f'"shape": {[shape[0], shape[1] + 1]}'),
        ('"state"', '"start"'),
        ('"disagree": ', '"disagree": 1, "disagree_": '),
    ):
        with pytest.raises(InputError, match="this state of a tracker is damaged"):
            SoilTracker.restore(wheel_sets, sealed(content, old, new))
    with pytest.raises(InputError, match="has format 0"):
        SoilTracker.restore(wheel_sets, sealed(content, f'"format": {FORMAT}', '"format": 0'))
    with pytest.raises(InputError, match="give the length that it was made with"):
        SoilTracker.restore(wheel_sets, content, length=1000)


def test_a_state_file_is_written_whole_and_bounded_before_it_is_read(settled, wheel_sets, tmp_path):
    path = tmp_path / "state"
    write_state(path, settled.save())
    assert [file.name for file in tmp_path.iterdir()] == ["state"]
    before = path.read_bytes()
    with pytest.raises(TypeError):
        write_state(path, "no bytes")
    assert path.read_bytes() == before
    assert SoilTracker.restore(wheel_sets, read_state(path)).state.rows_remembered == 40
    (tmp_path / "long").write_bytes(bytes(9 << 20))
    for name, text in (
        ("long", "holds 9 MB; a state of a tracker has at most 8 MB"),
        ("none", "cannot be read: No such file"),
    ):
        with pytest.raises(InputError, match=text):
            read_state(tmp_path / name)


def test_restart_forgets_the_soil(settled):
    state = settled.restart()
    assert (state.rows_remembered, state.rows_since_change) == (0, 0)
    assert not state.estimate.in_range


@pytest.mark.parametrize("drift", ["friction", pytest.param("zero", marks=pytest.mark.long)])
def test_a_simulated_day(wheel_sets, drift):
    day = simulate_day(7, drift)
    configured = wheel_sets.on(noise={"slip": (SLIP_STD, 0.0)})
    tracker, memory, plain = SoilTracker(configured), configured.start(), []
    states = []
    for i in range(len(day.kinds)):
        states.append(tracker.read(**day.row(i)))
        found, memory = configured.step(memory, **day.row(i))
        plain.append(bool(found.in_range))
    events = [state.event for state in states]
    # each change is told within so many rows, and nothing else is taken for one
    told = [i for i, event in enumerate(events) if event is Event.SOIL_CHANGED]
    first_drifting = day.kinds.index(Kind.DRIFTING)
    changes = [row for row, _ in day.changes]
    assert all(any(row <= i < row + 10 for i in told) for row in changes)
    assert len([i for i in told if i < first_drifting]) == len(changes)
    of_kind = {
        kind: [e for e, k in zip(events, day.kinds, strict=True) if k is kind] for kind in Kind
    }
    assert set(of_kind[Kind.GLITCH]) <= {Event.SET_ASIDE, Event.UNUSABLE}
    assert of_kind[Kind.STUCK][2:] == [Event.STUCK] * (len(of_kind[Kind.STUCK]) - 2)
    assert set(of_kind[Kind.PAUSED]) <= {Event.REPEATED, Event.UNUSABLE}
    sound = [i for i, k in enumerate(day.kinds) if k is Kind.SOUND]
    steady = [i for i in sound if i % 100 >= 20]
    assert np.mean([events[i] is Event.ACCEPTED for i in steady]) > 0.98
    held = [
        (state.estimate.low <= day.soils[i]) & (day.soils[i] <= state.estimate.high)
        for i, state in enumerate(states)
        if i in steady
    ]
    assert np.mean(held) > 0.7
    assert np.mean([bool(states[i].estimate.in_range) for i in steady]) > 0.95
    assert Event.DRIFT in events[first_drifting : first_drifting + 110]
    # all rows in one memory: refused from the first glitch or change on
    assert not np.mean([plain[i] for i in steady]) > 0.5
