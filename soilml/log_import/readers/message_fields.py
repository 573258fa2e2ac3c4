"""Messages as columns: nested fields by dotted names, arrays by the names beside them."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from soilml.arrays import Floats
from soilml.io.bounds import COLUMNS, KEPT_VALUES
from soilml.remarks import Remark

_DEEPEST = 6
_LONGEST = 24  # Longer arrays (images, point clouds, laser scans) are no channels


class TopicColumns:
    """The columns of one topic of a file, filled message by message.

    `add` raises `InputError` for more columns than a log may have; `thin` makes room for values.
    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self.every, self._seen = 1, 0
        self.clock = array("d")
        self._stamps = array("d")
        self._cells: dict[str, array[float]] = {}

    def add(self, received: float, message: Any) -> None:
        """Append a message: an object with fields, or a dictionary; `received` in s."""
        self._seen += 1
        if (self._seen - 1) % self.every:
            return
        row = dict(fields_of(message))
        seconds = row.pop("header.stamp.sec", math.nan)
        stamp = seconds + 1e-9 * row.pop("header.stamp.nanosec", math.nan)
        row.pop("header.seq", None)
        n = len(self.clock)
        COLUMNS.check(self._file, len(self._cells.keys() | row.keys()))
        for name, value in row.items():
            if name not in self._cells:
                self._cells[name] = array("d", [math.nan]) * n
            self._cells[name].append(value)
        self.clock.append(received)
        self._stamps.append(stamp)
        for cells in self._cells.values():
            if len(cells) <= n:
                cells.append(math.nan)

    @property
    def size(self) -> int:
        """How many values it has."""
        return len(self.clock) * (len(self._cells) + 2)

    def thin(self) -> None:
        """Keep every second message, of those to come too."""
        self.every *= 2
        self.clock, self._stamps = self.clock[::2], self._stamps[::2]
        self._cells = {name: cells[::2] for name, cells in self._cells.items()}

    def notes(self, topic: str) -> list[Remark]:
        """What was left out."""
        if self.every == 1:
            return []
        text = f"{topic}: it is long: one message in {self.every} is read, evenly over the whole"
        return [Remark("thinned", text, (topic,))]

    def columns(self) -> dict[str, Floats]:
        """The columns as arrays in order of time; those without a number are left out."""
        order = self.order()
        arrays = {name: np.asarray(cells)[order] for name, cells in self._cells.items()}
        return {name: values for name, values in arrays.items() if np.isfinite(values).any()}

    def order(self) -> NDArray[np.intp]:
        """Positions of the messages in order of time."""
        return np.argsort(self._unordered_times(), kind="stable")

    def times(self) -> Floats:
        """Time of the samples in order, s; messages may be received out of order."""
        return np.sort(self._unordered_times())

    def _unordered_times(self) -> Floats:
        """Time of the messages as received, s: their stamps where they are set, else the bag's.

        The time of receipt jitters; the stamp is when the sensor was read.
        """
        stamps, clock = np.asarray(self._stamps), np.asarray(self.clock)
        known = bool((np.isfinite(stamps) & (stamps > 0.0)).all())
        return stamps if known and np.ptp(stamps) > 0.5 * np.ptp(clock) else clock


def thin_largest(topics: Iterable[TopicColumns]) -> None:
    """Thin the topics with most values until all have as many as are kept."""
    held = list(topics)
    while sum(own.size for own in held) > KEPT_VALUES:
        max(held, key=lambda own: own.size).thin()


def fields_of(message: Any, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Numbers of a message by dotted name.

    Elements of an array are named by `name` or `names` beside it (as in joint states), else
    numbered from 0. An orientation has roll, pitch and yaw (rad) besides its quaternion.
    """
    if depth > _DEEPEST:
        return
    items = (
        message if isinstance(message, dict) else {k: getattr(message, k) for k in _names(message)}
    )
    content = {key: value for key, value in items.items() if not key.startswith("_")}
    names = content.get("name", content.get("names", content.get("joint_names")))
    for key, value in content.items():
        place = f"{prefix}{key}"
        if isinstance(value, bool | int | float | np.number):
            yield place, _number(value)
        elif isinstance(value, list | tuple | np.ndarray):
            yield from _array(place, value, names, depth)
        elif isinstance(value, dict) or _names(value):
            yield from fields_of(value, f"{place}.", depth + 1)
    turn: list[Any] = [content.get(key) for key in "xyzw"]
    if all(isinstance(value, int | float | np.number) for value in turn):
        yield from _angles(prefix, *map(_number, turn))


def _array(place: str, value: Any, names: Any, depth: int) -> Iterator[tuple[str, float]]:
    if len(value) > _LONGEST:
        return
    named = isinstance(names, list | tuple) and len(names) == len(value)
    for i, element in enumerate(value):
        label = f"{place}.{names[i] if named else i}"
        if isinstance(element, bool | int | float | np.number):
            yield label, _number(element)
        elif isinstance(element, dict) or _names(element):
            yield from fields_of(element, f"{label}.", depth + 1)


def _number(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:  # a whole number of hundreds of digits
        return math.nan


def _names(value: Any) -> tuple[str, ...]:
    fields = getattr(type(value), "__dataclass_fields__", None)
    if fields is not None:
        return tuple(name for name in fields if not name.startswith("__"))
    return tuple(getattr(value, "__slots__", ()))


def _angles(prefix: str, x: float, y: float, z: float, w: float) -> Iterator[tuple[str, float]]:
    """Roll, pitch and yaw of a quaternion, rad (ZYX order)."""
    yield f"{prefix}roll", math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yield f"{prefix}pitch", math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    yield f"{prefix}yaw", math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def protobuf_fields(message: Any, depth: int = 0) -> dict[str, Any]:
    """The fields of a protobuf message by name, those that are zero included.

    A time (`google.protobuf.Timestamp`) of the message itself becomes its stamp, as ROS messages
    have it in their header. Maps and messages that are not set are left out.
    """
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.message_type is None:
            found[field.name] = list(value) if _is_repeated(value) else value
        elif field.message_type.GetOptions().map_entry or depth > _DEEPEST:
            continue
        elif _is_repeated(value):
            found[field.name] = [protobuf_fields(element, depth + 1) for element in value]
        elif not message.HasField(field.name):
            continue
        elif field.message_type.full_name == "google.protobuf.Timestamp" and depth == 0:
            stamp = {"sec": value.seconds, "nanosec": value.nanos}
            found.setdefault("header", {}).setdefault("stamp", stamp)
        else:
            found[field.name] = protobuf_fields(value, depth + 1)
    return found


def _is_repeated(value: Any) -> bool:
    return hasattr(value, "__len__") and not isinstance(value, str | bytes)
