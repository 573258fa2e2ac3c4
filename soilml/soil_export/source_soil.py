"""What a file knows of a soil: values, intervals and draws, of a fit or of a model file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case, read_case
from soilml.errors import InputError, did_you_mean
from soilml.fitting.coordinates import select_free
from soilml.identification.posterior import prior_fractions
from soilml.io.atomic_files import refuse_device
from soilml.io.bounds import JSON_BYTES
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark, about

#: Draws of the priors of a model file.
PRIOR_DRAWS = 400


@dataclass(frozen=True)
class SourceSoil:
    """The nine parameters of a soil in SI units, and how well they are known.

    Attributes
    ----------
    source
        The file that was read.
    values
        Each parameter of `Soil` by name, in SI units.
    origin
        Where each value is from: `rows`, `model file` or `prior`.
    intervals
        Standard deviation and ends of the 90 % interval, by name, of the parameters from rows.
    draws
        Equally weighted draws (count,) by name, of the parameters that are uncertain; empty where
        the file has none.
    remarks
        What limits the values.
    no_draws
        Why there are no draws; "" where there are.
    """

    source: str
    values: dict[str, float]
    origin: dict[str, str]
    intervals: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    draws: dict[str, Floats] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()
    no_draws: str = ""

    def drawn(self, count: int, seed: int = 0) -> list[dict[str, float]]:
        """`count` soils of the draws, without repetition; correlations are kept.

        Raises `InputError` where the file has no draws, or fewer.
        """
        if not self.draws:
            raise InputError(f"{self.source} has no draws: {self.no_draws}")
        stored = len(next(iter(self.draws.values())))
        if count > stored:
            raise InputError(
                f"--draws is {count}; {self.source} has {stored} draws: give {stored} or fewer"
            )
        rows = np.sort(np.random.default_rng(seed).permutation(stored)[:count])
        return [
            self.values | {name: float(own[row]) for name, own in self.draws.items()}
            for row in rows
        ]


def read_source_soil(path: str | os.PathLike[str], run: str | None = None) -> SourceSoil:
    """The soil in the file that `soilml identify --out` wrote, or in a model file.

    Parameters
    ----------
    path
        A file whose name ends in .json or .toml.
    run
        Which result, where the file has one for each run.

    Returns
    -------
    SourceSoil

    Raises
    ------
    InputError
        For a file that is neither, lacks the soil, or has several results and `run` names none.
    """
    file = Path(path)
    if file.suffix.lower() == ".toml":
        if run is not None:
            raise InputError(f"--run {run!r}: a model file has one soil; omit it")
        return _of_case(read_case(file, with_bias=True), str(path))
    if file.suffix.lower() != ".json":
        raise InputError(
            f"{path}: needed is result.json of `soilml identify --out`, or a model file in .toml"
        )
    try:
        refuse_device(file)
        JSON_BYTES.check(file, file.stat().st_size)
        content = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    except ValueError:
        raise InputError(f"{path} is not JSON; needed is the file of `soilml identify`") from None
    return _of_fit(_result(content, str(path), run), str(path))


def _result(content: Any, path: str, run: str | None) -> Mapping[str, Any]:
    """The entry of one fit; raises `InputError` where the file has none."""
    if not isinstance(content, dict) or not {"parameters", "runs"} & content.keys():
        _no_fit(path)
    if "parameters" in content:
        if run is not None:
            raise InputError(f"--run {run!r}: {path} has one result; omit it")
        return content
    runs = content["runs"]
    if not isinstance(runs, dict) or not runs:
        _no_fit(path)
    if run is None:
        raise InputError(f"{path} has {len(runs)} results; name one with --run: {', '.join(runs)}")
    if run not in runs:
        raise InputError(f"{path} has no run {run!r}; {did_you_mean(run, runs)}there are: "
                         f"{', '.join(runs)}")  # fmt: skip
    entry = runs[run]
    return entry if isinstance(entry, dict) else _no_fit(path)


def _no_fit(path: str) -> NoReturn:
    raise InputError(f"{path} is no result of `soilml identify`; needed is its file of --out")


def _of_fit(fit: Mapping[str, Any], path: str) -> SourceSoil:
    """The soil of one fit: identified values, and those that its model file fixed."""
    if not isinstance(fit.get("model"), dict) or not isinstance(fit["model"].get("soil"), dict):
        raise InputError(
            f"{path} lacks model.soil, the values that were not identified: write it again with "
            "soilml identify --out"
        )
    parameters = declared(Soil)
    values = {name: _number(fit["model"]["soil"], name, path) for name in parameters}
    origin = dict.fromkeys(parameters, "model file")
    intervals, others, wide = {}, [], []
    entries = fit.get("parameters")
    if not isinstance(entries, dict):
        _no_fit(path)
    for name, entry in entries.items():
        if not isinstance(entry, dict):
            _no_fit(path)
        if name not in parameters:
            others.append(name)
            continue
        values[name], origin[name] = _number(entry, "value", path), "rows"
        std, low, high = (_number(entry, key, path) for key in ("std", "p05", "p95"))
        intervals[name] = std, low, high
        if entry.get("remaining_fraction", 0.0) > NOT_IDENTIFIED_ABOVE:
            wide.append(name)
    _check_bounds(values, path)
    said = _remarks(fit.get("warnings", []))
    warned = about(said, "not-identified") | about(said, "few-readings")
    wide += [name for name in intervals if name in warned and name not in wide]
    remarks = []
    if wide:
        text = f"the rows do not determine {', '.join(wide)}: one file hides that, --draws shows it"
        remarks.append(Remark("not-determined", text, tuple(wide)))
    effects = [*fit["model"].get("effects", []), *others]
    if effects:
        text = f"the fit has {', '.join(effects)}: no target knows these, and forces will differ"
        remarks.append(Remark("effects-lost", text, tuple(effects)))
    draws = _draws(fit.get("draws"), parameters, path)
    why = "only averaged and posterior of `soilml identify` draw samples, and not with --by"
    return SourceSoil(path, values, origin, intervals, draws, tuple(remarks), "" if draws else why)


def _remarks(entries: Any) -> list[Remark]:
    """Remarks of a file of results, of which code and names count."""
    known = [entry for entry in entries if isinstance(entry, dict)]
    return [Remark(str(e.get("code")), "", tuple(map(str, e.get("about", ())))) for e in known]


def _draws(entry: Any, parameters: Mapping[str, Any], path: str) -> dict[str, Floats]:
    """Draws (count,) of the soil's parameters; empty where the file has none."""
    if not isinstance(entry, dict):
        return {}
    try:
        found = {n: np.asarray(v, dtype=np.float64) for n, v in entry.items() if n in parameters}
    except (TypeError, ValueError):
        _no_fit(path)
    bounds = [(own, parameters[name]) for name, own in found.items()]
    if len({own.shape for own in found.values()}) > 1 or not all(
        own.ndim == 1 and own.size and np.all((own >= p.lower) & (own <= p.upper))
        for own, p in bounds
    ):
        raise InputError(
            f"{path}: draws must be lists of numbers of one length within the bounds of the soil; "
            "write it again with soilml identify --out"
        )
    return found


