"""Wheels of a rover for a slope: the question as a form over its text, and its answer."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from soilml.errors import InputError
from soilml.io.named_files import NamedFiles
from soilml.log_import.mapping.written_map import toml_value
from soilml.optional_imports import tomllib
from soilml.physics.soils import soil_catalogue
from soilml.report.page import Provenance, report_texts
from soilml.rover_design.presentation import design_page
from soilml.rover_design.report import design_report
from soilml.rover_design.study import LEAST, DesignStudy, read_study
from soilml.serve.answers.job_files import MODEL_FILE, Tell, setting_file, write_files

STUDY_FILE = "rover.toml"  # Name of the question in messages
#: Designs of the sweep and draws, by how thorough the answer is: the last is the command's default.
EFFORTS = {"quick": (60, 300), "usual": (100, 500), "thorough": (250, 1000)}


@dataclass(frozen=True)
class _Field:
    """A figure of the question.

    factor: What its value in the file is multiplied by to be in `unit`.
    kind: `number`; `range`, a number or two; `choice`; `names`, a list of texts.
    place: Index in a list of two figures; -1 for a figure of its own.
    """

    table: str
    key: str
    label: str
    unit: str = ""
    factor: float = 1.0
    kind: str = "number"
    place: int = -1
    choices: tuple[str, ...] = ()


_FIELDS = (
    _Field("rover", "mass", "Mass", "kg", kind="range"),
    _Field("rover", "wheels", "Wheels", kind="range"),
    _Field("rover", "wheelbase", "Wheelbase", "mm", 1e3),
    _Field("rover", "centre_of_mass", "Centre of mass ahead of the middle", "mm", 1e3, place=0),
    _Field("rover", "centre_of_mass", "Centre of mass above the ground", "mm", 1e3, place=1),
    _Field("rover", "gravity", "Gravity", kind="choice", choices=("earth", "moon", "mars")),
    _Field("wheel", "radius", "Radius", "mm", 1e3, "range"),
    _Field("wheel", "width", "Width", "mm", 1e3, "range"),
    _Field("wheel", "lug_height", "Lug height", "mm", 1e3, "range"),
    _Field("goal", "slope", "Slope", "deg"),
    _Field("goal", "margin", "Pull that must be left", "N"),
    _Field("goal", "risk", "Risk of failing that is accepted", "%", 1e2),
    _Field("goal", "least", "Least is best of", kind="choice", choices=LEAST),
    _Field("soil", "names", "Soils, each as likely", kind="names"),
)
#: A value on a line: a text, a list, a table, or anything before a comment.
_VALUE = r"(?:\"[^\"]*\"|\[[^\]]*\]|\{[^}]*\}|[^#]*?)"
_ABSENT = {"margin": 0.0, "risk": 0.05, "least": "energy"}  # What a goal is without them


def question(request: dict[str, Any]) -> dict[str, Any]:
    """The text of a question after a change of a figure, and its figures.

    Without a text it is the example's. `change` is {field, value}: the number of a field, and its
    value in shown units: a number, two for a range, a text, a list of texts, or for the soil
    {rows: name of a table of runs}.

    Raises `InputError` for a text that is no TOML, and a value that the file cannot have.
    """
    text = request.get("question")
    if not isinstance(text, str) or not text.strip():
        text = files("soilml.rover_design").joinpath("example.toml").read_text(encoding="utf-8")
    change = request.get("change") or {}
    if change:
        text = _changed(text, change)
    content = _parsed(text)
    fields = [
        {
            "label": f.label, "unit": f.unit, "kind": f.kind, "table": f.table,
            "choices": list(f.choices) or (sorted(soil_catalogue()) if f.kind == "names" else []),
            "value": _shown(f, content), "rows": _rows(f, content),
        }
        for f in _FIELDS
    ]  # fmt: skip
    return {"question": text, "fields": fields, "efforts": list(EFFORTS)}


def _parsed(text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{STUDY_FILE} is no valid TOML: {error}") from None


def _rows(field: _Field, content: Mapping[str, Any]) -> str | None:
    """The table of runs whose soil the question asks about, at the field of the soils."""
    table = content.get(field.table, {})
    runs = table.get("runs") if field.kind == "names" and isinstance(table, dict) else None
    return runs if isinstance(runs, str) else None


def _shown(field: _Field, content: Mapping[str, Any]) -> Any:
    """The value of a figure in its shown unit; None where the text has it in another form."""
    table = content.get(field.table, {})
    value = table.get(field.key, _ABSENT.get(field.key)) if isinstance(table, dict) else None
    if field.place >= 0:
        value = value[field.place] if isinstance(value, list) and len(value) == 2 else None
    if _rows(field, content) is not None:
        return []
    if field.kind in ("choice", "names"):
        return value if isinstance(value, str | list) else None
    if isinstance(value, str) and (match := re.fullmatch(r"\s*([\d.]+)\s*deg\s*", value)):
        return float(match[1])
    numbers = value if isinstance(value, list) and field.kind == "range" else [value]
    shown = [float(f"{field.factor * x:.12g}") for x in numbers
             if isinstance(x, int | float) and not isinstance(x, bool)]  # fmt: skip
    if not shown or len(shown) < len(numbers):
        return None
    return shown if field.kind == "range" else shown[0]


def _changed(text: str, change: Mapping[str, Any]) -> str:
    number = change.get("field")
    if isinstance(number, bool) or not isinstance(number, int | float) or not (
        0 <= int(number) < len(_FIELDS)
    ):  # fmt: skip
        raise InputError("field: needed is the number of a figure of the question")
    field, value = _FIELDS[int(number)], change.get("value")
    if field.kind == "names" and (isinstance(value, dict) or _rows(field, _parsed(text))):
        return _with_soil(text, value)
    written = toml_value(value) if field.kind == "choice" else _numbers(field, value, text)
    return _with_key(text, field.table, field.key, written)


def _with_soil(text: str, value: Any) -> str:
    """The text with another soil: that of a table of runs, or published ones instead of it.

    What else [soil] and its tables had belongs to the soil before.
    """
    if isinstance(value, dict):
        name = value.get("rows")
        if not isinstance(name, str) or not name:
            raise InputError("[soil] runs: needed is the name of a table of runs")
        lines = [f"model = {toml_value(MODEL_FILE)}", f"runs = {toml_value(name)}"]
    else:
        lines = [f"names = {_numbers(_FIELDS[-1], value, text)}"]
    kept, own = [], False
    for line in text.splitlines():
        if head := re.match(r"\s*\[+\s*([^\]]*?)\s*\]", line):
            own = head[1] == "soil" or head[1].startswith("soil.")
        if not own:
            kept.append(line)
    changed = "\n".join([*"\n".join(kept).rstrip().splitlines(), "", "[soil]", *lines]) + "\n"
    _parsed(changed)
    return changed


def _numbers(field: _Field, value: Any, text: str) -> str:
    """A value of the form as it stands in the file."""
    given = value if isinstance(value, list) else [value]
    if field.kind == "names":
        if not given or not all(isinstance(x, str) for x in given):
            raise InputError(f"[{field.table}] {field.key}: needed is at least one soil")
        return toml_value(given)
    if not given or not all(isinstance(x, int | float) and not isinstance(x, bool) for x in given):
        raise InputError(f"[{field.table}] {field.key}: needed is a number")
    if field.unit == "deg":
        return f'"{given[0]:.10g} deg"'
    numbers = [f"{x / field.factor:.10g}" for x in given]
    if field.place >= 0:
        both = _parsed(text).get(field.table, {}).get(field.key)
        both = list(both) if isinstance(both, list) and len(both) == 2 else [0.0, 0.0]
        both[field.place] = float(numbers[0])
        return toml_value(both)
    equal = len(numbers) == 1 or numbers[0] == numbers[1]
    return numbers[0] if equal else f"[{', '.join(numbers)}]"


def _with_key(text: str, table: str, key: str, value: str) -> str:
    """The text with another value of a key of a table, and its comments as they are."""
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if re.match(rf"\s*\[{table}\]", line)]
    if not heads:
        lines, heads = [*lines, "", f"[{table}]"], [len(lines) + 1]
    after = heads[0] + 1
    while after < len(lines) and not re.match(r"\s*\[", lines[after]):
        found = re.match(rf"(\s*{key}\s*=\s*){_VALUE}(\s*#.*)?$", lines[after])
        if found:
            lines[after] = f"{found[1]}{value}{found[2] or ''}"
            break
        after += 1
    else:
        lines.insert(heads[0] + 1, f"{key} = {value}")
    changed = "\n".join(lines) + "\n"
    _parsed(changed)
    return changed


def answer(request: dict[str, Any], tell: Tell) -> dict[str, Any]:
    """The verdict, the picture and the tables of a design, and the names of the written files.

    The soil of measured rows is that of the page's table and model.

    Raises `InputError` as `soilml plan wheels` does, and for other files than these.
    """
    names = request.get("names") or []
    # the soil of measured rows is that of the page's model and table
    files = NamedFiles(names=(MODEL_FILE, *names), hint="drop the table of runs above")
    study = read_study(setting_file(STUDY_FILE, request.get("question")), files)
    settings = {STUDY_FILE: str(request["question"])}
    if study.soil.rows is not None:
        settings[MODEL_FILE] = _model_of_rows(study, request)
    effort = request.get("effort", "usual")
    if not isinstance(effort, str) or effort not in EFFORTS:
        raise InputError(f"effort is {effort!r}; needed is one of {', '.join(EFFORTS)}")
    designs, draws = EFFORTS[effort]

    def progress(stage: str, done: int, total: int) -> None:
        tell(stage, done / total if total else None)

    found = design_report(study, designs=designs, draws=draws, progress=progress)
    tell("drawing the report")
    page = design_page(found, STUDY_FILE)
    origin = Provenance.of(["design", STUDY_FILE], [STUDY_FILE])
    names = ("design_report.html", "design.json")
    texts = report_texts(page, origin, found.as_json(), names, Path())
    contents = {path.name: str(text) for path, text in texts.items()}
    return {
        "met": found.met,
        "badge": page.badge,
        "verdict": found.summary(),
        "next": page.next_steps[0] if page.next_steps else "",
        "picture": {"image": page.pictures[0].image.image, "alt": page.pictures[0].image.alt},
        "tables": [_table(t.caption, t.header, t.rows) for t in page.tables],
        "remarks": [str(text) for text in page.warnings],
        "files": write_files({**contents, **settings}),
    }


def _model_of_rows(study: DesignStudy, request: Mapping[str, Any]) -> str:
    """The text of the page's model, written to the file that a question about its rows names."""
    assert study.soil.rows is not None
    if str(study.soil.rows[0]) != MODEL_FILE:
        raise InputError(f"{STUDY_FILE} [soil]: needed is model = {MODEL_FILE!r}, that of the page")
    setting_file(MODEL_FILE, request.get("model"))
    return str(request["model"])


def _table(caption: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> dict[str, Any]:
    return {"title": caption, "heads": list(header), "rows": [list(row) for row in rows]}
