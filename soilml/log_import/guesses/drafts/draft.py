"""The table of one channel in a draft of a map: its keys with the reasons for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from soilml.log_import.guesses.columns.candidates import Candidate


@dataclass
class Draft:
    """The table of one channel: its keys, and a comment for each of them."""

    keys: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    column: Candidate | None = None

    def put(self, key: str, value: Any, why: str = "") -> None:
        """Set a key and its comment."""
        self.keys[key] = value
        if why:
            self.comments[key] = why

    def without(self, shared: Draft) -> Draft:
        """The keys that are not in another draft."""
        return Draft({k: v for k, v in self.keys.items() if k not in shared.keys}, self.comments)


def keys_alike(wheels: Sequence[dict[str, Draft]]) -> dict[str, Draft]:
    """The keys that all wheels share, by role, with the comments of the first wheel."""
    return {
        role: Draft(
            {
                key: value
                for key, value in first.keys.items()
                if all(key in w[role].keys and w[role].keys[key] == value for w in wheels)
            },
            first.comments,
        )
        for role, first in (wheels[0] if wheels else {}).items()
    }
