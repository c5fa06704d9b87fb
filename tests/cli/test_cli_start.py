"""What the command loads before it does anything: help, version and completion come at once."""

import importlib
import importlib.metadata
import inspect
import subprocess
import sys

import pytest
import typer
from command_line import run
from deadtime._cli.app import COMMANDS

LOADED = """
import atexit, sys
atexit.register(lambda: print(*sys.modules, file=sys.stderr))
from deadtime._cli import main
main()
"""


def loaded(*arguments):
    """Top-level packages, and modules of this one, that a command imports."""
    result = subprocess.run(
        [sys.executable, "-c", LOADED, *arguments],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    names = result.stderr.split()
    return {name.split(".")[0] for name in names}, {n for n in names if n.startswith("deadtime")}


@pytest.mark.parametrize("argument", ["--help", "--version"])
def test_help_and_version_load_neither_numerics_nor_drawing(argument):
    packages, own = loaded(argument)
    costly = {"numpy", "scipy", "matplotlib", "rich", "pydantic", "control", "asyncio"}
    assert not packages & costly
    assert "typer" in packages
    assert own == {
        "deadtime",
        "deadtime._base",
        "deadtime._base.printable",
        "deadtime._base.errors",
        "deadtime._cli",
        "deadtime._cli.app",
        "deadtime._cli.exit_codes",
        "deadtime._cli.interruption",
        "deadtime._cli.readable",
    }


def test_a_command_loads_no_other():
    _, own = loaded("roots", "--help")
    commands = {f"deadtime._cli.{name.replace('-', '_')}" for name in COMMANDS}
    assert own & commands == {"deadtime._cli.roots"}
    assert not {
        name
        for name in own
        if name.startswith(("deadtime.estimation", "deadtime.dde", "deadtime.recordings"))
    }


def test_the_version_is_that_of_the_package():
    assert run("--version").stdout == f"deadtime {importlib.metadata.version('deadtime')}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_shown_without_loading_is_that_of_the_command(name):
    found = importlib.import_module(f"deadtime._cli.{name.replace('-', '_')}").command
    text = found.info.help if isinstance(found, typer.Typer) else inspect.getdoc(found)
    assert text.splitlines()[0] == COMMANDS[name]


def test_the_shell_completes_commands_and_options(monkeypatch):
    # The name of the command is not that of the module that runs the tests.
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)

    def completed(words, place):
        monkeypatch.setenv("_DEADTIME_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(place))
        return run().stdout.split()

    assert completed("deadtime ro", 1) == ["roots"]
    assert completed("deadtime re", 1) == ["reproduce", "report"]
    assert "--rightmost" in completed("deadtime roots --r", 2)
    # The shell is named here: typer would look for it among the processes above this one.
    monkeypatch.delenv("_DEADTIME_COMPLETE")
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    assert "_DEADTIME_COMPLETE" in run("--show-completion", "bash").stdout


def test_a_mistyped_command_is_answered_with_the_nearest():
    result = run("rots")
    assert result.returncode == 2
    assert "'roots'" in result.stderr
