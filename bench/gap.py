"""Measure the gap workflow on hidden effects, and write docs/benchmarks/gap.md.

python bench/gap.py --every 20                 a quick look at the sealed sets
python bench/gap.py --seed 1 --keep dev.json   sets to tune on; run again, it goes on from there
python bench/gap.py --table dev.json           the pages of records that were kept

Set OMP_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1: the analyses themselves run side by side.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import gap_enlarged
import gap_pages
import gap_reliability
from benchmarks_file import ROOT, TITLES, machine, page_file, source_state
from gap_case import judged
from gap_records import Judged, from_json

from datagen.blind_sets.plans import Plan, benchmark_plans, plan_matrix
from soilml.cli.progress import progress_bar
from soilml.io.atomic_files import save_text
from soilml.processes import process_map

#: Seeds of the published sets, on which nothing was tuned; the method was tuned on sets of others
#: (0, 1, 2, 3, 4, 5, 7).
SEEDS = (10, 11)
#: Of each so many plans, `make bench-gap` takes one. Each group of `gap_enlarged` has at least so
#: many sets with a cause that can be named, as far as there are any.
USUAL_EVERY, USUAL_LEAST = 3, 60
#: Records are kept after so many sets, so that a run that is ended leaves those it has.
KEEP_EVERY = 5


def run() -> None:
    """Draw, analyse, judge, print; and write where that is asked for."""
    args = _arguments()
    if args.table:
        sets = [s for file in args.table for s in from_json(json.loads(Path(file).read_text()))]
    else:
        sample = _plans(args)
        sets = _judge(sample, _added(args, sample), args.jobs, args.keep)
    text = gap_pages.text(sets, from_json(_read(args.before)), _command(args))
    print(text)
    if args.write:
        picture = ROOT / gap_pages.PICTURE  # of the sets that the table beside it counts
        gap_reliability.save_picture(gap_enlarged.sampled(sets), picture)
        save_text(page_file("gap"), f"# {TITLES['gap']}\n\n**Machine.** {machine()}\n\n{text}")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    own = " and ".join(map(str, SEEDS))
    parser.add_argument(
        "--seed", type=int, nargs="+", default=SEEDS, help=f"the benchmark's own are {own}"
    )
    parser.add_argument(
        "--factorial", action="store_true", help="the 1593 sets without discrepancy instead"
    )
    parser.add_argument(
        "--before", metavar="FILE.json", help="records of an earlier state, for a column beside"
    )
    parser.add_argument("--every", type=int, default=1, metavar="K", help="take one of K plans")
    parser.add_argument(
        "--enlarge",
        type=int,
        default=0,
        metavar="N",
        help="add plans until groups of which the sample has few have N with a nameable cause",
    )
    parser.add_argument("--tier", help="only sets of this tier")
    parser.add_argument("--design", help="only sets of this design")
    parser.add_argument("--jobs", type=int, help="analyses at a time (default: cores)")
    parser.add_argument(
        "--keep",
        metavar="FILE.json",
        help="keep the records; those of this state of the package are not made again",
    )
    parser.add_argument(
        "--table", nargs="+", metavar="FILE.json", help="print the pages of kept records"
    )
    parser.add_argument(
        "--write", action="store_true", help="write docs/benchmarks/gap.md and its picture"
    )
    return parser.parse_args()


def _command(args: argparse.Namespace) -> str:
    """The command that made the records."""
    if args.table:
        return "kept records"
    words = [f"--every {args.every}"]
    words += [f"--seed {' '.join(map(str, args.seed))}"] if tuple(args.seed) != SEEDS else []
    words += [f"--{n} {v}" for n in ("tier", "design") if (v := getattr(args, n)) is not None]
    words += ["--factorial"] if args.factorial else []
    words += [f"--enlarge {args.enlarge}"] if args.enlarge else []
    usual = words == [f"--every {USUAL_EVERY}", f"--enlarge {USUAL_LEAST}"]
    return "`make bench-gap`" if usual else f"`python bench/gap.py {' '.join(words)} --write`"


def _plans(args: argparse.Namespace) -> list[Plan]:
    """The sample of all plans, and of it those that were asked for."""
    every = [plan for plans in _drawn(args) for plan in thinned(plans, args.every)]
    return [p for p in every if args.tier in (None, p.tier) and args.design in (None, p.design)]


def _drawn(args: argparse.Namespace) -> list[list[Plan]]:
    """All plans of each seed."""
    return [plan_matrix(True, s) if args.factorial else benchmark_plans(s) for s in args.seed]


def thinned(plans: Sequence[Plan], every: int) -> list[Plan]:
    """One of each `every` plans, each time the next one of them.

    Plans repeat with the discrepancies and designs of a cause, four at a time: each fourth plan
    would have the same ones for all causes.
    """
    return [p for i, p in enumerate(plans) if i % every == i // every % every]


def _added(args: argparse.Namespace, sample: Sequence[Plan]) -> list[tuple[Plan, str]]:
    """Plans beside the sample, with the groups that they enlarge."""
    if not args.enlarge:
        return []
    every = [plan for plans in _drawn(args) for plan in plans]
    every += gap_enlarged.further_plans(args.seed)
    return list(gap_enlarged.added(every, sample, args.enlarge))


def _judge(
    plans: Sequence[Plan],
    added: Sequence[tuple[Plan, str]],
    processes: int | None,
    keep: str | None,
) -> list[Judged]:
    """The records of all plans, in their order; those that were kept are not made again."""
    state, groups = source_state(), {_key(asdict(plan)): group for plan, group in added}
    kept = {_key(s): s for s in _read(keep) if s.get("state") == state}
    every = [*enumerate(plans), *((1, plan) for plan, _ in added)]  # 1: without other methods
    jobs = [job for job in every if _key(asdict(job[1])) not in kept]
    with (
        process_map(judged, jobs, processes) as records,
        progress_bar("analysing", len(jobs)) as done,
    ):
        for count, record in enumerate(records, 1):
            key = _key(record)
            kept[key] = record | {"state": state, "added_to": groups.get(key, "")}
            done(count)
            if keep and (count % KEEP_EVERY == 0 or count == len(jobs)):
                save_text(keep, json.dumps(list(kept.values())))
    return from_json([kept[_key(asdict(plan))] for _, plan in every])


def _read(file: str | None) -> list[Judged]:
    """The records of a file, none without one."""
    return json.loads(Path(file).read_text()) if file and Path(file).exists() else []


def _key(record: Judged) -> tuple[object, ...]:
    """What tells the plan of a record from those of others."""
    return tuple(record[f.name] for f in fields(Plan))


if __name__ == "__main__":
    run()
