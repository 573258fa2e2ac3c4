"""Seconds of work, and the speed of the core meanwhile."""

import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import core_speed


@pytest.fixture
def measured(monkeypatch):
    """Speeds that were measured: 100, 200, 300 and so on, each in much time of the core."""
    speeds = []

    def forward_speed(case):
        until = time.process_time() + 0.05
        while time.process_time() < until:
            pass
        speeds.append(100.0 * (1 + len(speeds)))
        return speeds[-1]

    monkeypatch.setattr(core_speed, "_forward_speed", forward_speed)
    monkeypatch.setattr(core_speed, "EVERY", 0.01)
    return speeds


def test_the_speed_is_measured_before_during_and_after_the_work_and_does_not_count(measured):
    started = time.process_time()

    def work():
        while len(measured) < 5 and time.process_time() < started + 20.0:
            pass
        return "done"

    timed = core_speed.timed(None, work)
    taken = time.process_time() - started
    assert timed.result == "done" and len(measured) >= 6
    assert timed.solves == sum(measured) / len(measured)
    assert 0.0 < timed.seconds <= taken - 0.05 * len(measured)
    assert timed.scaled == timed.seconds * timed.solves / 500_000
