"""Completion in shells: what shells make of the scripts."""

import os
import shutil
import subprocess
import sys

import pytest

#: What is typed, and what the last word may become.
TYPED = {
    "soilml pu": "pull",
    "soilml identify --met": "--method",
    "soilml setup completion f": "fish",
    "soilml identify mo": "model.toml",
    "soilml gap model.toml r.csv --ignore-extra --out mo": "model.toml",
    "soilml pull --nothing-begins-so": "",
}
#: What prints the candidates of some words that are typed.
ASK = {
    "bash": "source <(soilml setup completion bash); ask() { COMP_WORDS=($1);"
    " COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _shtab_soilml; echo ${COMPREPLY[@]}; }; ",
    "fish": "soilml setup completion fish | source;"
    " function ask; echo (complete -C $argv[1] | string split -f 1 \\t); end; ",
}


@pytest.mark.slow
@pytest.mark.parametrize("shell", ASK)
def test_shells_take_the_scripts(shell, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    command = tmp_path / "bin" / "soilml"
    command.parent.mkdir()
    command.write_text(
        f"#!{sys.executable}\nimport sys\nfrom soilml.cli import main\nsys.exit(main())\n"
    )
    command.chmod(0o755)
    (tmp_path / "model.toml").touch()
    path = os.pathsep.join([str(command.parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [shell, "-c", ASK[shell] + "; ".join(f"ask '{words}'" for words in TYPED)],
        cwd=tmp_path, env=environment | {"HOME": str(tmp_path)}, capture_output=True, text=True,
    )  # fmt: skip
    found = [set(line.split()) for line in done.stdout.splitlines()]
    assert found == [set(names.split()) for names in TYPED.values()], done.stderr
