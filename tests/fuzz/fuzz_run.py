"""Fuzz every target for a time, print counts, keep what fails: `make fuzz FUZZ_SECONDS=3600`.

Warnings are failures, as they are in the tests.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import sys
import time
import traceback
import warnings
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

from targets import TARGETS, check  # noqa: E402

CORPUS = Path(__file__).parent / "corpus"
#: Examples of a target of share 1 in a round.
EXAMPLES = 40


def fuzz(name: str, examples: int, number: int) -> tuple[int, int, bytes | None]:
    """Examples tried and accepted, and the smallest input that fails, from one seed."""
    target, tried, accepted, failing = TARGETS[name], 0, 0, None

    @seed(number)
    @settings(
        max_examples=examples, deadline=None, database=None,
        suppress_health_check=list(HealthCheck), phases=[Phase.generate, Phase.shrink],
    )  # fmt: skip
    @given(target.inputs)
    def one(content: bytes) -> None:
        nonlocal tried, accepted, failing
        tried += 1
        try:
            accepted += check(target, content)
        except Exception:
            failing = content
            raise

    try:
        one()
    except Exception:
        traceback.print_exc(limit=-4)
    return tried, accepted, failing


def main() -> int:
    """Fuzz until the time is over; 1 where a target failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first round; else random")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    args = parser.parse_args()
    warnings.simplefilter("error")
    first = random.SystemRandom().randrange(2**31) if args.seed is None else args.seed
    end, rounds = time.monotonic() + args.seconds, 0
    counts = {name: [0, 0, 0] for name in args.targets or TARGETS}
    while time.monotonic() < end:
        for name in counts:
            if time.monotonic() > end:
                break
            examples = max(1, round(EXAMPLES * TARGETS[name].share))
            tried, accepted, failing = fuzz(name, examples, first + rounds)
            if failing is not None:
                folder = CORPUS / name
                folder.mkdir(parents=True, exist_ok=True)
                (folder / hashlib.sha256(failing).hexdigest()[:16]).write_bytes(failing)
            for i, count in enumerate((tried, accepted, failing is not None)):
                counts[name][i] += count
        rounds += 1
    print(f"seed {first}, {rounds} rounds")
    for name, (tried, accepted, failed) in counts.items():
        print(f"{name:14} {tried:9} inputs {accepted:9} accepted {failed:5} failures")
    return 1 if any(failed for _, _, failed in counts.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
