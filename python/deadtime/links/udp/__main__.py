"""``python -m deadtime.links.udp controller|relay|plant``: each part as a process of its own.

Each prints its address as a line of JSON when it is ready, and its report as another one when it
ends: after its time, by Ctrl-C or SIGTERM, or with its parent process. No extras are needed, so
that either end can run on a small computer.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import math
import signal
import sys
from collections.abc import Coroutine, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from deadtime._base.errors import DeadtimeError
from deadtime._base.plain import plain
from deadtime._base.printable import one_line
from deadtime.links.addresses import Address
from deadtime.links.parent_watch import parent_ended
from deadtime.links.udp.controller import Controller, ControllerOptions
from deadtime.links.udp.described import DELAYS, POLICIES, network_from, network_of, policy_of
from deadtime.links.udp.endpoint import resolved, speaking_to
from deadtime.links.udp.plant import Plant
from deadtime.links.udp.plant_options import PlantOptions
from deadtime.links.udp.relay import Relay, RelayOptions

T = TypeVar("T", ControllerOptions, PlantOptions)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one part of the loop; the exit code is 0 on success only."""
    given = _parser().parse_args(arguments)
    try:
        asyncio.run(_until_stopped(given.run(given), given.until_input_ends))
    except (DeadtimeError, OSError, ValueError) as error:
        print(f"deadtime.links.udp: {one_line(str(error))}", file=sys.stderr)
        return 1
    return 0


async def _until_stopped(work: Coroutine[Any, Any, None], until_input_ends: bool) -> None:
    """Run, and end in an orderly way on a signal or at the end of standard input."""
    task = asyncio.ensure_future(work)
    loop = asyncio.get_running_loop()
    if until_input_ends:
        parent_watch = asyncio.ensure_future(parent_ended().wait())
        parent_watch.add_done_callback(lambda _: task.cancel())
    for number in (signal.SIGINT, signal.SIGTERM):
        with suppress(NotImplementedError, RuntimeError):  # Windows has no such handlers
            loop.add_signal_handler(number, task.cancel)
    with suppress(asyncio.CancelledError):
        await task


def _print_line(**what: Any) -> None:
    print(json.dumps(plain(what), allow_nan=False), flush=True)


def _ready(part: str, address: Address) -> None:
    _print_line(ready=part, host=address[0], port=address[1])


def _options(kind: type[T], given: argparse.Namespace) -> T:
    """The options of a part, from the arguments of the same names."""
    return kind(**{name: getattr(given, name) for name in kind.__dataclass_fields__})


async def _run_controller(given: argparse.Namespace) -> None:
    async with Controller(_options(ControllerOptions, given)) as controller:
        _ready("controller", controller.address)
        try:
            await controller.running(given.duration)
        finally:
            _print_line(report=controller.report().to_dict())


async def _run_relay(given: argparse.Namespace) -> None:
    words = {name: getattr(given, name) for name in PATHS}
    names = ("delay", "jitter", "loss", "burst", "duplication", "ordered")
    both = network_of(given.delays, **{name: getattr(given, name) for name in names})
    ways = {name: both if text is None else network_from(text) for name, text in words.items()}
    options = RelayOptions(given.to, **ways, seed=given.seed, listen=given.listen)
    async with Relay(options) as relay:
        _ready("relay", relay.address)
        try:
            await asyncio.sleep(given.duration)
        finally:
            paths = {name: getattr(relay, name) for name in PATHS}
            counts = {name: path.counts() for name, path in paths.items()}
            _print_line(report={**counts, "overflowed": relay.overflowed})


async def _run_plant(given: argparse.Namespace) -> None:
    controller = await resolved(given.controller)
    given.controller = controller
    given.listen = given.listen or speaking_to(controller)
    given.policy = policy_of(given.policy, given.policy_number)
    async with Plant(_options(PlantOptions, given)) as plant:
        _ready("plant", plant.address)
        try:
            await plant.running()
        finally:
            _print_line(report=plant.report().to_dict())


#: From the plant to the controller, and from the controller to the plant.
PATHS = ("forward_path", "return_path")

LOOPBACK = ("127.0.0.1", 0)


