"""`soilml challenge`: blind sets with a sealed truth, entries, and their scores."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from soilml.cli.options import InputFile, add_output, add_seed_option, whole_number_from
from soilml.errors import InputError
from soilml.io.atomic_files import write_files

HELP = "make a challenge of blind sets, enter it, and score entries"
DESCRIPTION = """\
A challenge: runs of wheels whose hidden causes are sealed. Entrants state
probabilities of causes, and predict rows that were kept back.

  soilml challenge make blind --sets 24 --truth sealed/truth.json
  soilml challenge enter blind --method gap --out gap.json
  soilml challenge score blind sealed/truth.json gap.json theirs.json

The folder `blind` is for everyone; its README.md says what an entry is. The
truth stays with you until you score: its SHA-256 is in the folder, so that you
cannot change it, and its random salt keeps others from finding it by trial.

Methods of the house: this package's gap workflow (gap), stepwise regression by
BIC (stepwise), the Lasso (lasso), a Gaussian process without physics (gp), and
simulation-based inference (sbi; pip install 'soilml[sbi]').
"""
#: Methods of `enter`, as `datagen.challenge.house_entries.METHODS` has them.
METHODS = ("gap", "stepwise", "lasso", "gp", "sbi")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of each action."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    make = actions.add_parser("make", help="draw blind sets, and seal their truth")
    make.add_argument("folder", metavar="FOLDER", help="new folder, for entrants")
    add_output(make, "--truth", "TRUTH.json", "file of the sealed truth, outside FOLDER")
    make.add_argument(
        "--sets", type=whole_number_from(1, 9999), default=24, help="number of sets (default: 24)"
    )
    make.add_argument(
        "--tiers", metavar="A,B", help="kinds of hidden causes (default: A,B,C,S,L,D,N0,N1)"
    )
    make.add_argument(
        "--seed",
        type=whole_number_from(0),
        help="makes the challenge repeatable, for tests: who guesses the seed has the truth "
        "(default: random bits of the operating system)",
    )
    enter = actions.add_parser("enter", help="an entry by a method of the house")
    enter.add_argument("folder", metavar="FOLDER", help="folder of the challenge")
    enter.add_argument("--method", choices=METHODS, required=True, help="method of the house")
    add_output(enter, "--out", "ENTRY.json", "file of the entry")
    add_seed_option(enter)
    score = actions.add_parser("score", help="scores of entries, with intervals")
    score.add_argument("folder", metavar="FOLDER", help="folder of the challenge")
    score.add_argument("truth", type=InputFile, metavar="TRUTH.json", help="the sealed truth")
    score.add_argument(
        "entries", type=InputFile, metavar="ENTRY.json", nargs="+", help="entries to score"
    )
    add_output(score, "--json", "FILE.json", "write scores, intervals and scores of each set")


def outputs(args: argparse.Namespace) -> list[Path]:
    """The files that an action writes, but for those of a new folder."""
    if args.action == "make":
        return [_truth_outside(args)]
    out = args.out if args.action == "enter" else args.json
    if args.action == "enter" and out is None:
        raise InputError("--out is missing; needed is a file for the entry, such as gap.json")
    return [] if out is None else [Path(out)]


def _truth_outside(args: argparse.Namespace) -> Path:
    """The file of the truth; raises `InputError` where it would be public, or not alone."""
    if args.truth is None:
        raise InputError("--truth is missing; needed is a file outside FOLDER, such as truth.json")
    folder, truth = Path(args.folder).resolve(), Path(args.truth).resolve()
    if truth.is_relative_to(folder):
        raise InputError(f"--truth {args.truth} lies in {args.folder}, which entrants get")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{args.folder} exists and is not an empty folder; give another name")
    if truth.exists():
        raise InputError(
            f"--truth {args.truth} exists, and its challenge could not be scored without it; "
            "give another name"
        )
    return Path(args.truth)


def run(args: argparse.Namespace) -> int:
    """Make, enter or score."""
    from soilml.optional_imports import need

    for library in ("scipy", "sklearn"):
        need(library, f"challenge {args.action}")
    return {"make": _make, "enter": _enter, "score": _score}[args.action](args)


def _make(args: argparse.Namespace) -> int:
    from datagen.challenge.sealing import DEFAULT_TIERS, make_challenge
    from soilml.cli.output import tell
    from soilml.cli.progress import progress_bar

    tiers = DEFAULT_TIERS if args.tiers is None else tuple(args.tiers.split(","))
    with progress_bar("drawing sets", args.sets) as progress:
        sealed = make_challenge(args.sets, tiers, args.seed, progress)
    folder = Path(args.folder)
    files = {folder / name: text for name, text in sealed.public.items()}
    folders = dict.fromkeys(path.parent for path in files)
    write_files({**files, Path(args.truth): sealed.truth}, folders=folders)
    tell(f"{args.sets} sets written to {folder}; the truth is in {args.truth}: keep it to yourself")
    if args.seed is not None:
        tell(f"this challenge is not sealed: --seed {args.seed} makes it again, with its truth")
    return 0


def _enter(args: argparse.Namespace) -> int:
    from datagen.challenge.challenge_files import Challenge
    from datagen.challenge.house_entries import house_entry
    from soilml.cli.output import tell
    from soilml.cli.progress import progress_bar
    from soilml.optional_imports import need

    if args.method == "sbi":
        need("sbi", "challenge enter --method sbi", "sbi")
    challenge = Challenge.read(Path(args.folder))
    with progress_bar(f"{args.method}, sets", len(challenge.rows)) as progress:
        entry = house_entry(challenge, args.method, args.seed, progress)
    write_files({Path(args.out): json.dumps(entry.as_json(challenge)) + "\n"})
    tell(f"entry of {len(challenge.rows)} sets written to {args.out}")
    return 0


def _score(args: argparse.Namespace) -> int:
    from datagen.challenge.challenge_files import Challenge, Entry, Truth
    from datagen.challenge.scoring import score, score_text, summary
    from soilml.cli.output import write_stdout

    challenge = Challenge.read(Path(args.folder))
    truth = Truth.read(Path(args.truth), challenge)
    entries = [Entry.read(Path(path), challenge) for path in args.entries]
    found = summary([score(challenge, truth, entry) for entry in entries], challenge)
    if args.json is not None:
        write_files({Path(args.json): json.dumps(found, indent=1) + "\n"})
    write_stdout(score_text(found) + "\n")
    return 0
