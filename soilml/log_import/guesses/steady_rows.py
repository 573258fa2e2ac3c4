"""Tables in which each row is a steady run: whether a log is one, and its columns of errors."""

from __future__ import annotations

from collections.abc import Sequence

from soilml.log_import.guesses.columns.assignment import Assignment
from soilml.log_import.guesses.columns.candidates import Candidate, candidates_of
from soilml.log_import.guesses.columns.column_words import name_scores, words_of
from soilml.log_import.guesses.drafts.draft import Draft
from soilml.log_import.recording import Recording

#: Most rows of a table that somebody has made of runs.
_MOST = 400
#: Words of columns that are errors of others.
_ERRORS = {
    "std", "sd", "sigma", "err", "error", "stderr", "se", "sem", "uncertainty", "dev", "deviation",
    "stdev", "stddev", "fehler", "unsicherheit", "streuung", "abweichung", "cv", "rms",
    "incertezza", "incertidumbre", "desv", "desviacion", "desviación", "ecart", "écart", "u",
    "标准差", "误差",
}  # fmt: skip
_FILLERS = {
    "of",
    "the",
    "type",
    "standard",
    "estandar",
    "estándar",
    "mean",
    "avg",
    "average",
    "rel",
}


def rows_are_runs(logs: Sequence[Sequence[Recording]]) -> int:
    """How many rows the tables have, where each row is a steady run; 0 for logs over time.

    Such tables are short and have no column whose name or unit is a time.
    """
    count = 0
    for log in logs:
        for recording in log:
            if recording.clock is not None or not 0 < len(recording) <= _MOST:
                return 0
            if any(line for line in recording.about if "rate" in line.lower()):
                return 0
            if any("time" in name_scores(name) for name in recording.texts):
                return 0
            for c in candidates_of([recording]):
                # the torque T is no time, and a number of the row has no name of one
                if c.kind == "s" or ("time" in c.scores and "time" in name_scores(c.name)):
                    return 0
            count += len(recording)
    return count


def run_of_rows(recordings: Sequence[Recording]) -> str:
    """The column that names the run of each row; "" where none does."""
    for recording in recordings:
        for name in (*recording.texts, *recording.columns):
            if "run" in name_scores(name):
                return name
        for name in recording.texts:
            return name
    return ""


def is_error(candidate: Candidate) -> bool:
    """Whether a column is the error of another one, by its name: `T_std`, `err Fz`."""
    words = words_of(candidate.name)
    return "±" in candidate.name or (len(words) > 1 and bool(_ERRORS & {*words}))


def add_errors(drafts: dict[str, Draft], found: Assignment, errors: Sequence[Candidate]) -> None:
    """Add the columns of standard errors to the channels whose names they share."""
    for role, column in found.shared.items():
        own = _plain(column.name)
        for error in errors:
            same = _plain(error.name) == own
            if not same and role not in name_scores(" ".join(_plain(error.name))):
                continue
            draft = drafts[role]
            draft.put(
                "std", error.address,
                "CHANGE where it is the scatter of samples or repeats: of the mean, it is less",
            )  # fmt: skip
            if error.unit and error.unit != column.unit:
                draft.put("std_unit", error.unit)
            break


def _plain(name: str) -> list[str]:
    return [word for word in words_of(name) if word not in _ERRORS | _FILLERS]