def _number(entry: Mapping[str, Any], key: str, path: str) -> float:
    value = entry.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{path}: {key} is {value!r}; needed is a number")
    return float(value)


def _check_bounds(values: Mapping[str, float], path: str) -> None:
    for name, parameter in declared(Soil).items():
        if not parameter.lower <= values[name] <= parameter.upper:
            raise InputError(
                f"{path}: {name} is {values[name]:g}; it must lie between {parameter.lower:g} and "
                f"{parameter.upper:g} {parameter.unit}"
            )


def _of_case(case: Case, path: str) -> SourceSoil:
    """The soil of a model file, with draws of its priors."""
    values = {name: float(getattr(case.soil, name)) for name in declared(Soil)}
    unknown = [name for name in case.prior if name in values]
    origin = {name: "prior" if name in unknown else "model file" for name in values}
    remarks, draws = [], {}
    if unknown:
        text = (
            f"{', '.join(unknown)}: {path} has a prior, not a measurement; its value is a start "
            "value, and draws are of the prior"
        )
        remarks.append(Remark("not-measured", text, tuple(unknown)))
        free = select_free(case, unknown)
        u = prior_fractions(free, PRIOR_DRAWS, np.random.default_rng(0), case)
        draws = {f.path: np.asarray(f.prior.at(u[:, i])) for i, f in enumerate(free)}
    effects = tuple(effect.name for effect in case.model.effects)
    if effects:
        text = f"the model has {', '.join(effects)}: no target knows these, and forces will differ"
        remarks.append(Remark("effects-lost", text, effects))
    why = "" if draws else "its parameters have no prior in [soil.prior]"
    return SourceSoil(path, values, origin, {}, draws, tuple(remarks), why)
