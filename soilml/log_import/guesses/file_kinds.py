"""Which kinds of file a set of logs has, where several files belong to one run."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.errors import InputError
from soilml.log_import.channels.runs import key_words, matched_files, run_names
from soilml.log_import.mapping.log_map import FileKind
from soilml.log_import.recording import Recording

Log = Sequence[Recording]


def guess_file_kinds(logs: Sequence[Log]) -> tuple[FileKind, ...]:
    """Kinds of files with different columns that have one run in common; empty for one kind.

    The word that the names of all files of a kind share, and no other file has, is its pattern.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, log in enumerate(logs):
        signature = tuple((r.name, *sorted((*r.columns, *r.texts))) for r in log)
        groups.setdefault(signature, []).append(i)
    if len(groups) < 2:
        return ()
    names = run_names([log[0].file for log in logs])
    words = [set(key_words(name, set())) for name in names]
    kinds = []
    for members in groups.values():
        others = [i for i in range(len(logs)) if i not in members]
        own = set.intersection(*(words[i] for i in members))
        own -= {word for i in others for word in words[i]}
        if not own:
            return ()
        word = max(sorted(own), key=len)
        # a dot in the name of a table of TOML would begin another one
        kinds.append(FileKind(word.replace(".", "_"), f"*{word}*"))
    try:
        runs = matched_files(logs, kinds)
    except InputError:
        return ()
    return tuple(kinds) if len(runs) < len(logs) else ()


def clocks_differ(clocks: Sequence[tuple[float, float]]) -> bool:
    """Whether the ranges of time (from, until) of the kinds do not overlap."""
    return max(start for start, _ in clocks) >= min(stop for _, stop in clocks)
