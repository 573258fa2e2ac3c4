"""Published single-wheel tests through the gap workflow: `make gap-real SOILML_DATA=...`.

Every set is analysed with three sets of priors; the reports are in
`demo/gap/real/SET/PRIORS/report`, and `--write` writes bench/results/gap-measured.md.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import io
import json
import math
import os
import sys
import tomllib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

from measured_sets import PRIORS, SETS, MeasuredSet, model_text, table_text
from runner import RESULTS, machine, source_state, source_version
from slips_kept_back import Errors, errors, table, verdict

from soilml.cli import main
from soilml.cli.progress import progress_bar
from soilml.io.atomic_files import save_text
from soilml.processes import process_map

HERE = Path(__file__).parent
OUT = Path("demo/gap/real")
PAGE = RESULTS / "gap-measured.md"
KEPT_BACK = "init"  # The priors with which slips are kept back
SUSPECTED = "suspected"  # The status of a report that ranks suspects and states no cause
UNDECIDED = "undecided"
#: Held-out parts, the first of which a report has is shown.
PARTS = {"held_out_runs": "runs", "held_out_slips": "slips", "held_out_region": "region"}

Found = dict[str, dict[str, dict[str, Any]]]


def run(arguments: list[str] | None = None) -> None:
    """Analyse all sets, print the tables, and write the page where that is asked for."""
    args = _arguments(arguments)
    data = Path(os.environ.get("SOILML_DATA", ""))
    sets = [s for s in SETS if not args.only or s.name in args.only]
    if missing := sorted({s.file for s in sets if not (data / s.file).is_file()}):
        sys.exit(f"set SOILML_DATA to the folder that contains {', '.join(missing)}")
    for one in sets:
        for priors in PRIORS:
            save_text(_folder(one, priors) / "runs.csv", table_text(one, data))
            save_text(_folder(one, priors) / "model.toml", model_text(one, priors))
    jobs = [str(_folder(one, priors)) for one in sets for priors in PRIORS]
    reports = _of_all(analyse, jobs, args.jobs, "sets")
    jobs_kept = [str(_folder(one, KEPT_BACK)) for one in sets]
    kept = _of_all(kept_back, jobs_kept, args.jobs, "sets, slips kept back")
    found: Found = {}
    for job, report in zip(jobs, reports, strict=True):
        found.setdefault(Path(job).parent.name, {})[Path(job).name] = report
    text = page(sets, found, {s.name: own for s, own in zip(sets, kept, strict=True)})
    print(text)
    if args.write:
        save_text(PAGE, text)


def _of_all(
    work: Callable[[str], dict[str, Any]], jobs: list[str], workers: int | None, label: str
) -> list[dict[str, Any]]:
    """The results of all jobs, in their order."""
    with process_map(work, jobs, workers) as results, progress_bar(label, len(jobs)) as done:
        found = []
        for count, result in enumerate(results, 1):
            found.append(result)
            done(count)
    return found


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", metavar="SET", choices=[s.name for s in SETS])
    parser.add_argument("--jobs", type=int, help="analyses at a time (default: cores)")
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name}")
    return parser.parse_args(arguments)


def _folder(one: MeasuredSet, priors: str) -> Path:
    folder = OUT / one.name / priors
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def analyse(folder: str) -> dict[str, Any]:
    """The content of gap.json of the model and the runs in a folder; a crash is a finding too.

    A report that the same state of the package made of the same files is not made again.
    """
    place = Path(folder)
    kept, mark = place / "report" / "gap.json", place / "state"
    if (known := _known(kept, mark)) is not None:
        return known
    words = [
        "gap",
        str(place / "model.toml"),
        str(place / "runs.csv"),
        "--out",
        str(place / "report"),
    ]
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            code = main(words)
        if code == 0:
            save_text(mark, _state(place))
            return dict(json.loads(kept.read_text()))
        return {"status": f"exit status {code}"}
    except Exception as error:  # a crash is a finding of the page, not its end
        return {"status": f"crash: {type(error).__name__}"}


def kept_back(folder: str) -> Errors:
    """The errors of predicted slips that were kept back, of the runs in a folder; see `analyse`."""
    place = Path(folder)
    kept, mark = place / "kept_back.json", place / "kept_back.state"
    if (known := _known(kept, mark)) is not None:
        return known
    found = errors(folder)
    save_text(kept, json.dumps(found))
    save_text(mark, _state(place))
    return found


def _known(kept: Path, mark: Path) -> dict[str, Any] | None:
    """What the same state of the package wrote before; else None, and its mark is gone."""
    if kept.is_file() and mark.is_file() and mark.read_text() == _state(mark.parent):
        return dict(json.loads(kept.read_text()))
    mark.unlink(missing_ok=True)
    return None


def _state(place: Path) -> str:
    """A digest of the package, of the model and of the runs."""
    digest = sha256(source_state().encode())
    for name in ("model.toml", "runs.csv"):
        digest.update((place / name).read_bytes())
    return digest.hexdigest()[:16]


def first_of(report: dict[str, Any]) -> str:
    """The likeliest explanation that a report states or suspects, '' without one."""
    if report["status"] == SUSPECTED:
        for suspect in report.get("suspects") or ():
            return " + ".join(suspect["effects"])
    for names in report.get("cause_set") or ():
        return " + ".join(names)
    return ""


def page(sets: list[MeasuredSet], found: Found, kept: dict[str, Errors]) -> str:
    """The page: tables as measured, text from its template.

    kept: Errors of slips that were kept back, by set.
    """
    import jinja2

    template = jinja2.Environment(autoescape=False, keep_trailing_newline=True).from_string(
        (HERE / "measured_page.md.j2").read_text()
    )
    firsts = {s.name: [first_of(found[s.name][p]) for p in PRIORS] for s in sets}
    rows = []
    for one in sets:
        reports = [found[one.name][p] for p in PRIORS]
        odds = [_log_odds_of_first(report) for report in reports]
        cells = [
            f"{first} ({_odds(own)})" if first and own is not None else f"`{report['status']}`"
            for first, own, report in zip(firsts[one.name], odds, reports, strict=True)
        ]
        rows.append([one.title, *cells, _survives(firsts[one.name], odds)])
    agree, open_ = (sum(row[-1] == text for row in rows) for text in ("yes", UNDECIDED))
    return template.render(
        title="Gap workflow: published tests",
        measured=f"{datetime.date.today()}, {source_version()}. {machine()}",
        sets=[{"name": s.name, "title": s.title, "table": _set_table(found[s.name])} for s in sets],
        beliefs=tomllib.loads((HERE / "beliefs.toml").read_text()),
        summary=_table(["set", *PRIORS, "survives"], rows),
        kept_back=_table(*table({s.name: s.title for s in sets}, kept)),
        kept_back_verdict=verdict(list(kept.values())),
        count=f"The first explanation is the same with all three in {agree} of {len(rows)} sets; "
        f"in {open_} others, none is likelier than not with any of them.",
    )


def _log_odds_of_first(report: dict[str, Any]) -> float | None:
    """Logarithm of the odds of the first suspect; None without one."""
    return next((float(s["log_odds"]) for s in report.get("suspects") or ()), None)


def _survives(firsts: list[str], log_odds: list[float | None]) -> str:
    """Whether all sets of priors give the same first explanation, or none that is likely."""
    if not any(firsts):
        return "no cause"
    if len(set(firsts)) == 1:
        return "yes"
    return UNDECIDED if all(own is None or own < 0.0 for own in log_odds) else "**no**"


def _set_table(reports: dict[str, dict[str, Any]]) -> str:
    rows = []
    for priors in PRIORS:
        report = reports[priors]
        suspects = [
            f"{' + '.join(s['effects'])} ({_odds(s['log_odds'])})"
            for s in (report.get("suspects") or ())[:3]
        ]
        stated = () if report["status"] == SUSPECTED else report.get("cause_set") or ()
        causes = " or ".join(" + ".join(names) for names in stated)
        shown = report.get("gap") or {}
        part = next((p for p in PARTS if p in shown), "")
        held = f"{PARTS[part]}: {_change(shown[part])}" if part else "-"
        train = _change(shown["train"]) if "train" in shown else "-"
        rows.append(
            [priors, f"`{report['status']}`", causes or "; ".join(suspects) or "-", train, held]
        )
    return _table(["priors", "status", "explanations, with odds", "fitted rows", "held out"], rows)


def _change(part: dict[str, Any]) -> str:
    return f"{part['before']:.3g} -> {part['after']:.3g}"


def _odds(log_odds: float) -> str:
    ratio = math.exp(min(abs(log_odds), 50.0))
    return f"{ratio:.2g} to 1" if log_odds > 0.0 else f"1 to {ratio:.2g}"


def _table(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


if __name__ == "__main__":
    run()
