"""Completion in shells: candidates from the declared arguments, and the scripts."""

import os
import shutil
import subprocess
import sys

import pytest

from soilml.cli import main
from soilml.cli.commands.completion import FILES, candidates
from soilml.cli.main import COMMANDS, parser


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([""], {*COMMANDS, "--help", "--version"}),
        (["pu"], {"pull"}),
        (["identify", "--met"], {"--method"}),
        (["identify", "m.toml", "--method", "p"], {"posterior"}),
        (["soils", "wong1989/dry"], {"wong1989/dry_sand"}),
        (["effects", "slip-s"], {"slip-scale", "slip-sinkage"}),
        (["estimate", "wheel_l"], {"wheel_linear", "wheel_lssvm", FILES}),
        (["pull", "m.toml", "r.csv", "--gravity", "m"], {"moon", "mars"}),
        (["pull", "m.toml", "r.csv", "--from", "any"], {"any_wheel", "any_wheel_small", FILES}),
        (["identify", "m.toml", ""], {FILES}),
        (["import", "a.csv", "b.csv", ""], {FILES}),
        (["gap", "m.toml", "r.csv", "--ignore-extra", "--out", ""], {FILES}),
        (["estimate", "wheel", "r.csv", "--rule", "co"], {"correlated", "covariance-intersection"}),
        (["completion", "f"], {"fish"}),
        (["no-such-command", ""], set()),
        (["soils", "nothing-begins-so"], set()),
    ],
)
def test_candidates(words, expected):
    assert set(candidates(parser, words)) == expected


def test_every_command_has_its_options():
    for command in COMMANDS:
        assert "--help" in candidates(parser, [command, "--"])


def test_a_shell_is_needed(capsys):
    assert main(["completion"]) == 2
    assert "give one of bash, zsh, fish" in capsys.readouterr().err


ASK = {
    "bash": "source <(soilml completion bash); COMP_CWORD=2; "
    "COMP_WORDS=(soilml soils wong1989/dry); _soilml; echo ${COMPREPLY[@]}; "
    "COMP_WORDS=(soilml identify mo); _soilml; echo ${COMPREPLY[@]}",
    "fish": "soilml completion fish | source; complete -C 'soilml soils wong1989/dry';"
    " complete -C 'soilml identify mo'",
    "zsh": "autoload -U compinit; compinit -u -d .dump; source <(soilml completion zsh);"
    " compadd() { print -l $candidates; }; words=(soilml soils wong1989/dry); CURRENT=3; _soilml;"
    " _files() { print model.toml; }; words=(soilml identify mo); _soilml",
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
        [shell, "-c", ASK[shell]],
        cwd=tmp_path, env=environment | {"HOME": str(tmp_path)}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout.split() == ["wong1989/dry_sand", "model.toml"], done.stderr
