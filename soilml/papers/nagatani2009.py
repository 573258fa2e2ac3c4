"""What nagatani2009 prints, computed."""

from __future__ import annotations

from collections.abc import Callable

#: By key of the CSV file of the same name.
COMPUTED: dict[str, Callable[[], float]] = {}
