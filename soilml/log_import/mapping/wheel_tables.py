"""Keys that wheels share: those of [motor_current] beside [wheels.NAME.motor_current]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from soilml.io.toml_settings import Settings
from soilml.log_import.mapping.channel import ROLES

#: Keys that say where samples come from, of which a table has one.
_SOURCES = ("column", "value", "file_name")


def shared_keys(settings: Settings, wheels: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Channel tables outside of the wheels, by role, of roles that some wheel has of its own.

    A table that names no source of samples is taken out of `settings`: it serves the wheels only.
    """
    own = {role for wheel in wheels.values() if isinstance(wheel, dict) for role in wheel}
    found = {}
    for role in ROLES:
        if role in own and role in settings:
            content = settings.content[role]
            if isinstance(content, dict):
                found[role] = content
                if not {*_SOURCES} & content.keys():
                    settings.take(role, dict, f"a table [{role}]")
    return found


def with_shared_keys(
    wheel: Mapping[str, Any], shared: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """The table of a wheel, whose channels have the shared keys that they do not state."""
    content = dict(wheel)
    for role, keys in shared.items():
        own = content.get(role)
        if isinstance(own, dict):
            sourced = {*_SOURCES} & own.keys()
            kept = {k: v for k, v in keys.items() if not (sourced and k in _SOURCES)}
            content[role] = kept | own
    return content
