"""Packages that soilml needs: hashes, bill of materials, licences, known faults.

`make lock`, `make sbom`, `make licences` and `make audit-packages` run it with the tools of an
environment of its own, `.venv-supply`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
TOOLS = ROOT / ".venv-supply" / "bin"
#: Files with hashes, in the folder `SUPPLY`: extras of pyproject.toml, and the oldest Python.
SUPPLY = Path("tools") / "supply"
LOCKED = {
    "onboard-hashes.txt": ((), "3.10"),
    "ground-hashes.txt": (("ground", "logs", "map", "serve"), "3.11"),
}


def lock_command(tools: Path, name: str) -> list[str]:
    """The command that writes the file of `LOCKED`: versions of constraints.txt with hashes."""
    extras = [f"--extra={extra}" for extra in LOCKED[name][0]]
    return [
        *(str(tools / "uv"), "pip", "compile", "pyproject.toml", *extras),
        *("--constraint=constraints.txt", "--universal", f"--python-version={LOCKED[name][1]}"),
        *("--generate-hashes", "--no-annotate", "--no-header", "--quiet"),
        f"--output-file={SUPPLY / name}",
    ]


def locked_names(name: str) -> list[str]:
    """Names of the packages in a lock file, in order."""
    lines = (ROOT / SUPPLY / name).read_text().splitlines()
    return [line.split("==")[0] for line in lines if "==" in line and not line.startswith(" ")]


def licence(package: str) -> str:
    """Licence of an installed package: its expression, else its classifiers, else its text."""
    try:
        data = metadata(package)
    except PackageNotFoundError:
        return "not installed here"
    if expression := data.get("License-Expression"):
        return str(expression)
    classifiers = [
        text.rsplit(" :: ", 1)[-1]
        for text in data.get_all("Classifier") or []
        if text.startswith("License ::") and not text.endswith("OSI Approved")
    ]
    text = (data.get("License") or "unknown").strip().splitlines()[0]
    return ", ".join(classifiers) or text


def audited(report: str) -> tuple[int, list[str], list[str]]:
    """From the JSON of pip-audit: packages compared, those that were not, and known faults."""
    entries = json.loads(report)["dependencies"]
    skipped = [entry["name"] for entry in entries if "skip_reason" in entry]
    faults = [
        f"{entry['name']} {entry['version']}: {fault['id']}"
        for entry in entries
        for fault in entry.get("vulns", ())
    ]
    return len(entries) - len(skipped), skipped, faults


def main(task: str) -> int:
    """Run `lock`, `sbom`, `licences` or `audit`; the exit status."""
    if task == "lock":
        for name in LOCKED:
            subprocess.run(lock_command(TOOLS, name), cwd=ROOT, check=True)
    elif task == "sbom":
        for name in LOCKED:
            target = Path("build") / name.replace("-hashes.txt", ".cdx.json")
            (ROOT / target).parent.mkdir(exist_ok=True)
            words = [
                "requirements",
                str(SUPPLY / name),
                "--output-reproducible",
                f"--output-file={target}",
            ]
            subprocess.run([str(TOOLS / "cyclonedx-py"), *words], cwd=ROOT, check=True)
            print(target)
    elif task == "licences":
        print("| package | licence |\n|---|---|")
        for package in locked_names("ground-hashes.txt"):
            print(f"| {package} | {licence(package)} |")
    else:
        words = [
            f"--requirement={SUPPLY / 'ground-hashes.txt'}",
            "--no-deps",
            "--disable-pip",
            "--format=json",
        ]
        ran = subprocess.run(
            [str(TOOLS / "pip-audit"), *words], cwd=ROOT, capture_output=True, text=True
        )
        if not ran.stdout.strip():
            print(f"not audited: {ran.stderr.strip()[-300:]}")
            return 2
        compared, skipped, faults = audited(ran.stdout)
        print(f"{compared} packages compared with known faults, {len(faults)} faults found")
        print("\n".join(faults))
        if skipped:
            print(f"not audited, unknown to the advisory service: {', '.join(skipped)}")
        return 1 if faults else 2 if skipped else 0
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
