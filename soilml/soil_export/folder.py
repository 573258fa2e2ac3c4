"""The folder of an export: a soil, draws of it, what they mean, and what they cannot mean."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from soilml.errors import InputError, did_you_mean
from soilml.io.atomic_files import write_files
from soilml.parameters import declared, unit_text
from soilml.physics.soils import Soil
from soilml.remarks import Remark
from soilml.report.page import Content, Provenance, json_text
from soilml.report.report import Report
from soilml.report.tables import Column, ReportTable
from soilml.results import Result
from soilml.soil_export.source_soil import SourceSoil, read_source_soil
from soilml.soil_export.targets import TARGETS, SoilTarget

README, RECORD = "README.txt", "export.json"
FORMAT_VERSION = 1  # Raised where a key of export.json changes its meaning or goes
MOST_DRAWS = 9999


@dataclass(frozen=True, repr=False)
class SoilExport(Result):
    """A soil in the terms of a program.

    target: The program.
    known: What the file knows of the soil, in SI units.
    values, draws: Parameters by the program's names, in its units, and those of each draw.
    remarks: What limits the files: codes `not-determined`, `not-measured`, `effects-lost`,
        `defaulted`.
    """

    target: SoilTarget
    known: SourceSoil
    values: dict[str, float]
    draws: tuple[dict[str, float], ...]
    remarks: tuple[Remark, ...]

    def files(self, words: Sequence[str] = (), inputs: Iterable[str] = ()) -> dict[str, str]:
        """The text of every file of the folder, by its name.

        words: The words of the command line, for `export.json`.
        inputs: Files that were read.
        """
        files = self.target.written(self.values)
        digits = max(3, len(str(len(self.draws))))
        for number, values in enumerate(self.draws, 1):
            files |= self.target.written(values, f"_{number:0{digits}d}")
        names = [*files, README, RECORD]
        files[README] = f"{self.report().text(details=True)}\n"
        files[RECORD] = json_text(self.as_json(names, Provenance.of(words, inputs)))
        return files

    def as_json(self, names: Sequence[str], origin: Provenance) -> dict[str, Any]:
        """The content of `export.json`."""
        units = self.target.units
        parameters = {
            name: {"value": value, "unit": units[name], "from": self.origin(name)}
            for name, value in self.values.items()
        }
        return {
            "format": "soilml-soil-export",
            "version": FORMAT_VERSION,
            "target": self.target.name,
            "source": self.known.source,
            "parameters": parameters,
            "ignored": dict(self.target.ignored),
            "draws": len(self.draws),
            "remarks": [remark.as_json() for remark in self.remarks],
            "written": list(names),
            **origin.as_json(),
        }

    def origin(self, name: str) -> str:
        """Where the value of a parameter is from: `rows`, `model file`, `prior` or `default`."""
        for own in self.target.mapped:
            if own.name == name:
                return ", ".join(dict.fromkeys(self.known.origin[part] for part in own.soil))
        return "default"

    def frame_columns(self) -> dict[str, Any]:
        """A row for each parameter, in the units of the program."""
        why = {own.name: own.equation for own in self.target.mapped}
        why |= {own.name: own.reason for own in self.target.fixed}
        return {
            "parameter": list(self.values),
            "known from": [self.origin(name) for name in self.values],
            "value": list(self.values.values()),
            "unit": [unit_text(self.target.units[name]) for name in self.values],
            "equation": [why[name] for name in self.values],
        }

    def report(self) -> Report:
        """The parameters with their equations; how the program reads them, and what it ignores."""
        target, known = self.target, self.known
        columns = [Column(head, own, digits=6) for head, own in self.frame_columns().items()]
        tables = [ReportTable("Parameters", columns)]
        if known.intervals:
            std, low, high = (list(ends) for ends in zip(*known.intervals.values(), strict=True))
            bounds = declared(Soil)
            identified = {
                "parameter": list(known.intervals),
                "mean": [known.values[name] for name in known.intervals],
                "std": std,
                "low": low,
                "high": high,
                "unit": [bounds[name].unit for name in known.intervals],
            }
            tables.append(ReportTable.of_parameters("Identified", identified))
        details = [
            ("How the program reads them", [target.loading]),
            ("Ignored by the program", [f"{name}: {why}" for name, why in target.ignored.items()]),
            ("What is lost", target.lost),
            ("Sources", target.sources),
        ]
        draws = (
            f"{len(self.draws)} equally likely soils keep the correlations of the parameters: "
            f"simulate each, and take the spread of the results as that of the soil."
        )
        return Report(
            kind="export",
            verdict=f"Soil of {Path(known.source).name} for {target.program}.",
            lines=[draws] if self.draws else [],
            tables=tables,
            remarks=self.remarks,
            details=[(head, texts) for head, texts in details if texts],
            title=f"Soil for {target.name}",
        )


def export_soil(
    source: str | os.PathLike[str],
    to: str,
    out: str | os.PathLike[str] | None = None,
    *,
    draws: int = 0,
    seed: int = 0,
    words: Sequence[str] = (),
) -> SoilExport:
    """Write the soil of a fit, or of a model file, as a simulator takes it.

    Parameters
    ----------
    source
        result.json of `soilml identify --out`, or a model file.
    to
        A key of `TARGETS`.
    out
        Folder for the files; it is made where it is missing. None: nothing is written.
    draws
        Number of draws of the posterior, or of the priors of a model file, as files of their own.
    seed
        Seed of the choice of draws.
    words
        Words of the command line, for `export.json`.

    Returns
    -------
    SoilExport

    Raises
    ------
    InputError
        For a target that does not exist, for values that the program would misread, and
        where the source has not as many draws.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from pathlib import Path
    >>> from soilml import export_soil
    >>> text = '''
    ... [gear]
    ... type = "wheel"
    ... radius = 0.15
    ... width = 0.12
    ... [soil]
    ... name = "wong1989/dry_sand"
    ... '''
    >>> with TemporaryDirectory() as folder:
    ...     model = Path(folder) / "model.toml"
    ...     _ = model.write_text(text)
    ...     export = export_soil(model, "chrono", Path(folder) / "chrono")
    >>> print(export.values["Bekker_n"], round(export.values["Mohr_friction"], 2), "degrees")
    1.1 28.0 degrees
    """
    if to not in TARGETS:
        raise InputError(f"--to {to!r}; {did_you_mean(to, TARGETS)}there are: {', '.join(TARGETS)}")
    target = TARGETS[to]
    if not 0 <= draws <= MOST_DRAWS:
        raise InputError(f"--draws is {draws}; needed is a whole number from 0 to {MOST_DRAWS}")
    known = read_source_soil(source)
    remarks = list(known.remarks)
    for own in target.fixed:
        text = f"{own.name} = {own.value:g} {unit_text(own.unit)} is a default: {own.reason}"
        remarks.append(Remark("defaulted", text, (own.name,)))
    values = target.values(known.values)
    soils = known.drawn(draws, seed) if draws else []
    drawn = tuple(target.values(soil) for soil in soils)
    used = {part for own in target.mapped for part in own.soil}
    of_soil = ("not-determined", "not-measured")  # of no interest where the program has no use
    kept = tuple(r for r in remarks if r.code not in of_soil or used & {*r.about})
    export = SoilExport(target, known, values, drawn, kept)
    if out is not None:
        _write(export, Path(out), words)
    return export


def _write(export: SoilExport, folder: Path, words: Sequence[str]) -> None:
    """Write the folder as one set; draws of an earlier export there are removed."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder} is a file; needed is a folder")
    files: dict[Path, Content] = {
        folder / name: text for name, text in export.files(words, [export.known.source]).items()
    }
    old = [path for path in _earlier(folder) if path not in files]
    write_files(files, folders=[folder], remove=old)


def _earlier(folder: Path) -> list[Path]:
    """The files that an earlier export wrote into the folder."""
    try:
        names = json.loads((folder / RECORD).read_text(encoding="utf-8"))["written"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    plain = [name for name in names if isinstance(name, str) and Path(name).name == name]
    return [folder / name for name in plain if (folder / name).is_file()]
