"""The tables of docs/validation.md, from those in `bench/results`: `python bench/validation.py`.

`make pages` writes them into the page, with the figure that `bench/run.py gap` draws.
"""

from __future__ import annotations

import re
import sys
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from runner import RESULTS

from soilml.report.aligned_text import format_table

Line = dict[str, str]
_NAMED, _FALSE = "right cause in the cause set, SNR >= 3, discrepancy", "falsely unique:"
_HELD, _INTERVAL = "held out between,", "coverage, discrepancy 2%"
#: Figures of the gap workflow that the page shows: their beginnings, and what the page calls them.
GATES = {
    f"{_NAMED} 0%": "right cause in the set, no smooth error",
    f"{_NAMED} 4%": "the same, smooth error of 4 %",
    "right when unique, all tiers": "right where one cause is named",
    f"{_FALSE} null": "one cause named, nothing hidden",
    f"{_FALSE} discrepancy alone": "one cause named, smooth error alone",
    f"{_FALSE} tiers L, T and C": "wrong cause named, laws, changes, others",
    "one load, SNR >= 3: truth first among suspects": "one load: right suspect first",
    "5 to 10 rows at one load, SNR >= 3: truth in the": "5 to 10 rows: in the first three",
    "stated probabilities from 0.02, expected": "error of stated probabilities",
    f"{_HELD} returned model over soil alone: median": "rows kept back, error over soil alone",
    f"{_HELD} over a Gaussian process alone, discrepancy 2%": "the same over a process",
    f"90 % interval of phi: {_INTERVAL}": "coverage of phi after naming",
}
#: Speeds: result, beginning of the line, column, name on the page, goal.
SPEEDS = (
    ("speed", "rigid wheel, driving", 1, "equilibria of a driving wheel in a second", "800,000"),
    ("commands", "`identify` 64 rows, nonlinear", 1, "`identify`, 64 rows, nonlinear", "50 ms"),
    ("commands", "`identify` 64 rows, posterior", 1, "`identify`, 64 rows, posterior", "1 s"),
    ("board", "wheel.onnx", 3, "one reading, `wheel`, onnxruntime, us", "60"),
    ("board", "wheel.onnx", 7, "16 readings, `wheel`, onnxruntime, us", "none"),
    ("board", "any_wheel.onnx", 7, "16, `any_wheel`, onnxruntime, us", "none"),
    ("c", "wheel set of 16, with errors", 4, "16, `wheel`, in C, us", "half of onnxruntime"),
    ("c-memory", "wheel_small", 4, "working memory of `wheel_small` in C, kB", "24"),
)


def tables_of(name: str) -> list[list[list[str]]]:
    """All tables of a result, as rows of cells with the heading first: Markdown or text."""
    found: list[list[list[str]]] = []
    for block in re.split(r"\n\s*\n", (RESULTS / f"{name}.md").read_text(encoding="utf-8")):
        lines = [line for line in block.splitlines() if not line.startswith("```")]
        if all(line.startswith("|") for line in lines) and len(lines) > 1:
            rows = [[c.strip() for c in line.strip().strip("|").split("|")] for line in lines]
            found.append([rows[0], *rows[2:]])
        elif len(lines) > 1 and re.fullmatch(r"[-\s]+", lines[1]):
            found.append([re.split(r"\s{2,}", line.strip()) for line in (lines[0], *lines[2:])])
    return found


def lines_of(name: str, *heads: str) -> list[Line]:
    """Lines of the first table of a result that has these headings."""
    for head, *rows in tables_of(name):
        if set(heads) <= set(head):
            return [dict(zip(head, row, strict=False)) for row in rows]
    raise SystemExit(f"bench/results/{name}.md has no table with {', '.join(heads)}")


def gap_table() -> str:
    """Gates of the gap workflow, and how many are met."""
    every = lines_of("gap", "figure", "measured", "gate")
    gated = [line for line in every if line["met"]]
    rows = []
    for start, words in GATES.items():
        own = next(line for line in every if line["figure"].startswith(start))
        shown = re.sub(r" \((\d+ sets)\)|; by chance.*", "", own["measured"])
        rows.append((words, shown, own["gate"], own["met"].replace("*", "")))
    met = sum(line["met"] == "yes" for line in gated)
    head = ("blind sets", "measured (95 % interval), of", "gate", "met")
    return f"Gap workflow: {met} of {len(gated)} gates are met.\n\n{format_table(head, rows, 2)}"


def sets_table() -> str:
    """Files beside the exact posterior: RMSE over all sizes, and coverage."""
    ratios = lines_of("sets", "file, sets", "rows", "refused")
    covered = {x["file, sets"]: x for x in lines_of("sets", "subset", "c") if x["subset"] == "all"}
    rows = []
    for name in dict.fromkeys(line["file, sets"] for line in ratios):
        if name not in covered:
            continue
        own = [float(x[s]) for x in ratios if x["file, sets"] == name for s in ("c", "phi", "K")]
        held = ", ".join(covered[name][s].split(" / ")[0] for s in ("c", "phi", "K"))
        ends = f"{min(own):.3f} to {max(own):.3f}"
        rows.append((name, ends, held))
    head = ("file, sets of 1 to 32 rows", "RMSE over exact", "coverage")
    return f"Sets beside the Bayes limit\n\n{format_table(head, rows)}"


