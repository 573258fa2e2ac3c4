"""What a file knows of a soil: values, intervals and draws, of a fit or of a model file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from soilml.arrays import Floats
from soilml.config.case import Case, read_case
from soilml.errors import InputError
from soilml.fitting.coordinates import select_free
from soilml.identification.posterior import prior_fractions
from soilml.io.atomic_files import refuse_device
from soilml.io.bounds import JSON_BYTES
from soilml.io.declared_settings import take_declared
from soilml.io.toml_settings import Settings
from soilml.parameters import declared
from soilml.physics.soils import Soil
from soilml.quantities import NOT_IDENTIFIED_ABOVE
from soilml.remarks import Remark, about

#: Draws of the priors of a model file.
PRIOR_DRAWS = 400


@dataclass(frozen=True)
class SourceSoil:
    """The nine parameters of a soil in SI units, and how well they are known.

    source: The file that was read.
    values: Each parameter of `Soil` by name, in SI units.
    origin: Where each value is from: `rows`, `model file` or `prior`.
    intervals: Standard deviation and ends of the 90 % interval, by name, of the parameters from
        rows.
    draws: Equally weighted draws (count,) by name, of the parameters that are uncertain; empty
        where the file has none.
    remarks: What limits the values.
    no_draws: Why there are no draws; "" where there are.
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


def read_source_soil(path: str | os.PathLike[str]) -> SourceSoil:
    """The soil in the file that `soilml identify --out` wrote, or in a model file.

    path: A file whose name ends in .json or .toml.

    Raises `InputError` for a file that is neither, lacks the soil, or has several results.
    """
    file = Path(path)
    if file.suffix.lower() == ".toml":
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
    if not isinstance(content, dict) or not {"parameters", "runs"} & content.keys():
        raise InputError(f"{path} is no result of `soilml identify`; needed is its file of --out")
    settings = Settings(content, str(path))
    if "parameters" not in content:
        count, by = len(settings.table("runs").content), content.get("by", "run")
        raise InputError(
            f"{path} has {count} results; needed is one soil: soilml identify --where {by}=VALUE"
        )
    return _of_fit(settings, str(path))


def _of_fit(fit: Settings, path: str) -> SourceSoil:
    """The soil of one fit: identified values, and those that its model file fixed."""
    model = fit.table("model")
    if "soil" not in model:
        raise InputError(
            f"{path} lacks model.soil, the values that were not identified: write it again with "
            "soilml identify --out"
        )
    stated = take_declared(Soil, model.table("soil"))
    values = {name: float(getattr(stated, name)) for name in declared(Soil)}
    origin = dict.fromkeys(values, "model file")
    intervals, wide = dict[str, tuple[float, float, float]](), list[str]()
    entries = fit.table("parameters")
    for name in [name for name in entries.content if name in values]:
        entry = entries.table(name)
        values[name], origin[name] = entry.number("value"), "rows"
        intervals[name] = entry.number("std"), entry.number("p05"), entry.number("p95")
        if entry.number("remaining_fraction", 0.0) > NOT_IDENTIFIED_ABOVE:
            wide.append(name)
    others = [name for name in entries.content if name not in values]
    said = [
        Remark(str(e.get("code")), "", tuple(map(str, e.get("about", ()))))
        for e in fit.take("warnings", list, "a list of remarks", [])
        if isinstance(e, dict)
    ]
    warned = about(said, "not-identified") | about(said, "few-readings")
    wide += [name for name in intervals if name in warned and name not in wide]
    remarks = []
    if wide:
        text = f"the rows do not determine {', '.join(wide)}: one file hides that, --draws shows it"
        remarks.append(Remark("not-determined", text, tuple(wide)))
    remarks += _lost_effects([*model.take("effects", list, "a list of names", []), *others])
    draws = _draws(fit.take("draws", dict, "lists of numbers by name", {}), path)
    why = "only averaged and posterior of `soilml identify` draw samples, and not with --by"
    return SourceSoil(path, values, origin, intervals, draws, tuple(remarks), "" if draws else why)


def _lost_effects(names: list[str]) -> list[Remark]:
    text = f"the model has {', '.join(names)}: no target knows these, and forces will differ"
    return [Remark("effects-lost", text, tuple(names))] if names else []


def _draws(entry: dict[str, Any], path: str) -> dict[str, Floats]:
    """Draws (count,) of the soil's parameters; empty where the file has none."""
    bounds = declared(Soil)
    try:
        found = {n: np.asarray(v, dtype=np.float64) for n, v in entry.items() if n in bounds}
        right = all(
            own.ndim == 1 and np.all((own >= bounds[n].lower) & (own <= bounds[n].upper))
            for n, own in found.items()
        )
    except (TypeError, ValueError):
        found, right = {}, False
    sizes = {own.size for own in found.values()}
    if not right or len(sizes) > 1 or 0 in sizes:
        raise InputError(
            f"{path}: draws must be lists of numbers of one length within the bounds of the soil; "
            "write it again with soilml identify --out"
        )
    return found


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
    remarks += _lost_effects([effect.name for effect in case.model.effects])
    why = "" if draws else "its parameters have no prior in [soil.prior]"
    return SourceSoil(path, values, origin, {}, draws, tuple(remarks), why)
