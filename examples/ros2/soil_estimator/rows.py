"""Rows for the estimator, each the mean of a stretch of samples that belong together by stamp."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite

from soil_estimator.clock import Stamp, StampedSamples
from soil_estimator.slip import slip_of

SECOND = 1_000_000_000  # ns
#: Samples of a stretch that each moving quantity needs, and the share of it that they must span.
LEAST_SAMPLES, LEAST_SPAN = 2, 0.5
#: Change of the wheel's speed from the first half of a stretch to the second, as a share of its
#: mean, above which the wheel starts or stops: its torque then accelerates the wheel as well.
MOST_CHANGE = 0.3
#: Samples of odometry from which equal ones are no measurement, while the wheel's speed varies.
REPETITIONS = 3
#: Quantities and what the node calls them.
SOURCES = {
    "wheel_speed": "velocity of the joint",
    "torque": "effort of the joint",
    "speed": "odometry",
    "load": "wheel_load",
}


@dataclass(frozen=True)
class Stretch:
    """What a stretch of time gave.

    Parameters
    ----------
    end : int
        Its end in ns.
    row : dict of str to float or None
        Slip, torque (N m) and load (N); None where there is no row.
    reason : str
        Why there is none.
    standing : bool
        Whether the wheel stands, so that no row is expected.
    """

    end: int
    row: dict[str, float] | None
    reason: str = ""
    standing: bool = False


@dataclass
class RowCollector:
    """Makes a row of every `period` of the stamps, whatever the order in which messages arrive.

    A stretch begins at a whole multiple of the period. It is closed, once, when every quantity has
    a stamp past its end, or when one is `patience` past it; samples that arrive later are dropped
    and counted. Samples closer together than sinkage and shear need to settle are no independent
    readings; the mean over a second or so is one reading.

    Parameters
    ----------
    wheel_radius : float
        m.
    load : float or None
        Load on the wheel in N; None: it is sampled.
    period : float
        Length of a stretch, s.
    patience : float
        Longest wait for late messages, s of the stamps.
    least_speed : float
        Speed of the rim (m/s) below which the wheel counts as standing.
    sources : mapping
        Quantities, and what messages call them.
    """

    wheel_radius: float
    load: float | None
    period: float = 1.0
    patience: float = 2.0
    least_speed: float = 0.005
    late: int = 0
    repeated: int = 0
    doubtful: int = 0
    clocks_set: int = 0
    sources: Mapping[str, str] = field(default_factory=lambda: SOURCES)
    _channels: dict[str, StampedSamples] = field(init=False)
    _closed: int | None = None  # number of the last stretch that is closed

    def __post_init__(self) -> None:
        names = [name for name in self.sources if name != "load" or self.load is None]
        reach = round(SECOND * max(self.patience, self.period))
        self._channels = {name: StampedSamples(reach) for name in names}

    @property
    def quantities(self) -> tuple[str, ...]:
        """Quantities that are sampled."""
        return tuple(self._channels)

    @property
    def lags(self) -> dict[str, float]:
        """By how many seconds the newest stamp of each quantity lies behind the newest of all."""
        newest = {n: c.newest for n, c in self._channels.items() if c.newest is not None}
        front = max(newest.values(), default=0)
        return {name: (front - stamp) / SECOND for name, stamp in newest.items()}

    def add(self, stamp: int, samples: Mapping[str, float]) -> list[Stretch]:
        """Take samples of one message; returns the stretches that are complete now.

        Parameters
        ----------
        stamp : int
            Of the message, ns.
        samples : mapping
            Any of `wheel_speed` (rad/s), `torque` (N m), `speed` (m/s) and `load` (N); what is not
            finite is left out.
        """
        for name, value in samples.items():
            if name in self._channels and isfinite(value):
                self._add(name, stamp, value)
        return self._complete()

    def forget(self) -> None:
        """Drop all samples."""
        for channel in self._channels.values():
            channel.forget()
        self._closed = None

    def _add(self, name: str, stamp: int, value: float) -> None:
        channel, length = self._channels[name], self._length
        found = channel.add(stamp, value)
        self.repeated += found is Stamp.REPEATED
        self.doubtful += found is Stamp.DOUBTFUL
        self.clocks_set += found in (Stamp.SET_FORWARD, Stamp.SET_BACK)
        if found is Stamp.SET_BACK:
            kept = channel.samples
            self.forget()
            channel.samples, channel.newest = kept, max(kept)
        if self._closed is None or found in (Stamp.REPEATED, Stamp.DOUBTFUL):
            return
        fresh = (stamp,) if found is Stamp.USED else tuple(channel.samples)
        for each in fresh:
            if each // length <= self._closed:
                del channel.samples[each]
                self.late += 1

    @property
    def _length(self) -> int:
        return max(round(SECOND * self.period), 1)

    def _complete(self) -> list[Stretch]:
        """Close the stretches that no sample is waited for."""
        newest = [channel.newest for channel in self._channels.values()]
        known = [stamp for stamp in newest if stamp is not None]
        if not known:
            return []
        until = max(known) - round(SECOND * self.patience)
        if len(known) == len(newest):
            until = max(until, min(known))
        last = until // self._length - 1
        if self._closed is not None and last <= self._closed:
            return []
        held = {s // self._length for c in self._channels.values() for s in c.samples}
        found = [self._close(number) for number in sorted(held) if number <= last]
        self._closed = last
        return found

    def _close(self, number: int) -> Stretch:
        """The row of a stretch, or why there is none; its samples are dropped."""
        length = self._length
        taken: dict[str, list[tuple[int, float]]] = {}
        for name, channel in self._channels.items():
            inside = sorted(s for s in channel.samples if s // length <= number)
            taken[name] = [(s, channel.samples.pop(s)) for s in inside]
        end = (number + 1) * length
        for name, samples in taken.items():
            least = 1 if name == "load" else LEAST_SAMPLES
            if len(samples) < least:
                return Stretch(end, None, f"{len(samples)} samples of {self.sources[name]}")
            if least > 1 and samples[-1][0] - samples[0][0] < LEAST_SPAN * length:
                return Stretch(end, None, f"{self.sources[name]} for a part of the time only")
        return self.row(end, {n: [v for _, v in samples] for n, samples in taken.items()})

    def row(self, end: int, values: Mapping[str, list[float]]) -> Stretch:
        """The row of the samples of a stretch, by quantity."""
        mean = {name: sum(part) / len(part) for name, part in values.items()}
        # backward driving is forward driving seen from the other side
        sign = 1.0 if mean["wheel_speed"] >= 0.0 else -1.0
        rim_speed, speed = sign * mean["wheel_speed"] * self.wheel_radius, sign * mean["speed"]
        if not rim_speed >= self.least_speed:
            return Stretch(end, None, "the wheel stands", standing=True)
        half = len(values["wheel_speed"]) // 2
        first, second = values["wheel_speed"][:half], values["wheel_speed"][-half:]
        if abs(sum(second) - sum(first)) > MOST_CHANGE * half * abs(mean["wheel_speed"]):
            return Stretch(end, None, "the wheel starts or stops")
        speeds = values["speed"]
        if len(speeds) >= REPETITIONS and len(set(speeds)) == 1 < len(set(values["wheel_speed"])):
            return Stretch(end, None, "odometry repeats its speed to the last digit")
        if not isfinite(sum(mean.values())):
            return Stretch(end, None, "samples are too large")
        load = mean["load"] if self.load is None else self.load
        row = {"slip": slip_of(rim_speed, speed), "torque": sign * mean["torque"], "load": load}
        return Stretch(end, row)