#: Parts of `model-errors` and their names on the page; answers, and theirs.
PARTS = {
    "Wrong sensors, wrong laws": "sensors and laws wrong",
    "Mechanisms of the blind sets that no error describes": "unlisted mechanisms",
}
#: The answer that assumes a perfect model, and the default.
ANSWERS = ("typical errors of sensors", "inferred"), ("posterior", "averaged")


def worlds_table() -> str:
    """Coverage and score where sensors or model are wrong, of the exact mode and of the default."""
    (exact, default), own = ANSWERS
    rows, text = [], (RESULTS / "model-errors.md").read_text(encoding="utf-8")
    for channels in ("torque", "all channels"):
        for title, short in PARTS.items():
            section = text.partition(f"### {title}, {channels}\n")[2].partition("\n###")[0]
            lines = [line.strip("|").split("|") for line in section.splitlines()]
            cells = [[c.strip() for c in line] for line in lines]
            found = {c[1]: (c[3], c[-1]) for c in cells if "mean" in c[0]}
            rows.append((f"`wheel`, {short}, {channels}", *found[exact], *found[default]))
    every = lines_of("identify-errors", "what is wrong", "channels", "answer")
    means = [line for line in every if line["what is wrong"] == "mean"]
    for channels in dict.fromkeys(line["channels"] for line in means):
        of = {line["answer"]: line for line in means if line["channels"] == channels}
        both = [of[answer][key] for answer in own for key in ("90 % of c, phi, K", "score")]
        rows.append((f"`identify`, {PARTS['Wrong sensors, wrong laws']}, {channels}", *both))
    head = ("mean over worlds", "exact mode, %", "score", "default, %", "score")
    return f"Where sensors or the model are wrong\n\n{format_table(head, rows, 2)}"


#: Share of sets flagged that counts as detected, and coverage of all three that is harmless, %.
DETECTED, HARMLESS = 95.0, 85.0
OUTCOMES = ("flagged", "covered", "neither")


def faults_line() -> str:
    """How many faults are flagged, and how many of the others leave the intervals valid."""
    said = []
    for part in ("torque", "all channels"):
        count = Counter(
            _outcome(line)
            for line in lines_of("faults-on-board", "fault", "channels", "detector")
            if line["channels"] == part and not line["fault"].startswith("no fault")
        )
        said.append(f"{part}: " + ", ".join(f"{count[what]} {what}" for what in OUTCOMES))
    return (
        "Faults, sets of 16 rows: flagged in 95 %, else intervals cover 85 %, or neither.\n"
        + ";\n".join(said)
        + "."
    )


def _outcome(line: Line) -> str:
    if max(float(line["answer"]), float(line["detector"])) >= DETECTED:
        return "flagged"
    covered = line["covered: c, phi, K"].split(" / ")
    held = min(float(share) for share in covered) >= HARMLESS
    return "covered" if held else "neither"


#: Worlds of days and maps that the page shows.
DAYS = ("as modelled", "slip-sinkage 0.3", "all typical errors")
MAPS = ("changes and drift", "changes and drift, all typical errors")


def drives_table() -> str:
    """A day of driving, slip without odometry, maps."""
    rows = []
    for line in lines_of("streams", "world", "answer"):
        if line["answer"] == "tracker, averaged" and line["world"] in DAYS:
            held = line["coverage of 90 % intervals: c / phi / K"]
            said = f"{line['alarms per 1000 rows']} alarms"
            rows.append((f"tracker, {line['world']}", held, said))
    for line in lines_of("slip-unknown", "drives", "filter: rmse"):
        if not line["drives"].startswith("-"):
            name = f"slip, {line['drives']}"
            rows.append((name, line["filter: covered"], f"rmse {line['filter: rmse']}"))
    for line in lines_of("map", "drives", "answer"):
        if line["answer"] == "map" and line["drives"] in MAPS:
            told = f"log density {line['density'].split()[0]}"
            rows.append((f"map, {line['drives']}", line["covered: c / phi / K"], told))
    head = ("simulated drives", "coverage of 90 % intervals", "and")
    return f"Drives\n\n{format_table(head, rows, 3)}"


def speed_table() -> str:
    """Speed and memory beside their goals."""
    rows = []
    for name, start, column, words, goal in SPEEDS:
        every = [row for own in tables_of(name) for row in own[1:]]
        row = next(r for r in every if " ".join(r).startswith(start))
        rows.append((words, row[column], goal))
    return f"Speed and memory\n\n{format_table(('what', 'measured', 'goal'), rows)}"


def adapt_line() -> str:
    """What a board gains by an adaptation."""
    (_, *rows), (_, own, right) = tables_of("adapt")[:2]
    return (
        f"Adaptations.\n{len(rows)} campaigns, each with a hidden effect. On other soils the "
        f"error after over before has the\nmedian {own[1]}; it is larger in {own[3]}. Over that "
        f"with the old model assumed perfect: {right[1]}; {right[3]}."
    )


def main() -> None:
    """Print all tables."""
    tables = (gap_table(), sets_table(), worlds_table(), faults_line(), adapt_line())
    print("\n\n".join((*tables, drives_table(), speed_table())))


if __name__ == "__main__":
    main()