def _address(text: str) -> Address:
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdecimal() or int(port) > 65535:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not an address: give HOST:PORT, such as 127.0.0.1:5600"
        )
    return host.removeprefix("[").removesuffix("]") or "127.0.0.1", int(port)


def _time(text: str) -> float:
    time = float(text)
    if not time > 0.0:
        raise argparse.ArgumentTypeError(f"{text} s: give a time above zero")
    return time


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m deadtime.links.udp", description=__doc__)
    parts = parser.add_subparsers(required=True, metavar="controller|relay|plant")

    controller = parts.add_parser("controller", help="answer measurements with commands")
    controller.set_defaults(run=_run_controller)
    controller.add_argument("--gain", type=float, required=True, help="K, 1/s")
    controller.add_argument("--listen", type=_address, default=LOOPBACK, help="HOST:PORT")
    controller.add_argument("--plant", type=_address, help="answer only this address")
    controller.add_argument(
        "--every", action="store_true", help="answer every measurement; needed with a jitter buffer"
    )

    relay = parts.add_parser("relay", help="emulate the network between plant and controller")
    relay.set_defaults(run=_run_relay)
    relay.add_argument("--listen", type=_address, default=LOOPBACK, help="HOST:PORT")
    relay.add_argument("--to", type=_address, required=True, help="address of the controller")
    relay.add_argument("--delay", type=float, default=0.05, help="mean one-way delay, s")
    relay.add_argument(
        "--jitter", type=float, default=0.0, help="standard deviation of the delay, s"
    )
    relay.add_argument(
        "--delays", choices=DELAYS, default="gamma", help="distribution of the delay"
    )
    relay.add_argument("--loss", type=float, default=0.0, help="share of the packets that are lost")
    relay.add_argument("--burst", type=float, default=1.0, help="mean length of a burst of losses")
    relay.add_argument("--duplication", type=float, default=0.0, help="share that arrives twice")
    relay.add_argument("--ordered", action="store_true", help="no packet overtakes another")
    for path, which in zip(PATHS, ("to the controller", "to the plant"), strict=True):
        relay.add_argument(
            f"--{path.replace('_', '-')}",
            metavar="JSON",
            help=f"the network {which}, instead of the options above",
        )
    relay.add_argument("--seed", type=int, default=0, help="seed of delays and losses")

    plant = parts.add_parser("plant", help="simulate an integrator whose output is sampled")
    plant.set_defaults(run=_run_plant)
    plant.add_argument(
        "--controller",
        type=_address,
        required=True,
        help="address of the controller, or of a relay",
    )
    plant.add_argument(
        "--listen", type=_address, help="HOST:PORT. Default: where the controller can answer"
    )
    plant.add_argument("--gain", type=float, default=1.0, help="gain of the integrator")
    plant.add_argument("--lag", type=float, default=0.0, help="lag of the integrator, s")
    plant.add_argument(
        "--sample-time", type=float, default=0.01, help="time between measurements, s"
    )
    plant.add_argument("--rest", type=float, default=1.0, help="time before the step, s")
    plant.add_argument("--amplitude", type=float, default=1.0, help="size of the step")
    plant.add_argument(
        "--policy", choices=POLICIES, default="newest", help="policy for late commands"
    )
    plant.add_argument(
        "--policy-number",
        type=float,
        help="a time in s for the policies drop-late and jitter-buffer, or a number of samples for "
        "hold",
    )

    for part, duration in ((controller, math.inf), (relay, math.inf), (plant, 6.0)):
        part.add_argument("--duration", type=_time, default=duration, help="duration of the run, s")
        part.add_argument(
            "--until-input-ends",
            action="store_true",
            help="end with the parent process, when standard input ends",
        )
    for part in (controller, plant):
        part.add_argument(
            "--limit", type=float, default=20.0, help="largest magnitude of the command"
        )
        part.add_argument(
            "--watchdog", type=float, default=0.5, help="longest time without a packet, s"
        )
        part.add_argument(
            "--safe", type=float, default=0.0, help="command that applies after such a silence"
        )
        part.add_argument("--recording", type=Path, help="CSV file to write")
        part.add_argument(
            "--doubles",
            type=int,
            nargs=2,
            metavar=("IN", "OUT"),
            help="use plain doubles as Simulink does. IN and OUT are their numbers in a "
            "received and in a sent datagram",
        )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
