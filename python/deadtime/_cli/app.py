"""The commands by name: each is imported when it is called, so that help comes at once."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from deadtime._base.errors import DeadtimeError, NotIdentifiableError
from deadtime._base.printable import one_line, printable
from deadtime._cli.exit_codes import DEFECT, NONE
from deadtime._cli.interruption import INTERRUPTED, ended_by_ctrl_c

#: Errors that end a command with one line; any other is a defect and prints its traceback.
FAILURES = (DeadtimeError, ArithmeticError, MemoryError, OSError, ValueError)

#: The commands with the first lines of their help. Each is `command` in the file of its name.
COMMANDS = {
    "estimate": "Find the plant from a recording, or the delay of a known loop, with a verdict.",
    "inspect": "List what an autopilot's log contains: vehicle, modes, loops, rates, gains.",
    "latency": "Show how long each loop takes to respond, in which stages, and which gains are "
    "possible.",
    "roots": "Find the characteristic roots of a loop: the rightmost ones, or all in a region.",
    "map": "Map which gains of a PV controller are stable, with the boundary and the best gains.",
    "explore": "Explore a loop in the browser: its map of gains, roots, margins and responses.",
    "design": "Find the gains that are best in the worst case, with the margins you require.",
    "tune": "Propose gains from a recording, in your controller's units, with predicted responses.",
    "reproduce": "Reproduce the paper on delays in quadrotor control, and compare each printed "
    "number.",
    "fly": "Fly steps under P control, estimate the delay, design PV gains, and fly these gains.",
    "watch": "Follow the delay of a running loop: print delay and interval for each row.",
    "internet-loop": "Control an integrator over UDP, and find the delay of this loop in two ways.",
    "simulate": "Simulate the step response of a loop exactly.",
    "report": "Write a page about a recording: its delay, its map of gains, a controller to try.",
    "demo": "Simulate a loop whose delay is known, find the delay, and design gains for it.",
    "emulate": "Emulate a vehicle, with its own network ports and protocol.",
}


class _Commands(TyperGroup):
    """Commands that are imported when they are called."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in COMMANDS:
            self.commands[args[0]] = _loaded(args[0])
        return super().resolve_command(ctx, args)


def _loaded(name: str) -> Any:
    """Import a command."""
    with ended_by_ctrl_c():
        found = importlib.import_module(f"deadtime._cli.{name.replace('-', '_')}").command
    if isinstance(found, typer.Typer):
        return get_command(found)
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name)(found)
    return get_command(alone)


app = typer.Typer(
    name="deadtime",
    cls=_Commands,
    help="Control loops with a delay: estimate the delay, map stable gains, design controllers.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(f"deadtime {version('deadtime')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Control loops with a delay in them: estimate it, map the gains, design for it.

    Exit codes: 0 an answer, reliable or an indication; 3 no answer, because the recording does not
    determine it; 1 an error.
    """


def _not_loaded() -> None:
    """Stands for a command that was not called."""


for _name, _help in COMMANDS.items():
    app.command(_name, help=_help)(_not_loaded)


def _show_warning(message: Warning | str, *place: object, **more: object) -> None:
    """Print a warning as a line, as an error is."""
    print(f"deadtime: {one_line(str(message))}", file=sys.stderr)


def run() -> None:
    """Run the command; an error is one line on standard error and a non-zero exit code.

    An unexpected error is a defect of the package: its traceback is printed.
    """
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            app()
    except SystemExit as ended:
        if ended.code == INTERRUPTED:  # typer says nothing when it ends so
            raise KeyboardInterrupt from None
        raise
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(1) from None
    except NotIdentifiableError as error:
        print(f"deadtime: none: {one_line(str(error))}", file=sys.stderr)
        raise SystemExit(NONE) from None
    except FAILURES as error:
        message = str(error)
        if isinstance(error, OSError) and error.filename is not None:
            message = f"{error.filename}: {error.strerror}"
        elif isinstance(error, ArithmeticError):
            message = (
                f"a number exceeds the range of double precision ({message}): choose other units"
            )
        elif isinstance(error, MemoryError):
            message = f"out of memory: {message or 'ask for less at once'}"
        print(f"deadtime: {one_line(message)}", file=sys.stderr)
        raise SystemExit(1) from None
    except Exception as error:
        import traceback

        print(printable(traceback.format_exc()), file=sys.stderr)
        print(
            "deadtime: the command failed because of a defect in deadtime "
            f"({type(error).__name__}). Please report it, with the command and the lines above",
            file=sys.stderr,
        )
        raise SystemExit(DEFECT) from None
