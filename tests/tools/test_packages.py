"""Locked packages agree with constraints.txt, and an audit that saw nothing does not pass."""

import json
import re
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))


from packages import LOCKED, SUPPLY, audited

ROOT = Path(__file__).parents[2]


def versions(name):
    found = re.findall(r"^([\w.\-]+)==([\w.]+)(.*)", (ROOT / name).read_text(), re.MULTILINE)
    return {
        re.sub(r"[-_.]+", "-", package).lower(): version
        for package, version, marker in found
        if "<" not in marker  # of an older Python
    }


@pytest.mark.parametrize("name", LOCKED)
def test_locked_versions_are_the_tested_ones_and_all_have_hashes(name):
    locked, tested = versions(SUPPLY / name), versions("constraints.txt")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [project["optional-dependencies"][extra] for extra in LOCKED[name][0]]
    needed = [Requirement(line).name for line in sum(extras, project["dependencies"])]
    assert {*needed} <= locked.keys() | {"tomli"}
    shared = locked.keys() & tested.keys()
    assert {package: locked[package] for package in shared} == {
        package: tested[package] for package in shared
    }
    entries = re.split(r"\n(?=\S)", (ROOT / SUPPLY / name).read_text().strip())
    assert all("--hash=sha256:" in entry for entry in entries)
    assert not any(package.startswith("nvidia") or package == "torch" for package in locked)


def test_packages_that_were_not_compared_are_not_taken_for_sound():
    report = {
        "dependencies": [
            {"name": "a", "version": "1", "vulns": []},
            {"name": "b", "version": "2", "vulns": [{"id": "CVE-1"}]},
            {"name": "c", "skip_reason": "not found"},
        ]
    }
    assert audited(json.dumps(report)) == (2, ["c"], ["b 2: CVE-1"])
