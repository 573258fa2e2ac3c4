"""One runner for all benches: cases give records, records give tables.

A bench declares its cases, what is measured of one, and the tables of all records. The runner
measures cases side by side, keeps each record as soon as it is there, and takes up an ended run
where it stopped, unless the code has changed since. A whole run is written to `bench/results`:
the records as JSON with command, date, machine and version, and the tables made of them.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from soilml.cli.progress import progress_bar
from soilml.io.atomic_files import save_text
from soilml.processes import process_map

ROOT = Path(__file__).parents[1]
RESULTS, UNFINISHED = ROOT / "bench" / "results", ROOT / "build" / "bench"
#: What records depend on: files of these folders and endings.
SOURCES = ("soilml", "datagen", "training", "bench", "exported")
ENDINGS = (".py", ".toml", ".csv", ".onnx")
Row = dict[str, Any]


@dataclass(frozen=True)
class Sample:
    """How much of a bench is measured: a small sample where `quick`, and seeds to tune on."""

    quick: bool = False
    seeds: tuple[int, ...] = ()

    def of(self, whole: Sequence[Any], few: int = 1) -> list[Any]:
        """All of some seeds or other values, the first few of them, or the seeds of the user."""
        return list(self.seeds or (whole[:few] if self.quick else whole))


@dataclass(frozen=True)
class Bench:
    """A question with its cases.

    cases: Of a sample; each is an object of JSON, which tells it from the others.
    measure: What one case gives: a row, or several. Each row has the members of its case too.
    tables: Markdown, of all rows.
    draw: Draws a picture of all rows into a file.
    timed: Cases are measured one after another.
    long: Left out where all benches are asked for.
    """

    name: str
    title: str
    about: str
    cases: Callable[[Sample], Iterable[Row]]
    measure: Callable[[Row], Row | list[Row]]
    tables: Callable[[list[Row]], str]
    draw: Callable[[list[Row], Path], None] | None = None
    timed: bool = False
    long: bool = False


def one_case(sample: Sample) -> list[Row]:
    """The cases of a bench that has a single one."""
    return [{"quick": sample.quick}]


def run(
    bench: Bench, cases: Sequence[Row], workers: int | None = None, folder: Path = UNFINISHED
) -> list[Row]:
    """The records of all cases, in their order; those kept by an ended run are not made again."""
    file, state = folder / f"{bench.name}.jsonl", source_state()
    kept = {_key(own["case"]): own for own in _kept(file, state)}
    left = [case for case in cases if _key(case) not in kept]
    file.parent.mkdir(parents=True, exist_ok=True)
    with (
        file.open("a", encoding="utf-8") as part,
        process_map(bench.measure, left, 1 if bench.timed else workers) as found,
        progress_bar(f"{bench.name}, cases", len(left)) as done,
    ):
        for number, (case, rows) in enumerate(zip(left, found, strict=False), 1):
            line = json.dumps({"state": state, "case": case, "rows": plain(rows)})
            part.write(f"{line}\n")
            part.flush()
            kept[_key(case)] = json.loads(line)
            done(number)
    if source_state() != state:
        sys.exit(f"{bench.name}: code, recipes or released files changed meanwhile; run it again")
    return [{"case": (own := kept[_key(c)])["case"], "rows": own["rows"]} for c in cases]


def _kept(file: Path, state: str) -> Iterator[Row]:
    """Records of this state of the code; the last line of a run that was killed may be broken."""
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            continue
        if record["state"] == state:
            yield record


def _key(case: Row) -> str:
    return json.dumps(plain(case), sort_keys=True)


def rows_of(records: Iterable[Row]) -> list[Row]:
    """All rows, each with the members of its case."""
    return [
        record["case"] | row
        for record in records
        for row in (record["rows"] if isinstance(record["rows"], list) else [record["rows"]])
    ]


def plain(value: Any) -> Any:
    """A value as JSON has it; numbers with nine digits."""
    if isinstance(value, Mapping):
        return {key: plain(own) for key, own in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(own) for own in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, np.generic):
        value = value.item()
    return float(f"{value:.9g}") if isinstance(value, float) else value


def write(bench: Bench, records: list[Row], command: str, folder: Path = RESULTS) -> None:
    """Records and tables of a whole run."""
    head = {
        "bench": bench.name,
        "command": command,
        "date": datetime.date.today().isoformat(),
        "version": source_version(),
        "machine": machine(),
    }
    lines = ",\n".join(json.dumps(record) for record in records)
    text = f'{json.dumps(head, indent=1)[:-2]},\n "records": [\n{lines}\n]}}\n'
    save_text(folder / f"{bench.name}.json", text)
    render(bench, head, rows_of(records), folder)


def render(bench: Bench, head: Row, rows: list[Row], folder: Path = RESULTS) -> None:
    """Write the page of a bench, and its picture."""
    save_text(folder / f"{bench.name}.md", page(bench, head, rows))
    if bench.draw is not None:
        bench.draw(rows, folder / f"{bench.name}.png")


def page(bench: Bench, head: Row, rows: list[Row]) -> str:
    """The page of a bench in `bench/results`."""
    picture = f"![{bench.name}]({bench.name}.png)\n\n" if bench.draw else ""
    return (
        f"# {bench.title}\n\n**Measured** by `{head['command']}` on {head['date']}, "
        f"{head['version']}. {head['machine']}\n\n{bench.about}\n\n"
        f"{picture}{bench.tables(rows).strip()}\n"
    )


def main(benches: Sequence[Bench], words: Sequence[str] | None = None) -> None:
    """The command line of all benches."""
    known = {bench.name: bench for bench in benches}
    parser = argparse.ArgumentParser(
        description="Measure benches, and write records and tables into bench/results.",
        epilog="benches: " + ", ".join(known),
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="default: all but long ones")
    parser.add_argument("--quick", action="store_true", help="a small sample; nothing is written")
    parser.add_argument("--seeds", type=int, nargs="+", default=(), help="others, to tune on")
    parser.add_argument("--only", nargs="+", default=(), metavar="KEY=VALUE", help="such cases")
    parser.add_argument("--every", type=int, default=1, metavar="K", help="one of K cases")
    parser.add_argument("--workers", type=int, help="cases at a time (default: one per core)")
    parser.add_argument("--tables", action="store_true", help="write the tables of kept records")
    args = parser.parse_args(words)
    if unknown := [name for name in args.names if name not in known]:
        parser.error(f"no bench {', '.join(unknown)}; there are: {', '.join(known)}")
    sample = Sample(args.quick, tuple(args.seeds))
    for bench in [known[n] for n in args.names] or [b for b in benches if not b.long]:
        if args.tables:
            head = json.loads((RESULTS / f"{bench.name}.json").read_text(encoding="utf-8"))
            render(bench, head, rows_of(head["records"]))
            continue
        wanted = dict(word.split("=", 1) for word in args.only)
        cases = [
            case
            for case in bench.cases(sample)
            if all(str(case.get(key)) == value for key, value in wanted.items())
        ]
        records = run(bench, thinned(cases, args.every), args.workers)
        if args.quick or args.seeds or args.only:
            print(f"## {bench.title}\n\n{bench.tables(rows_of(records)).strip()}\n", flush=True)
            continue
        part = f" --every {args.every}" if args.every > 1 else ""
        write(bench, records, f"python bench/run.py {bench.name}{part}")
        (UNFINISHED / f"{bench.name}.jsonl").unlink()
        print(f"written: bench/results/{bench.name}.json and .md", flush=True)


def thinned(cases: Sequence[Any], every: int) -> list[Any]:
    """One of each `every` cases, each time the next one of them.

    Cases often repeat with some of their members: each fourth one would have the same ones.
    """
    return [case for i, case in enumerate(cases) if i % every == i // every % every]


def markdown(head: Sequence[str], lines: Iterable[Sequence[Any]], text: int = 1) -> str:
    """A table of Markdown, whose first columns are text."""
    rule = ["---" if i < text else "---:" for i in range(len(head))]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in (head, rule, *lines))


Statistic = Callable[[list[Row]], Any]


def table(
    rows: Sequence[Row],
    by: Mapping[str, str],
    columns: Mapping[str, Statistic],
    over_all: str = "",
) -> str:
    """A line for each group of rows that agree in some members, a column for each statistic.

    by: Heading and member.
    over_all: Label of a last line of all rows; none by default.
    """
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in by.values()), []).append(row)
    lines = [[*key, *(of(own) for of in columns.values())] for key, own in groups.items()]
    if over_all and rows:
        blank = [""] * (len(by) - 1)
        lines.append([over_all, *blank, *(of(list(rows)) for of in columns.values())])
    return markdown((*by, *columns), lines, len(by))


def each(
    member: str, form: str = ".2f", of: Callable[..., Any] = np.mean, scale: float = 1.0
) -> Statistic:
    """A statistic of a number or of each of an array of them, over the rows that have it."""

    def cell(rows: list[Row]) -> str:
        values = [row[member] for row in rows if row.get(member) is not None]
        if not values:
            return ""
        found = np.atleast_1d(of(np.asarray(values, float), axis=0)) * scale
        return " / ".join(format(value, form) for value in found)

    return cell


def percent(member: str, digits: int = 0) -> Statistic:
    """The mean of shares, or of what is true, in per cent."""
    return each(member, f".{digits}f", scale=100.0)


def with_error(member: str) -> Statistic:
    """Mean, and its standard error."""

    def cell(rows: list[Row]) -> str:
        means = np.asarray([row[member] for row in rows])
        return f"{means.mean():.2f} ± {means.std(ddof=1) / np.sqrt(len(means)):.2f}"

    return cell


def rms(values: Any, axis: int | None = None) -> Any:
    """Root mean square."""
    return np.sqrt(np.mean(np.square(values), axis=axis))


def member(name: str) -> Statistic:
    """What the first row of a group has."""
    return lambda rows: rows[0].get(name, "")


def source_state() -> str:
    """A digest of all files on which records depend."""
    digest = sha256()
    for folder in SOURCES:
        for file in sorted((ROOT / folder).rglob("*")):
            if file.suffix in ENDINGS and file.is_file():
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def source_version() -> str:
    """The version of soilml, and the commit where the source is a repository."""
    words = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude", "*"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    commit = f", commit {done.stdout.strip()}" if done.returncode == 0 else ""
    return f"soilml {version('soilml')}{commit}"


def machine() -> str:
    """Processor, cores and versions."""
    name, cpu = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    if cpu.exists():
        names = [x.split(":")[1].strip() for x in cpu.read_text().splitlines() if "model name" in x]
        name = names[0] if names else name
    libraries = ("numpy", "scipy", "scikit-learn", "onnxruntime")
    versions = ", ".join(f"{n} {version(n).split('+')[0]}" for n in libraries)
    return (
        f"{name}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}, Python "
        f"{platform.python_version()}, {versions}; one thread for each process."
    )
