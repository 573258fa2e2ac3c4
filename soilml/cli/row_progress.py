"""Progress of an estimator, by the rows that its graph is given."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, cast

from soilml.cli.progress import progress_bar
from soilml.onboard.estimator import Estimator
from soilml.onboard.model_file import Session


@contextmanager
def row_progress(text: str, estimator: Estimator, rows: int) -> Iterator[Estimator]:
    """The same estimator, which moves a bar on; it will give about `rows` rows to its graph."""
    with progress_bar(text, rows) as done:
        counted = _CountedRows(estimator.session, done)
        yield replace(estimator, session=cast(Session, counted))


class _CountedRows:
    """A session that tells how many rows it was given."""

    def __init__(self, session: Session, done: Callable[[int], None]) -> None:
        self._session, self._done, self._rows = session, done, 0

    def run(self, outputs: Sequence[str], feed: Mapping[str, Any]) -> list[Any]:
        """Run the graph; its first input has a number for each row."""
        found: list[Any] = self._session.run(outputs, feed)
        self._rows += len(next(iter(feed.values())))
        self._done(self._rows)
        return found
