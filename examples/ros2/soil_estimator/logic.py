"""What the node does, without ROS: the content of messages in, reports and diagnostics out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from math import isfinite
from pathlib import Path

from soil_estimator.rows import SOURCES, RowCollector, Stretch
from soil_estimator.settings import NodeSettings
from soilml import SoilTracker
from soilml.errors import InputError
from soilml.onboard.tracking import Event, TrackerState, read_state, write_state

#: Names of other joints that a message shows where the wheel's is missing.
MOST_NAMED = 6
#: Events of rows that leave no doubt.
USED = (Event.ACCEPTED, Event.REPEATED)
#: Words of a row that has the stamp and the values of one that is remembered.
READ_BEFORE = "the row of this stamp was read before, and counts once"


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class SoilReport:
    """An estimate, or a state of the node, in words and numbers.

    Parameters
    ----------
    level : Level
        OK: the readings agree with a soil of the prior, or the inputs arrive.
    message : str
        One line.
    values : dict of str to float or str
        Of an estimate: mean, standard deviation and ends of the 90 % interval of each quantity, in
        SI units.
    stamp : int
        End of the stretch of the row, ns; 0 for a state of the node.
    """

    level: Level
    message: str
    values: dict[str, float | str]
    stamp: int = 0


class SoilLogic:
    """The soil under one wheel, from the content of messages.

    Parameters
    ----------
    settings : NodeSettings
        Of the node.

    Attributes
    ----------
    remark : str
        What became of the state file.
    """

    def __init__(self, settings: NodeSettings) -> None:
        self._settings = settings
        self._rows = RowCollector(
            settings.wheel_radius,
            settings.load,
            settings.period,
            settings.patience,
            settings.least_speed,
        )
        self._arrived: dict[str, float] = {}
        self._began: float | None = None
        self._joints: tuple[str, ...] = ()
        self._unstamped = 0
        self._last: Stretch | None = None
        self._closed_at: float | None = None
        self._remembered: list[Stretch] = []
        self._events = dict.fromkeys(Event, 0)
        self._written: float | None = None
        self._unwritten = ""
        self._tracker, self.remark = self._restored()

    def on_joints(
        self,
        stamp: int,
        names: Sequence[str],
        velocity: Sequence[float],
        effort: Sequence[float],
        now: float,
    ) -> list[SoilReport]:
        """Take a sensor_msgs/JointState: stamp in ns, rad/s, N m, and its arrival `now` in s.

        The joint is found by its name. Velocity, effort, or both may be empty or too short.
        """
        if self._settings.joint not in names:
            self._joints = tuple(names)[:MOST_NAMED]
            self._note(now)
            return []
        index, sign = list(names).index(self._settings.joint), self._settings.joint_sign
        found = {"wheel_speed": velocity, "torque": effort}
        samples = {n: sign * float(v[index]) for n, v in found.items() if index < len(v)}
        return self._add(stamp, samples, now)

    def on_odometry(
        self, stamp: int, forward: float, yaw_rate: float, now: float
    ) -> list[SoilReport]:
        """Take a nav_msgs/Odometry: speed (m/s) and yaw rate (rad/s) of the rover."""
        return self._add(stamp, {"speed": forward - yaw_rate * self._settings.wheel_y}, now)

    def on_load(self, stamp: int, force: float, now: float) -> list[SoilReport]:
        """Take a geometry_msgs/WrenchStamped: vertical force on the wheel in N."""
        return self._add(stamp, {"load": force}, now)

    def restart(self) -> None:
        """Forget all rows: the wheel is known to be on another soil."""
        self._tracker.restart()
        self._rows.forget()
        self._remembered = []
        self._try_to_save()

    def save(self) -> None:
        """Write the rows that are remembered to the state file, where there is one.

        Raises OSError if it cannot be written.
        """
        if self._settings.state_file:
            write_state(self._settings.state_file, self._tracker.save())

    def _try_to_save(self) -> None:
        """As `save`; a drive goes on where the file cannot be written, and diagnostics say so."""
        try:
            self.save()
            self._unwritten = ""
        except OSError as error:
            self._unwritten = f"; state_file cannot be written: {error.strerror or error}"

    def inputs(self, now: float) -> SoilReport:
        """Whether the messages arrive, and what is wrong with them. `now` as in `on_joints`."""
        self._note(now)
        silent = self._silent(now)
        lags = self._rows.lags
        behind = [n for n, lag in lags.items() if lag > self._settings.patience]
        values: dict[str, float | str] = {
            "late_samples": float(self._rows.late),
            "repeated_stamps": float(self._rows.repeated),
            "doubtful_stamps": float(self._rows.doubtful),
            "clocks_set": float(self._rows.clocks_set),
            "messages_without_stamp": float(self._unstamped),
        }
        values |= {f"{name}_behind": lag for name, lag in lags.items()}
        if silent:
            return SoilReport(Level.ERROR, self._silence(silent, now), values)
        if behind:
            text = (
                f"{SOURCES[behind[0]]} is stamped {lags[behind[0]]:.3g} s before the others, and "
                f"patience is {self._settings.patience:g} s: a clock is wrong, or messages are late"
            )
            return SoilReport(Level.WARN, text, values)
        waited = now - (self._closed_at or self._began or now)
        if waited > 2.0 * self._settings.period + self._settings.patience:
            text = f"stamps do not advance: no stretch of them was complete for {waited:.1f} s"
            return SoilReport(Level.WARN, text, values)
        if self._last is not None and self._last.row is None and not self._last.standing:
            return SoilReport(
                Level.WARN, f"no row of the last stretch: {self._last.reason}", values
            )
        standing = self._last is not None and self._last.standing
        return SoilReport(Level.OK, "the wheel stands" if standing else "all arrive", values)

    def soil(self) -> SoilReport:
        """The last estimate, with the number of rows by what they were found to be."""
        report = self._report(self._tracker.state, 0)
        counts = {f"rows_{event.name.lower()}": float(n) for event, n in self._events.items()}
        level = Level.WARN if self._unwritten else report.level
        return SoilReport(level, report.message + self._unwritten, report.values | counts)

    def _restored(self) -> tuple[SoilTracker, str]:
        """The tracker with the rows of the state file, where these can be used."""
        estimator, length = self._settings.estimator, self._settings.length
        path = self._settings.state_file
        if not path or not Path(path).exists():
            return SoilTracker(estimator, length), ""
        try:
            tracker = SoilTracker.restore(estimator, read_state(path), length)
        except InputError as error:
            return SoilTracker(estimator, length), f"state_file {path} is not used: {error}"
        return tracker, f"{tracker.state.rows_remembered} rows are restored from {path}"

    def _note(self, now: float) -> None:
        self._began = now if self._began is None else min(self._began, now)

    def _silent(self, now: float) -> list[str]:
        """Quantities that have not arrived for too long."""
        allowed = self._settings.patience + self._settings.period
        began = now if self._began is None else self._began
        names = self._rows.quantities
        return [name for name in names if now - self._arrived.get(name, began) > allowed]

    def _silence(self, silent: Sequence[str], now: float) -> str:
        name = silent[0]
        if name in self._arrived:
            return f"no {SOURCES[name]} for {now - self._arrived[name]:.1f} s"
        if self._joints and name in ("wheel_speed", "torque"):
            others = ", ".join(self._joints)
            return f"no joint {self._settings.joint} in joint_states, which has {others}"
        return f"no {SOURCES[name]} since the start"

    def _add(self, stamp: int, samples: Mapping[str, float], now: float) -> list[SoilReport]:
        self._note(now)
        if stamp <= 0:
            self._unstamped += 1
            return []
        finite = {name: value for name, value in samples.items() if isfinite(value)}
        self._arrived |= dict.fromkeys(finite, now)
        stretches = self._rows.add(stamp, finite)
        if stretches:
            self._closed_at = now
        reports = self._read(stretches)
        every = self._settings.save_every
        if reports and (self._written is None or not 0.0 <= now - self._written < every):
            self._written = now
            self._try_to_save()
        return reports

    def _read(self, stretches: Iterable[Stretch]) -> list[SoilReport]:
        """Reports on the rows of stretches that are complete."""
        reports = []
        for stretch in stretches:
            self._last = stretch
            if stretch.row is not None:
                state = self._state_after(stretch, stretch.row)
                self._events[state.event] += 1
                reports.append(self._report(state, stretch.end, stretch.row))
        return reports

    def _state_after(self, stretch: Stretch, row: Mapping[str, float]) -> TrackerState:
        """The tracker's state; a row of a bag that is played again counts once."""
        if stretch in self._remembered:
            return replace(self._tracker.state, event=Event.REPEATED, words=READ_BEFORE)
        state = self._tracker.read(**row)
        kept = state.rows_remembered + state.rows_in_question
        self._remembered = [*self._remembered, stretch][-kept:] if kept else []
        return state

    def _report(
        self, state: TrackerState, stamp: int, row: Mapping[str, float] | None = None
    ) -> SoilReport:
        found = state.estimate
        values: dict[str, float | str] = {
            "event": state.event.name,
            "rows_remembered": float(state.rows_remembered),
            "rows_since_change": float(state.rows_since_change),
            "rows_in_question": float(state.rows_in_question),
            "drifting": float(state.drifting),
            "in_range": float(found.in_range),
            "disagrees": float(found.disagrees),
        }
        values |= {} if row is None else {f"row_{name}": value for name, value in row.items()}
        parts = zip(found.names, found.mean, found.std, found.low, found.high, strict=True)
        for name, mean, std, low, high in parts:
            values |= {name: float(mean), f"{name}_std": float(std)}
            values |= {f"{name}_low": float(low), f"{name}_high": float(high)}
        vague = [n for n, x in zip(found.names, found.abstains, strict=True) if x]
        doubt = state.rows_in_question > 0 or state.drifting or state.event not in USED
        if state.rows_remembered == 0:
            text = "no row yet, the prior is given"
        elif not found.in_range:
            text = "out of range, or inconsistent"
        else:
            text = f"not determined yet: {', '.join(vague)}" if vague else "all determined"
        if found.in_range and found.disagrees:
            text += "; the rows fit no exact model: check units, sensors and wheel"
        doubt = doubt or bool(found.disagrees)
        sound = bool(found.in_range) and state.rows_remembered > 0 and not doubt
        level = Level.OK if sound else Level.WARN
        return SoilReport(level, f"{text}; {state.words}", values, stamp)
