"""The tables [windows] and [[leave_out]] of a map: which stretches of a run become rows."""

from __future__ import annotations

from dataclasses import dataclass

from soilml.io.toml_settings import Settings
from soilml.log_import.mapping.uncertain_value import Uncertain, take_uncertain


@dataclass(frozen=True)
class WindowSettings:
    """How steady windows are found; times in s."""

    shortest: float = 2.0
    settle: float = 0.5
    sensitivity: float = 1.0
    largest_slip_change: float = 0.05
    largest_torque_change: float = 0.15
    within: tuple[float, float] = (-float("inf"), float("inf"))


@dataclass(frozen=True)
class LeaveOut:
    """A stretch of a run that the user leaves out, in s after the start of the run."""

    run: str
    start: float
    stop: float
    why: str


def take_windows(settings: Settings) -> WindowSettings:
    """Read [windows]; raises `InputError` for what is wrong."""
    usual = WindowSettings()
    within = usual.within
    if "within" in settings:
        needed = "two times in s after the start of a run, such as [5, 20]"
        given = settings.take("within", list, needed)
        if len(given) != 2 or not all(isinstance(x, int | float) for x in given):
            settings.fail(f"within is {given!r}; needed is {needed}")
        within = (float(given[0]), float(given[1]))
    found = WindowSettings(
        shortest=take_uncertain(
            settings, "shortest", "s", Uncertain(usual.shortest), lower=0.0
        ).value,
        settle=take_uncertain(settings, "settle", "s", Uncertain(usual.settle)).value,
        sensitivity=settings.number("sensitivity", usual.sensitivity),
        largest_slip_change=take_uncertain(
            settings, "largest_slip_change", "1", Uncertain(usual.largest_slip_change)
        ).value,
        largest_torque_change=take_uncertain(
            settings, "largest_torque_change", "1", Uncertain(usual.largest_torque_change)
        ).value,
        within=within,
    )
    if not found.sensitivity > 0.0:
        settings.fail("sensitivity must be above zero; 1 is usual, 2 finds smaller changes")
    settings.finish()
    return found


def take_left_out(settings: Settings) -> LeaveOut:
    """Read an entry of [[leave_out]]; raises `InputError` for what is wrong."""
    found = LeaveOut(
        settings.text("run", ""),
        settings.number("from", 0.0),
        settings.number("until", float("inf")),
        settings.text("why", "left out by the map"),
    )
    settings.finish()
    return found
