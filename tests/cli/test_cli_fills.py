"""Options that follow from dataclasses, functions and numpydoc texts."""

import importlib
import inspect
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
import typer
from command_line import run
from deadtime._base.bounds import Bounds
from deadtime._cli.app import COMMANDS
from deadtime._cli.fills import Fills, Given, descriptions, filled
from deadtime.links.ardrone2.emulator import EmulatorOptions
from typer.testing import CliRunner


@dataclass
class Sensor:
    """A sensor.

    Parameters
    ----------
    kind, other : {"sonar", "lidar"}
        How it
        measures.

        In detail that no terminal shows.
    noise : float
        Deviation, m.
    port : int
        Where it is.
    quick : bool
        Answer at once.

    Raises
    ------
    noise : of rain
        Never.
    """

    kind: Literal["sonar", "lidar"] = "sonar"
    other: str = ""
    noise: Annotated[float, Bounds(0.0, 2.0)] = 0.5
    port: int = 7
    quick: bool = False


@filled
def measure(
    *,
    sensor: Annotated[Given, Fills(Sensor, "kind noise quick=--at-once")],
    rows: Annotated[int, Bounds(1)] = 3,
    ports: Annotated[Given, Fills(Sensor, "port", optional=True)],
    long: bool = False,
) -> None:
    """Measure.

    Parameters
    ----------
    rows
        How many.
    long
        Take longer.
    """
    print(Sensor(**sensor, **ports), sorted(ports), rows, long)


def invoked(*arguments):
    app = typer.Typer(rich_markup_mode=None)
    app.command()(measure)
    return CliRunner().invoke(app, arguments)


def test_a_paragraph_is_found_for_each_name():
    assert descriptions(Sensor) == {
        "kind": "How it measures.",
        "other": "How it measures.",
        "noise": "Deviation, m.",
        "port": "Where it is.",
        "quick": "Answer at once.",
    }


def test_defaults_are_those_of_the_dataclass_and_what_is_optional_is_left_out():
    assert invoked().stdout == f"{Sensor()} [] 3 False\n"


def test_options_have_the_names_and_types_of_the_fields():
    given = ("--kind", "lidar", "--noise", "1", "--at-once", "--port", "9", "--long")
    assert invoked(*given).stdout == f"{Sensor('lidar', '', 1.0, 9, True)} ['port'] 3 True\n"


@pytest.mark.parametrize("given", [("--noise", "2.5"), ("--rows", "0"), ("--kind", "radar")])
def test_what_is_out_of_bounds_is_refused(given):
    assert invoked(*given).exit_code == 2


def test_the_help_shows_explanation_default_and_bounds_and_no_section():
    words = " ".join(invoked("--help").stdout.split())
    for shown in (
        "Deviation, m. [default: 0.5; 0.0<=x<=2.0]",
        "How many. [default: 3; x>=1]",
        "Answer at once.",
    ):
        assert shown in words
    assert "Parameters" not in words
    assert "--no-" not in words


def test_the_largest_delay_of_the_emulator_is_that_of_its_dataclass():
    # The help once said that every delay from zero on is accepted.
    result = run("emulate", "ardrone2", "--delay", "101")
    assert result.returncode == 2
    assert "--delay" in result.stderr
    with pytest.raises(ValueError, match="0 to 100"):
        EmulatorOptions(delay=101.0)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_explained(name):
    # A parameter that is renamed would lose the help that its docstring has on the old name.
    module = importlib.import_module(f"deadtime._cli.{name.replace('-', '_')}")
    command = module.ardrone2 if name == "emulate" else module.command
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        (info,) = parameter.annotation.__metadata__
        assert info.help or parameter.name in ("command_port", "control_port"), parameter.name
