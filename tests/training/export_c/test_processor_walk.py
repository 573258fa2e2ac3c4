"""The commands of docs/how-to/deploy.md, as written, up to an emulated processor."""

import os
import re
import subprocess
import sys

import pytest
from compiled_c import COMPILERS, ROOT
from emulated_board import MISSING

PAGE = ROOT / "docs/how-to/deploy.md"
#: Lines that need a network or rights: the environment of this test stands for what they install.
INSTALLED = ("SOILML=", "python3 -m venv", "venv/bin/pip", "sudo apt-get")


@pytest.mark.long
@pytest.mark.skipif("gcc" not in COMPILERS or bool(MISSING), reason="no gcc, or no emulator")
def test_the_commands_of_the_page_run_as_written(tmp_path):
    section = PAGE.read_text().split("## From an empty folder")[1].split("\n## ")[0]
    blocks = re.findall(r"^```\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    lines = [line for block in blocks for line in block.splitlines()]
    kept = "\n".join(line for line in lines if not line.startswith(INSTALLED))
    program = tmp_path / "board" / "venv" / "bin" / "soilml"
    program.parent.mkdir(parents=True)
    code = "import sys; from soilml.cli import main; sys.exit(main(sys.argv[1:]))"
    program.write_text(f"#!/bin/sh\nexec {sys.executable} -c '{code}' \"$@\"\n")
    program.chmod(0o755)
    done = subprocess.run(
        ["bash", "-e", "-c", kept.replace("mkdir board", "mkdir -p board")],
        cwd=tmp_path,
        env=os.environ | {"SOILML": str(ROOT), "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    printed = done.stdout.splitlines()
    events = [line.split(":")[0] for line in printed if line.startswith("event")]
    assert events == [*["event 0"] * 4, "event 1"]
    assert sum(line.startswith("wheel by soilml ") for line in printed) == 1
    rows = [line.split() for line in printed if re.match(r"0 \d+ \d+ ", line)]
    assert len(rows) == 3 and all(len(row) == 16 and row[-1] == "1" for row in rows)
