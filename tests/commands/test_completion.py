"""Completion in shells: what shells make of the scripts."""

import os
import shutil
import subprocess
import sys

import pytest

from soilml.cli import main


def test_a_shell_is_needed(capsys):
    assert main(["completion"]) == 2
    assert "required: shell" in capsys.readouterr().err


def test_a_missing_library_names_its_extra(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert main(["completion", "bash"]) == 2
    assert "pip install '.[ground]'" in capsys.readouterr().err


#: What is typed, and what the last word may become.
TYPED = {
    "soilml pu": "pull",
    "soilml identify --met": "--method",
    "soilml identify m.toml --method p": "posterior",
    "soilml soils wong1989/dry": "wong1989/dry_sand",
    "soilml effects slip-s": "slip-scale slip-sinkage",
    "soilml estimate wheel_l": "wheel_linear wheel_lssvm",
    "soilml pull m.toml r.csv --gravity m": "moon mars",
    "soilml estimate wheel r.csv --rule co": "correlated covariance-intersection",
    "soilml completion f": "fish",
    "soilml identify mo": "model.toml",
    "soilml gap model.toml r.csv --ignore-extra --out mo": "model.toml",
    "soilml soils nothing-begins-so": "",
}
#: What prints the candidates of some words that are typed.
ASK = {
    "bash": "source <(soilml completion bash); ask() { COMP_WORDS=($1);"
    " COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _shtab_soilml; echo ${COMPREPLY[@]}; }; ",
    "fish": "soilml completion fish | source;"
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
