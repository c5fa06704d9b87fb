"""``deadtime emulate``: commands that emulate a vehicle."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Coroutine
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from deadtime._base.bounds import Bounds
from deadtime._base.validation import positive
from deadtime._cli import options as opt
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.show import console
from deadtime.links import Journal
from deadtime.links.ardrone2.emulator import Emulator, EmulatorOptions, Phase, Truth
from deadtime.links.ardrone2.emulator.options import PORT_BASE, ports_from
from deadtime.links.parent_watch import parent_ended

command = typer.Typer(
    help="Emulate a vehicle, with its own network ports and protocol.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

#: Periods of the status line and of the record, s.
SHOWN_EVERY, RECORDED_EVERY = 0.2, 0.02

COLUMNS = ("time_s", "height_m", "climb_m_s", "setpoint_m_s", "battery_percent", "landed")

PORTS = ("navdata_port", "command_port", "control_port", "ftp_port", "video_port")


@command.callback()
def _group() -> None:
    """Emulate a vehicle, with its own network ports and protocol."""


@command.command()
@filled
def ardrone2(
    *,
    vehicle: Annotated[
        Given,
        Fills(EmulatorOptions, "plant delay jitter downlink noise battery seed host"),
    ],
    client: list[str] | None = None,
    port_base: Annotated[int, Bounds(0, 65000)] = PORT_BASE,
    ports: Annotated[Given, Fills(EmulatorOptions, " ".join(PORTS), optional=True)],
    worst: Annotated[Given, Fills(EmulatorOptions, "worst_case=--worst-case/--forgiving")],
    duration: float | None = None,
    record: Path | None = None,
    until_input_ends: Annotated[bool, typer.Option()] = False,
    as_json: opt.As_json = False,
) -> None:
    """Emulate an AR.Drone 2.0 until Ctrl-C: navdata, commands and configuration, in real time.

    Parameters
    ----------
    client
        Answer only this IP address. For several addresses, repeat the option. Needed with --host.
    port_base
        Base of the port numbers. The ports are this number plus 1, 4, 5, 6 and 9. With 0, free
        ports are used.
    duration
        End after this time, s.
    record
        Write the true motion of the drone, without noise, to this CSV file.
    until_input_ends
        End when standard input ends, such as with the parent process.
    """
    if duration is not None:
        positive("--duration", duration)
    given = vehicle | ports_from(port_base) | ports | worst
    options = EmulatorOptions(**given, clients=tuple(client or ()))
    asyncio.run(_emulate(options, duration, record, until_input_ends, as_json))


async def _emulate(
    options: EmulatorOptions,
    duration: float | None,
    record: Path | None,
    until_input_ends: bool,
    as_json: bool,
) -> None:
    with ExitStack() as stack:
        journal = None if record is None else stack.enter_context(Journal(record, COLUMNS))
        async with Emulator(options) as emulator:
            print_address(emulator, as_json)
            ended = parent_ended() if until_input_ends else asyncio.Event()
            work: list[Coroutine[Any, Any, object]] = [ended.wait()]
            if journal is not None:
                work.append(_keep(emulator, journal))
            if not as_json and console.is_terminal:
                live = stack.enter_context(Live(console=console, auto_refresh=False))
                work.append(_show(emulator, live))
            tasks = [asyncio.create_task(part) for part in work]
            try:
                first = asyncio.FIRST_COMPLETED
                done, _ = await asyncio.wait(tasks, timeout=duration, return_when=first)
                for task in done:
                    task.result()
            finally:
                for task in tasks:
                    task.cancel()


def print_address(emulator: Emulator, as_json: bool) -> None:
    """Print the addresses and ports of the drone once it listens."""
    options = emulator.options
    warning = (
        f"Other computers can reach the emulator at {options.host}. The emulator answers only "
        f"{', '.join(options.clients)}, but addresses can be forged, and there is no "
        "authentication. Use a closed network."
    )
    if not options.only_here:
        print(f"deadtime: {warning}", file=sys.stderr)
    if as_json:
        found = {
            "host": emulator.host,
            **{name: getattr(emulator, name) for name in PORTS},
            "plant": options.plant,
            "delay": options.transport_delay,
            "worst_case": options.worst_case,
        }
        print(json.dumps(found), flush=True)
        return
    # The shared console would wrap the line in a file.
    Console(soft_wrap=True, highlight=False).print(
        f"The emulator of an AR.Drone 2.0 (plant {options.plant}, transport delay "
        f"{options.transport_delay:g} s) runs at {emulator.host}. UDP ports: navdata "
        f"{emulator.navdata_port}, commands {emulator.command_port}. TCP ports: configuration "
        f"{emulator.control_port}, files {emulator.ftp_port} (there are none), video "
        f"{emulator.video_port} (there is none). Ctrl-C ends the emulator.",
        markup=False,
    )
    sys.stdout.flush()


async def _show(emulator: Emulator, live: Live) -> None:
    while True:
        live.update(_line(emulator.truth()), refresh=True)
        await asyncio.sleep(SHOWN_EVERY)


def _line(truth: Truth) -> Text:
    parts = [
        f"{truth.time:6.1f} s",
        f"{truth.phase.value:<10}",
        f"{truth.height:6.3f} m",
        f"{truth.climb:+6.3f} m/s of {truth.setpoint:+6.3f}",
        f"battery {truth.battery:.0f} %",
    ]
    if truth.emergency:
        parts.append("EMERGENCY")
    elif truth.link_lost:
        parts.append("link lost")
    elif truth.connected:
        parts.append("heard")
    return Text("  ".join(parts), no_wrap=True, overflow="crop")


async def _keep(emulator: Emulator, journal: Journal) -> None:
    while True:
        truth = emulator.truth()
        landed = float(truth.phase is Phase.LANDED)
        row = (truth.time, truth.height, truth.climb, truth.setpoint, truth.battery, landed)
        journal.write(row)
        await asyncio.sleep(RECORDED_EVERY)
