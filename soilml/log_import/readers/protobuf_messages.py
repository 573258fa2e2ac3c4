"""Messages of protobuf as dictionaries."""

from __future__ import annotations

from typing import Any

_DEEPEST = 6


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
