"""Constraints that ask for the oldest libraries that pyproject.toml allows: `make test-oldest`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

#: Extras that are installed with the package on the ground, and the libraries that tests need.
EXTRAS = ("ground", "logs", "serve", "torch")
TESTED_WITH = ("array-api-strict", "hypothesis", "sympy")
#: What the oldest plotting library needs itself: later versions warn of how it calls them.
OF_OTHERS = ("pyparsing==3.1.*",)


def oldest() -> list[str]:
    """The first release series of each library, a line each."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(line for name in EXTRAS for line in extras[name])]
    wanted += [line for line in extras["dev"] if line.startswith(TESTED_WITH)]
    bounds = [re.match(r"([\w.-]+)>=([\d.]+)", line) for line in wanted]
    return sorted({f"{b[1]}=={b[2]}.*" for b in bounds if b}) + list(OF_OTHERS)


if __name__ == "__main__":
    print("\n".join(oldest()))
